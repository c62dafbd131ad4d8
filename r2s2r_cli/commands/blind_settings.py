"""`r2s2r blind run --set`: only what `diagnose` knows, of the type that it has there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest_choice


def require_settings(found: Mapping[str, object]) -> None:
    """Raises UsageError for a setting that `diagnose` does not have, or of another type: else every set would break
    off, and count as a miss."""
    from r2s2r_cli.stages.diagnose.diagnose import Settings

    kinds: dict[str, tuple[type, ...]] = {"threads": (int,), "effects": (list, tuple)}
    for one in fields(Settings):
        if isinstance(one.default, bool | int | float):
            kinds[one.name] = (int, float) if isinstance(one.default, float) else (type(one.default),)
    for key, value in found.items():
        if key not in kinds:
            raise UsageError("there is no such setting", where="--set", expected=", ".join(sorted(kinds)),
                             received=key, hint=f"--set {nearest_choice(key, tuple(kinds))}=")  # fmt: skip
        if not isinstance(value, kinds[key]) or (isinstance(value, bool) and bool not in kinds[key]):
            raise UsageError(f"the value of {key} is not allowed", where=f"--set {key}", received=str(value),
                             expected=" or ".join(kind.__name__ for kind in kinds[key]),
                             hint="r2s2r blind run --help")  # fmt: skip
