"""`r2s2r migrate`: artifacts of an earlier version become artifacts of the current one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.console import Console, print_error
from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.options import DryRunOption, JsonOption, ProjectOption, QuietOption
from schemas.results import MigrateResult


def migrate(
    files: Annotated[list[Path] | None, typer.Argument(help="Artifacts; default: all of the project.")] = None,
    dry_run: DryRunOption = False,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Bring artifacts of an earlier version to the current one; the old file stays beside it as NAME.vN.

    What is current already is left alone. Old artifacts can be read without this; it saves the work each time.

    Example: r2s2r migrate --dry-run
    """
    from r2s2r_cli.store.lock import writing_at
    from r2s2r_cli.store.migrate import migrate_file, plan
    from r2s2r_cli.store.project import Project

    console = Console(json=json, quiet=quiet)
    paths = files or Project.find(project).artifacts()
    done: dict[str, str] = {}
    failed: dict[str, R2S2RError] = {}
    with console.progress("artifacts", len(paths)) as advance:
        for path in paths:
            try:
                if dry_run or not plan(path).needed:
                    done[str(path)] = plan(path).words
                else:
                    with writing_at(path, "migrate"):
                        done[str(path)] = migrate_file(path).words
            except R2S2RError as error:
                failed[str(path)] = error
            advance(1)
    console.document(MigrateResult(files=done, failed={name: error.what for name, error in failed.items()}))
    for name, words in done.items():
        console.data(f"{name}: {words}")
    if not paths:
        console.say("the project has no artifacts yet")
    for problem in failed.values():
        print_error(problem, as_json=False)
    if failed:
        raise typer.Exit(int(max(problem.exit_code for problem in failed.values())))
