"""The logs that a damaged recording was imported from, as far as its head, or what lies beside it, still says.

Nothing makes a recording again by its place alone: a robot's runs are gone with it. One that was imported loses nothing
where its logs are there, and only `import --force` replaces a recording whose runs nobody can compare.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import ITERATIONS, iteration_number, root_of
from schemas.header import Provenance
from schemas.versions import KINDS

GUESSED = "a guess, from the names of its runs: what it was made from cannot be read"
_LOG = ".csv"


def import_again(path: Path, made: Provenance | None = None) -> str:
    """The command that imports the recording at `path` once more, to be pasted where this runs; empty where it is no
    recording of a project, was not imported, or its logs are not there. made: how it was made, where its head can be
    read; without it the logs are guessed, and the command says so."""
    path = path.absolute()
    root, number = root_of(path), iteration_number(path.parent)
    if root is None or number is None or path != root / ITERATIONS / path.parent.name / KINDS["recording"].filename:
        return ""
    here = Path.cwd().is_relative_to(root)
    if made is not None:
        from r2s2r_cli.store.again import command_again

        logs = [root / ref.path for ref in made.inputs if ref.kind in ("file", "folder")]
        if made.stage != "import" or not logs or not all(log.exists() for log in logs):
            return ""
        if root == Path.cwd():
            return command_again(made, path, force=True)
    else:
        logs = _guessed(path, root)
        if not logs:
            return ""
    words = ["r2s2r", "import", *(os.path.relpath(log) for log in logs), "--iteration", str(number), "--force"]
    line = shlex.join([*words, *([] if here else ["--project", os.path.relpath(root)])])
    return line if made is not None else f"{line}   # {GUESSED}"


def look_at(path: Path) -> str:
    """The hint for a file in which there is nothing of ours, and that no known command makes again."""
    recording = path.name == KINDS["recording"].filename and root_of(path.absolute()) is not None
    return f"file {quoted(path)}" + "   # if it was imported: r2s2r import LOG --force" * recording


def _guessed(path: Path, root: Path) -> list[Path]:
    """A log in the project's folder for each run; none where one is missing."""
    logs = []
    for run in _runs(path):
        found = next((one for one in (root / f"{run}{_LOG}", root / run) if one.exists()), None)
        if found is None:
            return []
        logs.append(found)
    return logs


def _runs(path: Path) -> list[str]:
    """Names of the runs: of the states that were estimated from it, else of the pictures of it."""
    try:
        held = read_header(path.with_name(KINDS["estimate"].filename)).datasets
    except ArtifactError:
        return sorted(one.stem.removeprefix(f"{path.stem}-") for one in path.parent.glob(f"{path.stem}-*.png"))
    return sorted({name.split("/")[1] for name in held if name.startswith("runs/")})
