"""What a check calls "make it again", as the command line that does, for the artifact in which it found something."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from r2s2r_cli.checks.base import AGAIN
from r2s2r_cli.commands.mend import mending
from r2s2r_cli.commands.places import Place
from r2s2r_cli.errors import R2S2RError, quoted
from r2s2r_cli.store.from_here import project_option
from r2s2r_cli.store.project import ITERATIONS
from schemas.header import Header
from schemas.results import Finding
from schemas.versions import KINDS

_REMARK = "   # "
_FORCE = "--force"
_STATUS = "r2s2r status"


def told_again(findings: Iterable[Finding], path: Path, header: Header | None, place: Place | None) -> list[Finding]:
    """The findings of one file with `AGAIN` of their hints filled in, and `r2s2r status` for where this runs.

    header: of the artifact at `path`; place: its project.
    """
    told, again = list(findings), None
    for index, finding in enumerate(told):
        hint = finding.hint
        if AGAIN in hint:
            again = again or _again(path, header, place)
            hint = again.joined(hint.replace(AGAIN, "", 1).removeprefix(_REMARK))
        elif place is not None:
            hint = hint.replace(_STATUS, shlex.join([*_STATUS.split(), *project_option(place.root)]))
        told[index] = finding.model_copy(update={"hint": hint})
    return told


@dataclass(frozen=True)
class _Again:
    """command: to be pasted where this runs. own: its remark. measured: it shows runs of a robot, which had no source
    that could be mended first, so that what a check has to say of that is left out."""

    command: str
    own: str = ""
    measured: bool = False

    def joined(self, remark: str) -> str:
        """One line: the command, then its own remark and that of the check."""
        remarks = [text for text in (self.own, "" if self.measured else remark) if text]
        return self.command + (_REMARK + "; ".join(remarks) if remarks else "")


def _again(path: Path, header: Header | None, place: Place | None) -> _Again:
    """With the options of then. Where no command makes it again, what shows how it was made, and why that cannot be
    repeated. A hint moves no robot: of what one did it shows that."""
    looks = f"r2s2r inspect {quoted(path)}"
    if header is None or place is None or place.project is None or not _in_place(path, header, place.root):
        return _Again(looks, "how it was made: no stage writes it here")
    try:
        found = mending(place.project, header, path, ["its values are wrong"])
    except R2S2RError as error:
        return _Again(looks, f"how it was made: {error.what}")
    line, _, own = (found.command or found.runs).partition(_REMARK)
    if not line:
        return _Again(looks, f"how it was made: {found.why_not or 'what it was made from is not there'}")
    if line.startswith(f"r2s2r {header.provenance.stage} ") and _FORCE not in shlex.split(line):
        line += f" {_FORCE}"  # it looks fresh: nothing that it was made from has changed
    way = _way(place.root)
    return _Again(line if way == "." else f"cd {quoted(way)} && {line}", own, measured=not found.command)


def _way(root: Path) -> str:
    return os.path.relpath(root.resolve(), Path.cwd().resolve())


def _in_place(path: Path, header: Header, root: Path) -> bool:
    """Whether a stage of the project writes what this is to where it lies."""
    spec, folder = KINDS[header.kind], path.resolve().parent
    home = folder if spec.level == "project" else folder.parent
    wanted = root.resolve() if spec.level == "project" else root.resolve() / ITERATIONS
    return path.name in spec.filenames and home == wanted
