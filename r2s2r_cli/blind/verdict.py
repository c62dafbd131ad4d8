"""The file of a verdict, as `blind run` leaves it for what follows it up and for what scores it."""

from __future__ import annotations

import json
import os
from hashlib import sha256
from pathlib import Path
from typing import Any

from r2s2r_cli.blind.seam import WHOLE
from r2s2r_cli.errors import InputError

FORMAT = "r2s2r blind verdict 1"


def write_document(path: Path, document: dict[str, Any]) -> None:
    """The file, whole or not at all; its folder is made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".part{os.getpid()}")
    text = json.dumps(document, indent=1, sort_keys=True) + "\n"
    with WHOLE:
        part.write_text(text, encoding="utf-8")
        part.replace(path)


def read_verdict(path: Path, index: str | None = None) -> dict[str, Any]:
    """A file of `blind run`, with its SHA-256. index: of the bank that it must be of. Raises InputError where it is
    none, of another bank, or reached for the truth."""
    try:
        data = path.read_bytes()
        verdict: dict[str, Any] = json.loads(data)
        of, _, _ = verdict["index"], verdict["logs"], verdict["shuffled"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise unreadable(path, error) from error
    if index not in (None, of):
        raise InputError("a verdict was found on another bank, or on another list of this one", where=str(path),
                         expected=str(index), received=str(of),
                         hint="r2s2r blind run bank --out verdicts-2")  # fmt: skip
    if verdict.get("refused"):
        raise InputError("a verdict reached for the truth", where=str(path), expected="nothing refused",
                         received=str(verdict["refused"][0]), hint=f"rm {path}")  # fmt: skip
    return {**verdict, "sha256": sha256(data).hexdigest()}


def unreadable(path: Path, error: Exception) -> InputError:
    """What is raised where a file is no verdict."""
    return InputError("a verdict cannot be read", where=str(path), expected=f"a file of `blind run` ({FORMAT})",
                      received=str(error), hint=f"rm {path}")  # fmt: skip
