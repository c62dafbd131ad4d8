"""The list of a bank's sets: what was committed to before any was diagnosed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import InputError

FORMAT = "r2s2r blind bank 1"


def digest(folder: Path) -> str:
    """SHA-256 of all files of a set, names included."""
    whole = sha256()
    for path in sorted(one for one in folder.rglob("*") if one.is_file()):
        whole.update(f"{path.relative_to(folder).as_posix()}\n".encode())
        whole.update(sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def index_text(
    tier: str, bank: str, sets: dict[str, dict[str, str]], made_by: str, makers: Sequence[dict[str, Any]] = ()
) -> str:
    """The text of `index.json`. sets: {"label": commitment, "logs": digest} by name. makers: all code that made it
    (`code`); none: not known, as in the lists of versions before."""
    found = {"format": FORMAT, "tier": tier, "bank": bank, "made_by": made_by, "sets": sets}
    return json.dumps({**found, **({"makers": list(makers)} if makers else {})}, indent=1, sort_keys=True) + "\n"


def read_index(path: Path) -> tuple[dict[str, Any], str]:
    """The list, and its own SHA-256. Raises InputError where it is none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise _no_index(str(path), error) from error
    return index_of(data, where=str(path))


def index_of(data: bytes, *, where: str) -> tuple[dict[str, Any], str]:
    """The list of these bytes, and their SHA-256. Raises InputError where it is none."""
    try:
        found = json.loads(data)
        if found["format"] != FORMAT:
            raise ValueError(f"format {found['format']!r}")
        for one in found.get("makers", ()):
            if not isinstance(one["sources_sha256"], str) or not isinstance(one["commit"], str | None):
                raise ValueError("makers of the bank are no digests")
    except (ValueError, KeyError, TypeError) as error:
        raise _no_index(where, error) from error
    return found, sha256(data).hexdigest()


def _no_index(where: str, error: Exception) -> InputError:
    return InputError(
        "the list of the blind sets cannot be read", where=where, expected=f"index.json of a bank ({FORMAT})",
        received=str(error), hint="r2s2r blind make bank --key labels.key",
    )  # fmt: skip
