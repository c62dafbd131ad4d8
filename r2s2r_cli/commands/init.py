"""`r2s2r init`: a new project: settings, robot description, Makefile."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import UsageError
from r2s2r_cli.options import JsonOption, QuietOption
from r2s2r_cli.store.atomic import write_text
from r2s2r_cli.store.first_data import first_data
from r2s2r_cli.store.project import ITERATIONS, PROJECT_FILE
from schemas.results import InitResult


class Attachment(StrEnum):
    """What `--attachment` takes."""

    SURFACE = "surface"
    ROD_END = "rod_end"


def init(
    directory: Annotated[Path, typer.Argument(help="Directory of the new project; made if it is not there.")] = Path(),
    robot: Annotated[
        str, typer.Option("--robot", help="threebar | threebar-330 | sixbar (illustrative).")
    ] = "threebar",
    attachment: Annotated[
        Attachment,
        typer.Option("--attachment", help="Where cables attach: surface as in the paper, rod_end as in NTRT."),
    ] = Attachment.SURFACE,
    name: Annotated[str | None, typer.Option("--name", help="Project name; default: that of the directory.")] = None,
    sample: Annotated[
        bool, typer.Option("--sample", help="Add sample.csv: closed-form kinematics, labelled so, to try import on.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the sample's noise.")] = 0,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Make a project: project.toml (settings), robot.toml (the robot, every number with its source), Makefile.

    Example: r2s2r init myrobot --robot threebar
    """
    from r2s2r_cli.commands.identify_hints import typed_options
    from r2s2r_cli.stages.init.init import init_texts
    from r2s2r_cli.stages.init.project_file import project_toml

    console = Console(json=json, quiet=quiet)
    root = directory.absolute()
    title = name or root.name or "project"
    typed = typed_options(
        robot=None if robot == "threebar" else robot, sample=sample, name=name, seed=seed or None, json=json,
        attachment=None if attachment is Attachment.SURFACE else attachment.value, quiet=quiet,
    )  # fmt: skip
    title.encode()  # a name that is not text cannot stand in project.toml: UnicodeEncodeError says so
    with _whole_hints(directory, typed):
        texts = init_texts(robot, attachment.value, sample_seed=seed if sample else None)
    files = {PROJECT_FILE: project_toml(title), **texts, "Makefile": _makefile()}
    _refuse_overwriting(root, files, _command(_free(directory), typed))
    _write(root, files)
    console.document(InitResult(project=title, robot=robot, files=tuple(files)))
    for file in files:
        console.data(str(directory / file))
    first = "r2s2r import sample.csv" if sample else first_data(root, here=root)
    console.hint(f"cd {shlex.quote(str(directory))} && {first}" if str(directory) != "." else first)


def _write(root: Path, files: Mapping[str, str]) -> None:
    """All of them, or none: half a project would be in the way of the next attempt."""
    done: list[Path] = []
    try:
        for file, text in files.items():
            write_text(root / file, text)
            done.append(root / file)
        (root / ITERATIONS).mkdir(exist_ok=True)
    except BaseException:
        for path in done:
            path.unlink(missing_ok=True)
        raise


def _makefile() -> str:
    return resources.files("r2s2r_cli").joinpath("templates", "project.mk").read_text(encoding="utf-8")


@contextmanager
def _whole_hints(directory: Path, typed: Sequence[str]) -> Iterator[None]:
    """An error of the stage leaves with a command for the same directory, with the other options as typed."""
    from r2s2r_cli.commands.identify_hints import completed

    try:
        yield
    except UsageError as error:
        error.hint = _command(directory, shlex.split(completed(error, typed, "r2s2r init"))[2:])
        raise


def _command(directory: Path, options: Sequence[str]) -> str:
    return shlex.join(["r2s2r", "init", *([] if directory == Path() else [str(directory)]), *options])


def _free(directory: Path) -> Path:
    """A directory beside this one that is not there yet: its name and a number."""
    name = directory.name if directory.name not in ("", "..") else directory.resolve().name
    beside = directory.parent if directory.name not in ("", "..") else directory / ".."
    return next(one for k in itertools.count(2) if not (one := beside / f"{name}-{k}").exists())


def _refuse_overwriting(root: Path, files: dict[str, str], elsewhere: str) -> None:
    """Raises UsageError where something is in the way. elsewhere: the command that fills another directory."""
    if root.exists() and not root.is_dir():
        raise UsageError("a file is in the way of the project directory", where=str(root), expected="a directory",
                         received="a file", hint=elsewhere)  # fmt: skip
    present = [name for name in files if (root / name).exists()]
    if present:
        raise UsageError("there is something here already, and init overwrites nothing", where=str(root / present[0]),
                         expected="a new or empty directory", received=", ".join(present),
                         hint=elsewhere)  # fmt: skip
