"""A blind set as what a diagnosis is made from: its logs go through import and estimate, as a user's would, and its
pictures, where it has some, through the tracker."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

from pydantic import ValidationError

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.blind.recorded import SUFFIX, read_recording
from r2s2r_cli.blind.split import FOLLOW, judged
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.diagnose.evidence import Evidence, Run, whole
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.estimate.camera_input import Pictures
from r2s2r_cli.stages.floor.runs import sensed_run
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.load import run_data
from r2s2r_cli.stages.import_ import import_source, merge_runs
from schemas.estimate import EstimateSettings
from schemas.robot import Robot

ROD_TOLERANCE = 0.1
"""A camera whose scale is wrong is something to be diagnosed, not refused."""


def read_set(folder: Path, *, shuffled: int | None = None) -> Evidence:
    """The evidence of one set. The simulator is that of its robot.toml: nothing was identified before.

    The last third of the gaits is judged; the others are fitted, and with them what was run later on. shuffled: seed
    with which the commands of the target intervals are exchanged (`Evidence.shuffled`), a negative control; the healthy
    runs stay. Raises InputError where the folder is no set.
    """
    robot = _robot(folder / "robot.toml")
    runs = _runs(folder / "gaits", robot)
    healthy = _runs(folder / "commissioning", robot) if (folder / "commissioning").is_dir() else ()
    if len(runs) < 2:
        raise InputError(
            "a set needs two gaits, one of them to judge on", where=str(folder / "gaits"), expected="at least 2 logs",
            received=str(len(runs)), hint="r2s2r blind make bank --key labels.key",
        )  # fmt: skip
    # Judged are the same gaits whatever was run later, and runs stand in the order in which they were made: an effect
    # may begin with one of them.
    later = _runs(folder / FOLLOW, robot) if (folder / FOLLOW).is_dir() else ()
    last = judged(len(runs))
    evidence = Evidence(
        robot=robot, model=nominal(robot), runs=(*runs, *later), fit=whole((*runs[:-last], *later)),
        judge=whole(runs[-last:]), healthy=healthy,
    )  # fmt: skip
    return evidence if shuffled is None else evidence.shuffled(shuffled)


def _robot(path: Path) -> Robot:
    try:
        return Robot.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, ValidationError) as error:
        raise InputError(
            "the robot of a set cannot be read", where=str(path), expected="a robot.toml",
            received=str(error).splitlines()[0], hint="r2s2r blind make bank --key labels.key",
        ) from error  # fmt: skip


def _runs(folder: Path, robot: Robot) -> tuple[Run, ...]:
    logs = [path for path in folder.iterdir() if path.suffix in (".csv", SUFFIX)]
    found = []
    for path in sorted(logs, key=lambda path: (len(path.stem), path.stem)):
        recording, pictures = _recording(path, robot)
        settings, name = EstimateSettings(rod_length_tolerance=ROD_TOLERANCE), path.stem
        states, _ = estimate(recording, robot, settings, pictures=pictures)
        # Rows between frames are control ticks: commands as they were sent, not as frames found them.
        caps = replace(run_data(recording, states, name, still=True), sampled=False)
        found.append(Run(caps, sensed_run(name, recording, name, robot), gait=name))
    return tuple(found)


def _recording(path: Path, robot: Robot) -> tuple[ArtifactData, Pictures | None]:
    """One run, named by its stem, and its pictures; None where the log brings the caps itself."""
    if path.suffix == SUFFIX:
        recorded = read_recording(path)
        return recorded.data, recorded.pictures
    imported = import_source(path, robot=robot, format="trajectory_csv", rod_length_tolerance=ROD_TOLERANCE)
    return merge_runs([imported]), None
