"""A project whose logs are of the engine's own robot with an effect planted: for tests of commands."""

from __future__ import annotations

import csv
import tomllib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.sample import NOISE_M, planted
from r2s2r_cli.store.project import Project
from schemas.robot import Robot
from tests.commands.conftest import invoke

TICK_S = 0.05
SIDECAR = """\
robot = "threebar"
nature = "simulated"
source = "the engine itself"
noise_sd_m = {noise}
"""


def planted_project(root: Path, effect: Mapping[str, float], *, gaits: int, targets: int, seed: int = 0) -> None:
    """A new project with logs g1, g2 ... of its own robot with these numbers of effects, estimated."""
    where = ("--project", str(root))
    assert invoke("init", str(root)).exit_code == 0
    robot = Robot.model_validate(tomllib.loads((root / "robot.toml").read_text()))
    cache = Project.find(root).cache
    made = planted(robot, effect, gaits=gaits, targets=targets, seed=seed, tick_s=TICK_S, cache_dir=cache)
    (root / "log").mkdir(exist_ok=True)
    files = []
    for run in made.runs:
        files.append(str(root / "log" / f"{run.name}.csv"))
        write_log(run, Path(files[-1]))
    for words in (("import", *files, "--no-draw"), ("estimate", "--no-draw")):
        result = invoke(*words, *where)
        assert result.exit_code == 0, result.stderr


def write_log(run: Run, path: Path) -> None:
    """The run as a trajectory CSV with its sidecar."""
    caps, sensors = run.caps, run.lengths
    assert sensors is not None
    names = ["t_s", *(f"cap{c}_{axis}_m" for c in range(caps.observed.shape[1]) for axis in "xyz")]
    names += [f"{name}{k}" for name in ("target", "control") for k in range(caps.target.shape[1])]
    names += [f"length{k}_m" for k in sensors.cable.tolist()]
    table = np.column_stack([
        caps.t, caps.observed.reshape(len(caps.t), -1), caps.target, caps.control, sensors.length
    ])  # fmt: skip
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([f"{value:.6f}" for value in row] for row in table)
    path.with_suffix(".toml").write_text(SIDECAR.format(noise=NOISE_M))
