"""Import: foreign logs in, runs of a recording out. Files and folders are read here, and nothing is written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError, UsageError, quoted
from r2s2r_cli.stages.import_.authors_folder import import_authors_folder
from r2s2r_cli.stages.import_.checks import ROD_TOLERANCE
from r2s2r_cli.stages.import_.files import MAX_CSV_BYTES, file_size, list_folder, read_source, shown
from r2s2r_cli.stages.import_.run import ImportedRun, renamed, run_name
from r2s2r_cli.stages.import_.sidecar import read_sidecar, sidecar_path
from r2s2r_cli.stages.import_.trajectory import import_trajectory
from r2s2r_cli.stages.import_.tum import DEPTH, RGB, import_tum
from schemas.results_import import ImportFormat
from schemas.robot import Robot
from schemas.sidecar import Sidecar

__all__ = ["FORMATS", "ImportedRun", "check_source", "find_format", "import_source", "merge_runs"]

FORMATS: tuple[ImportFormat, ...] = ("trajectory_csv", "authors_folder", "tum_rgbd")


def import_source(
    path: Path,
    *,
    robot: Robot,
    format: ImportFormat | Literal["auto"] = "auto",
    sidecar: Sidecar | None = None,
    depth_scale: float | None = None,
    rod_length_tolerance: float = ROD_TOLERANCE,
    known_rods: Mapping[str, Sequence[float]] | None = None,
) -> ImportedRun:
    """One run from one file or folder, named by its stem: of what cannot stand in the name of a run `-` is made.

    robot: the project's. sidecar: what the source says; None reads `<stem>.toml` beside it. depth_scale: [m] a depth
    count, where a folder does not give it. rod_length_tolerance: relative. known_rods: rod lengths [m] of other
    robots by name, to say which one fits. Raises InputError for whatever cannot be read exactly as it stands,
    UsageError for an unknown format.
    """
    chosen = check_source(path, format)
    data = read_source(path, "the CSV", limit=MAX_CSV_BYTES) if chosen == "trajectory_csv" else b""
    name, said = run_name(path)
    files = (path,) if sidecar is not None else (path, sidecar_path(path))
    stated = read_sidecar(path) if sidecar is None else sidecar
    known = tuple(known_rods or ())
    if chosen == "trajectory_csv":
        groups, report = import_trajectory(
            data,
            name,
            robot=robot,
            sidecar=stated,
            where=str(path),
            rod_length_tolerance=rod_length_tolerance,
            known_rods=known_rods,
        )
    elif chosen == "authors_folder":
        groups, report = import_authors_folder(
            path, name, robot=robot, sidecar=stated, depth_scale=depth_scale, known_robots=known
        )
    else:
        groups, report = import_tum(
            path, name, robot=robot, sidecar=stated, depth_scale=depth_scale, known_robots=known
        )
    report = report.model_copy(update={"warnings": (*said, *report.warnings)})
    return ImportedRun(name=name, groups=groups, report=report, files=files)


def check_source(path: Path, format: ImportFormat | Literal["auto"] = "auto") -> ImportFormat:
    """The format of a source that can be read: there, a file or folder as the format asks, of a sane size.

    Nothing is read yet, so it can be asked before the source is hashed. Raises InputError, UsageError.
    """
    chosen = find_format(path) if format == "auto" else format
    if chosen not in FORMATS:
        raise UsageError(
            f"unknown format {shown(str(format))}",
            where="--format",
            expected=", ".join(("auto", *FORMATS)),
            received=str(format),
            hint=f"r2s2r import {quoted(path)} --format auto",
        )
    if chosen == "trajectory_csv":
        file_size(path, "the CSV", limit=MAX_CSV_BYTES)
    else:
        list_folder(path, "the recording")
    return chosen


def find_format(path: Path) -> ImportFormat:
    """The format of a source by what lies there. Raises InputError where it is none of the known ones."""
    if not path.is_dir():
        if path.suffix.lower() == ".csv":
            return "trajectory_csv"
        file_size(path, "the log", limit=MAX_CSV_BYTES)
        raise InputError(
            f"a file ending in {shown(path.suffix)} is no log that can be imported",
            where=str(path),
            expected="a .csv file, or a folder with data/ or with rgb.txt and depth.txt",
            received=path.name,
            hint=f"r2s2r import {quoted(path)} --format trajectory_csv   # if it is comma-separated text",
        )
    names = set(list_folder(path, "the recording"))
    if {RGB, DEPTH} <= names:
        return "tum_rgbd"
    if "data" in names:
        return "authors_folder"
    raise InputError(
        "the folder is no recording that can be imported",
        where=str(path),
        expected="data/ (with color/, depth/), or rgb.txt and depth.txt",
        received=shown(", ".join(sorted(names)) or "an empty folder"),
        hint=f"ls {quoted(path)}",
    )


def merge_runs(runs: Sequence[ImportedRun]) -> ArtifactData:
    """The recording of several runs. Raises UsageError where two have one name."""
    groups: dict[str, Group] = {}
    for run in runs:
        root = f"runs/{run.name}"
        if root in groups:
            raise UsageError(
                f"two sources give a run of the name {run.name}",
                where=str(run.files[0]),
                expected="another stem for each file",
                received=f"{run.name} twice",
                hint=renamed(run),
            )
        groups |= {f"{root}/{stream}" if stream else root: group for stream, group in run.groups.items()}
    return ArtifactData(kind="recording", groups=groups)
