"""Can the file be read at all? These checks always run; where one says no, the exit code is 4, for wrong values 3."""

from __future__ import annotations

import re
from collections.abc import Iterator

from r2s2r_cli.checks.base import Found, check
from r2s2r_cli.checks.subjects import Reading
from r2s2r_cli.errors import UPDATE_CLONE

_LIBRARY = re.compile(r"(can't|cannot|unable to|unable) [\w ]+\(.*\)$")
"""Form of the messages of HDF5: `Can't open object (addr overflow, ...)`."""


@check(
    "error",
    Reading,
    what="the file is there, and is an artifact or TOML",
    why="nothing else can be checked, and every other command refuses the file as well",
    fix="ls -la {file}",
)
def file_opens(reading: Reading) -> Iterator[Found]:
    """Missing, unreadable, not an artifact, a damaged head, broken TOML."""
    for error in () if reading.newer else reading.refused:
        yield Found(error.where, error.what, error.expected, in_words(error.received), error.hint)


@check(
    "error",
    Reading,
    what="every key of a TOML file is known, none is missing, and the values are allowed",
    why="every command that needs the file refuses it; a misspelt key would else be a silent default",
    fix="correct the named key in {file}",
)
def values_allowed(reading: Reading) -> Iterator[Found]:
    """A TOML file that can be read, and that its model does not accept."""
    for error in reading.wrong:
        yield Found(error.where, error.what, error.expected, error.received, error.hint)


@check(
    "error",
    Reading,
    what="this r2s2r knows the kind of the artifact, and its schema version or a migration from it",
    why="a newer version may mean something else by the same name; guessing would be silent damage",
    fix=UPDATE_CLONE,
)
def version_known(reading: Reading) -> Iterator[Found]:
    """An artifact of a newer r2s2r."""
    for error in reading.refused if reading.newer else ():
        yield Found(error.where, error.what, error.expected, error.received, error.hint)


@check(
    "error",
    Reading,
    what="every dataset, attribute and the provenance are what was sealed",
    why="a disk, a copy or an editor changed the file; the damaged dataset is named, the others may be intact",
    fix="r2s2r recover {file}",
)
def content_intact(reading: Reading) -> Iterator[Found]:
    """Damage behind an intact head, or together with a damaged one."""
    for place in reading.damage:
        yield Found(place.where.lstrip("/"), place.what, place.expected, in_words(place.received), place.hint)


@check(
    "warning",
    Reading,
    what="the bytes of the file are those that were sealed, also those that nothing reads",
    why="the content hash proves that no value changed, but something writes to your files or your disk is failing",
    fix="r2s2r recover {file}",
)
def bytes_intact(reading: Reading) -> Iterator[Found]:
    """Bytes changed that nothing reads."""
    if reading.unread_bytes and not reading.damage:
        yield Found("", "bytes changed that nothing reads; the content hash still holds", "the sealed bytes", "others")


def in_words(received: str) -> str:
    """The text itself; what the HDF5 library says of damaged bytes in its own terms becomes words."""
    text = received.lower()
    if "filter returned failure" in text or "fletcher32" in text:
        return "bytes that do not match their checksum"
    return "bytes from which no HDF5 object can be made" if _LIBRARY.match(text) else received


ALWAYS = (file_opens, values_allowed, version_known, content_intact, bytes_intact)
"""Run on every file, whatever is selected: what cannot be read cannot be said to have passed."""
