"""`r2s2r blind run --set`: only what `diagnose` knows, of the type that it has there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest_choice


def require_settings(found: Mapping[str, object]) -> None:
    """Raises UsageError for a setting that `diagnose` does not have, or of another type: else every set would break
    off, and count as a miss."""
    if not found:  # what `diagnose` has need not be loaded for that
        return
    from r2s2r_cli.stages.diagnose.diagnose import Settings

    usual: dict[str, Any] = {"threads": 1, "effects": []}
    usual |= {one.name: one.default for one in fields(Settings) if isinstance(one.default, bool | int | float)}
    for key, value in found.items():
        if key not in usual:
            raise UsageError("there is no such setting", where="--set", expected=", ".join(sorted(usual)), received=key,
                             hint=f"--set {nearest_choice(key, usual)}={json.dumps(value)}")  # fmt: skip
        kind = type(usual[key])
        if type(value) is not kind and not (kind is float and type(value) is int):
            raise UsageError(f"the value of {key} is not allowed", where=f"--set {key}", received=str(value),
                             expected=kind.__name__, hint=f"--set {key}={json.dumps(usual[key])}")  # fmt: skip
