"""`r2s2r export`: an artifact as CSV tables, npz, a trajectory log or a policy file; a robot as a MuJoCo model."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
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
    files = _robot_files(path, set_ or []) if to == Format.MJCF else _artifact_files(path, to, run)
    written = [_write(out / name, content, force) for name, content in files]
    console.document(ExportResult(source=str(path), format=to, files=tuple(map(str, written))))
    for name in written:
        console.data(str(name))


def _robot_files(path: Path, overrides: list[str]) -> Iterable[tuple[str, bytes]]:
    from r2s2r_cli.commands.export_mjcf import mjcf_file

    return [mjcf_file(path, overrides)]


def _artifact_files(path: Path, to: Format, run: str | None) -> Iterable[tuple[str, bytes]]:
    from r2s2r_cli.store.read import read_artifact

    header, data = read_artifact(path, blobs=to == Format.CSV)
    return _files(path, to, run, header, data)


def _files(path: Path, to: Format, run: str | None, header: Header, data: ArtifactData) -> Iterable[tuple[str, bytes]]:
    from r2s2r_cli.stages.export.logs import policy_file, trajectory_files
    from r2s2r_cli.stages.export.tables import csv_files, npz_file
    from schemas.versions import KINDS

    if to == Format.CSV:
        return csv_files(data, KINDS[header.kind], path.stem)
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
        return [policy_file(data, name) for name in runs]
    return [file for name in runs for file in trajectory_files(data, name)]


def _write(path: Path, content: bytes, force: bool) -> Path:
    if path.exists() and not force:
        raise UsageError("the file is in the way", where=str(path), expected="a new file", received="one that exists",
                         hint="give another --out, or --force to overwrite it")  # fmt: skip
    write_bytes(path, content)
    return path
