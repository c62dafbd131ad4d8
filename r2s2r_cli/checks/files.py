"""Can the file be read at all? These checks always run; where one fails with an error, the exit code is 4."""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.checks.base import Found, check
from r2s2r_cli.checks.subjects import Reading


@check(
    "error",
    Reading,
    what="the file is there, and is an artifact or a TOML file that its model accepts",
    why="nothing else can be checked, and every other command refuses the file as well",
    fix="ls -la '{file}'",
)
def file_opens(reading: Reading) -> Iterator[Found]:
    """Missing, unreadable, not an artifact, a damaged head, wrong TOML."""
    for error in () if reading.newer else reading.refused:
        yield Found(error.where, error.what, error.expected, error.received, error.hint)


@check(
    "error",
    Reading,
    what="this r2s2r knows the kind of the artifact, and its schema version or a migration from it",
    why="a newer version may mean something else by the same name; guessing would be silent damage",
    fix="pip install --upgrade r2s2r",
)
def version_known(reading: Reading) -> Iterator[Found]:
    """An artifact of a newer r2s2r."""
    for error in reading.refused if reading.newer else ():
        yield Found(error.where, error.what, error.expected, error.received)


@check(
    "error",
    Reading,
    what="every dataset, attribute and the provenance are what was sealed",
    why="a disk, a copy or an editor changed the file; the damaged dataset is named, the others may be intact",
    fix="r2s2r recover '{file}'",
)
def content_intact(reading: Reading) -> Iterator[Found]:
    """Damage behind an intact head, or together with a damaged one."""
    for place in reading.damage:
        yield Found(place.where.lstrip("/"), place.what, place.expected, place.received)


@check(
    "warning",
    Reading,
    what="the bytes of the file are those that were sealed, also those that nothing reads",
    why="the content hash proves that no value changed, but something writes to your files or your disk is failing",
    fix="r2s2r recover '{file}'",
)
def bytes_intact(reading: Reading) -> Iterator[Found]:
    """Bytes changed that nothing reads."""
    if reading.unread_bytes and not reading.damage:
        yield Found("", "bytes changed that nothing reads; the content hash still holds", "the sealed bytes", "others")


ALWAYS = (file_opens, version_known, content_intact, bytes_intact)
"""Run on every file, whatever is selected: what cannot be read cannot be said to have passed."""
