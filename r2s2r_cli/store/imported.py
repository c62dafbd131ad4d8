"""The logs that a damaged recording was imported from, as far as its head, or what lies beside it, still says.

Nothing makes a recording again by its place alone: a robot's runs are gone with it. One that was imported loses nothing
where its logs are there, and only `import --force` replaces a recording whose runs nobody can compare.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from r2s2r_cli.errors import ArtifactError, quoted
from r2s2r_cli.store.canonical import source_sha256
from r2s2r_cli.store.from_here import project_option
from r2s2r_cli.store.header import TEXTS, read_header
from r2s2r_cli.store.log_folders import MOST_FILES, SOURCES, log_folders
from r2s2r_cli.store.project import ITERATIONS, iteration_number, root_of
from schemas.header import Provenance
from schemas.versions import KINDS

GUESSED = "a guess, from the names of its runs: what it was made from cannot be read"
_LOG = ".csv"
_MOST_BYTES = 1 << 28
"""Of a log that is compared with what was read then, in a second or so."""


def import_again(path: Path, made: Provenance | None = None) -> str:
    """The command that imports the recording at `path` once more, to be pasted where this runs; empty where it is no
    recording of a project, was not imported, or its logs are not there. made: how it was made, where its head can be
    read; without it the logs are guessed, and the command says so."""
    path = path.absolute()
    root, number = root_of(path), iteration_number(path.parent)
    if root is None or number is None or path != root / ITERATIONS / path.parent.name / KINDS["recording"].filename:
        return ""
    if made is not None:
        from r2s2r_cli.store.again import command_again

        made = _found_again(made, root) if made.stage == "import" else None
        if made is None:
            return ""
        logs = [root / ref.path for ref in made.inputs if ref.kind in SOURCES]
        if root == Path.cwd():
            return command_again(made, path, force=True)
    else:
        logs = _guessed(path, root)
        if not logs:
            return ""
    words = ["r2s2r", "import", *(os.path.relpath(log) for log in logs), "--iteration", str(number), "--force"]
    line = shlex.join([*words, *project_option(root)])
    return line if made is not None else f"{line}   # {GUESSED}"


def look_at(path: Path) -> str:
    """The hint for a file in which there is nothing of ours, and that no known command makes again."""
    if path.suffix.lower() in TEXTS:
        return f"r2s2r validate {quoted(path)}"
    if root_of(path.absolute()) is None or not any(path.name in kind.filenames for kind in KINDS.values()):
        return f"file {quoted(path)}"
    if path.name == KINDS["recording"].filename:
        return f"file {quoted(path)}   # if it was imported: r2s2r import LOG --force"
    # While it is there `status` sends its reader here again.
    return f"mv -n {quoted(path)} {quoted(f'{path}.lost')}   # nothing in it can be brought back"


def _found_again(made: Provenance, root: Path) -> Provenance | None:
    """How it was made, with the logs where they lie now: one that was moved to another folder of logs is known by its
    bytes. None where one is gone, and where there was none."""
    inputs = []
    folders: list[Path] | None = None  # heads of recordings are read for them: once, and where a log is missing
    for ref in made.inputs:
        place = root / ref.path
        if ref.kind in SOURCES and not place.exists():
            folders = log_folders(root) if folders is None else folders
            elsewhere = (folder / place.name for folder in folders)
            moved = next((log for log in elsewhere if ref.kind == "file" and _holds(log, ref.sha256)), None)
            if moved is None:
                return None
            ref = ref.model_copy(update={"path": Path(os.path.relpath(moved, root.resolve())).as_posix()})
        inputs.append(ref)
    return made.model_copy(update={"inputs": tuple(inputs)}) if any(ref.kind in SOURCES for ref in inputs) else None


def _holds(log: Path, sha256: str) -> bool:
    try:
        return log.is_file() and log.stat().st_size <= _MOST_BYTES and source_sha256(log) == sha256
    except OSError:
        return False


def _guessed(path: Path, root: Path) -> list[Path]:
    """A log for each run, in a folder where logs lie; none where one is missing."""
    runs, folders = _runs(path)[: MOST_FILES + 1], log_folders(root)
    if len(runs) > MOST_FILES:  # nobody pastes a line of so many
        return []
    logs = []
    for run in runs:
        candidates = (log for folder in folders for log in (folder / f"{run}{_LOG}", folder / run))
        found = next((log for log in candidates if log.exists()), None)
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
