"""Files that other commands take: `validate` says what they are and which command that is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from r2s2r_cli.errors import quoted
from r2s2r_cli.store.project import JOURNAL_SUFFIX

HEAD_BYTES = 64 * 1024
"""Enough for the header of a table, or the first entry of a history."""
MASSES = "[[part]] tables: weighed parts"


class SourceFile(NamedTuple):
    """What a file is, in words, and the command that takes it."""

    words: str
    command: str


def what_source(path: Path) -> SourceFile | None:
    """What kind of source a file is, by its ending and its first line; None for none of them."""
    if not path.is_file():
        return None
    name, suffix = quoted(path), path.suffix.lower()
    if suffix == JOURNAL_SUFFIX:
        return SourceFile("a recording that was cut off", f"r2s2r recover {name}")
    if suffix == ".csv":
        header = _head(path).partition("\n")[0].lower()
        if "displacement" in header:
            return SourceFile("tendon curves, measurements for calibrate", f"r2s2r calibrate --tendons {name}")
        if "capacitance" in header and "cap0_" not in header:
            return SourceFile("points of sensors, measurements for calibrate", f"r2s2r calibrate --points {name}")
        return SourceFile("a .csv file", f"r2s2r import {name}")
    if suffix == ".json":
        if "m_pF_per_mm" in _head(path):
            return SourceFile("a history of calibrations", f"r2s2r calibrate --history {name}")
        return SourceFile("a .json file", "r2s2r import --help")
    return None


def other_than_log(path: Path) -> SourceFile | None:
    """What a file is that somebody took for a log, and the command that takes it; None where it may be a log."""
    if not path.is_file():
        return None
    suffix, name = path.suffix.lower(), quoted(path)
    if suffix == ".h5":
        return SourceFile("an HDF5 file", f"r2s2r inspect {name}")
    if suffix == ".toml":
        return SourceFile("a TOML file", f"r2s2r validate {name}")
    found = what_source(path)
    if found is None or "r2s2r import" in found.command or "cap0_" in _head(path).partition("\n")[0].lower():
        return None
    return found


def is_masses(values: Mapping[str, object]) -> bool:
    """Whether a TOML file holds weighed parts for `calibrate`."""
    return set(values) == {"part"} and isinstance(values["part"], list)


def _head(path: Path) -> str:
    """The first characters; empty where they cannot be read, which the command that takes the file then says."""
    try:
        with path.open("rb") as file:
            return file.read(HEAD_BYTES).decode("utf-8-sig", errors="replace")
    except OSError:
        return ""
