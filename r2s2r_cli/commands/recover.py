"""`r2s2r recover`: after a crash, a pulled cable or a bad disk, bring back what is there."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.console import Console, print_error
from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption
from schemas.results import RecoverResult


def recover(
    files: Annotated[
        list[Path] | None,
        typer.Argument(help="Journals or damaged artifacts; default: all unsealed journals of the project."),
    ] = None,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Seal recordings that were cut off, restore damaged artifacts where the digests prove every number.

    Of an artifact that cannot be restored, every intact dataset goes into NAME.rescued.npz. Nothing is overwritten:
    a damaged file that was restored is kept as NAME.damaged. Without files, what killed commands left is swept too.

    Example: r2s2r recover iterations/001/10-record.h5
    """
    from r2s2r_cli.store.isolated import IsolatedReader
    from r2s2r_cli.store.lock import writing_at
    from r2s2r_cli.store.recover import recover_file

    console = Console(json=json, quiet=quiet)
    removed, paths = ([], files) if files else _leftovers(project)
    done: dict[str, str] = {}
    rows: Counter[str] = Counter()
    failed: dict[str, R2S2RError] = {}
    with IsolatedReader() as reader, console.progress("files", len(paths)) as advance:
        for path in paths:
            try:
                with writing_at(path, "recover"):
                    result = recover_file(path, reader)
                done[str(path)] = result.words
                rows.update(result.rows)
            except R2S2RError as error:
                failed[str(path)] = error
            advance(1)
    whats = {name: f"{error.what} ({error.where})" for name, error in failed.items()}
    console.document(
        RecoverResult(files=done, failed=whats, rows=dict(rows), removed=tuple(str(path) for path in removed))
    )
    for name, words in done.items():
        console.data(f"{name}: {words}")
    for path in removed:
        console.data(f"{path}: removed, a command that was killed left it unfinished")
    if not paths and not removed:
        console.say("nothing to recover: no unsealed recording, no damaged artifact, nothing of a killed command")
    if not files:
        _say_checkpoints(project, console)
    for problem in failed.values():
        print_error(problem, as_json=False)
    if failed:
        raise typer.Exit(int(max(problem.exit_code for problem in failed.values())))


def _say_checkpoints(start: Path | None, console: Console) -> None:
    """What was interrupted and waits to be gone on with: `recover` leaves it alone, and must not seem to deny it."""
    from r2s2r_cli.commands.unfinished import checkpoints
    from r2s2r_cli.store.project import Project

    project = Project.find(start)
    for kept in checkpoints(project).values():
        console.say(f"{kept.name}: interrupted; {kept.use}")


def _leftovers(start: Path | None) -> tuple[list[Path], list[Path]]:
    """What killed writers left unfinished, swept away; and the journals and damaged artifacts of the project."""
    from r2s2r_cli.store.atomic import sweep
    from r2s2r_cli.store.lock import writing
    from r2s2r_cli.store.project import Project
    from r2s2r_cli.store.recover import is_intact

    project = Project.find(start)
    with writing(project.root, "recover"):
        folders = [project.root, *(iteration.path for iteration in project.iterations())]
        removed = [path for folder in folders for path in sweep(folder)]
    damaged = [path for path in project.artifacts() if not is_intact(path)]
    return removed, [*project.journals(), *damaged]
