"""`r2s2r export`: an artifact as CSV tables, npz, a trajectory log or a policy file; a robot as a MuJoCo model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import StrEnum
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.console import Console
from r2s2r_cli.errors import InputError, UsageError, quoted
from r2s2r_cli.options import ForceOption, JsonOption, QuietOption
from r2s2r_cli.store.atomic import write_bytes
from schemas.results import ExportResult

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from schemas.header import Header


class Format(StrEnum):
    """What `--to` takes."""

    CSV = "csv"
    NPZ = "npz"
    TRAJECTORY = "trajectory"
    POLICY = "policy"
    MJCF = "mjcf"


def export(
    path: Annotated[Path, typer.Argument(help="The artifact; for mjcf a robot.toml or a project.")],
    to: Annotated[
        Format,
        typer.Option(
            "--to",
            help="csv: tables and images; npz: arrays; trajectory: a log that import reads; policy; "
            "mjcf: a MuJoCo model of a robot.toml.",
        ),
    ] = Format.CSV,
    run: Annotated[str | None, typer.Option("--run", help="Only this run (trajectory, policy); default: all.")] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="mjcf: another value for a key of robot.toml; repeatable."),
    ] = None,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Directory to write into.")] = Path(),
    force: ForceOption = False,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Write what an artifact holds in a form that other programs read.

    Example: r2s2r export iterations/001/20-estimate.h5 --to csv --out exported
    """
    console = Console(json=json, quiet=quiet)
    if set_ and to != Format.MJCF:
        raise UsageError("only a robot has values to set; an artifact holds what was measured", where="--set",
                         expected="--to mjcf", received=f"--to {to}",
                         hint=f"r2s2r export {quoted(path)} --to {to}")  # fmt: skip
    if run and to not in (Format.TRAJECTORY, Format.POLICY):
        raise UsageError("only trajectory and policy take one run", where="--run", expected="--to trajectory | policy",
                         received=f"--to {to}", hint=f"r2s2r export {quoted(path)} --to {to}")  # fmt: skip
    names, files = _robot_files(path, set_ or []) if to == Format.MJCF else _artifact_files(path, to, run)
    _require_free([out / name for name in names], out, force)
    written = [_write(out / name, content) for name, content in files]
    console.document(ExportResult(source=str(path), format=to, files=tuple(map(str, written))))
    for name in written:
        console.data(str(name))


_Files = tuple[Sequence[str], Iterable[tuple[str, bytes]]]
"""Names of the files, and each with its content, made when it is written: of pictures only one at a time fits."""


def _robot_files(path: Path, overrides: list[str]) -> _Files:
    from r2s2r_cli.commands.export_mjcf import mjcf_file

    name, content = mjcf_file(path, overrides)
    return [name], [(name, content)]


def _artifact_files(path: Path, to: Format, run: str | None) -> _Files:
    from r2s2r_cli.stages.export.tables import csv_files, csv_names
    from r2s2r_cli.store.read import read_artifact
    from schemas.versions import KINDS

    header, data = read_artifact(path, blobs=to == Format.CSV)
    if to == Format.CSV:
        asked = (data, KINDS[header.kind], path.stem)
        return csv_names(*asked), csv_files(*asked)
    files = _few_files(path, to, run, header, data)
    return [name for name, _ in files], files


def _few_files(path: Path, to: Format, run: str | None, header: Header, data: ArtifactData) -> list[tuple[str, bytes]]:
    from r2s2r_cli.stages.export.logs import policy_file, trajectory_files
    from r2s2r_cli.stages.export.tables import npz_file

    if to == Format.NPZ:
        return [npz_file(data, path.stem, header.model_dump_json())]
    if header.kind != "recording":
        raise InputError(f"only a recording can be exported as a {to}", where=str(path), expected="recording",
                         received=header.kind, hint=f"r2s2r export {quoted(path)} --to csv")  # fmt: skip
    runs = [run] if run else data.runs()
    if run and run not in data.runs():
        raise UsageError("there is no such run", where=str(path), expected=" | ".join(data.runs()), received=run,
                         hint=f"r2s2r inspect {quoted(path)}")  # fmt: skip
    if to == Format.POLICY:
        return [policy_file(data, name, source=str(path)) for name in runs]
    return [file for name in runs for file in trajectory_files(data, name, source=str(path))]


def _require_free(targets: Iterable[Path], out: Path, force: bool) -> None:
    """Before the first is written: files of two exports beside each other would look like one. Raises UsageError."""
    for path in targets:
        if path.is_dir() or (path.exists() and not force):
            raise UsageError("the file is in the way", where=str(path), expected="a new file",
                             received="a directory" if path.is_dir() else "one that exists",
                             hint=f"--out {quoted(_unused(out))}   # or with --force: it is overwritten")  # fmt: skip


def _unused(out: Path) -> Path:
    """A directory beside `out` that is not there yet; of the working directory one in it."""
    first = out / "exported" if not out.name else out
    return next(path for number in count(1) if not (path := _numbered(first, number)).exists())


def _numbered(path: Path, number: int) -> Path:
    return path if number == 1 else path.with_name(f"{path.name}-{number}")


def _write(path: Path, content: bytes) -> Path:
    write_bytes(path, content)
    return path
