"""A log like a tracker's, of a robot that the engine simulates: for tests of commands, not for claims of accuracy."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import invoke

SIDECAR = """\
robot = "threebar"
nature = "simulated"
source = "the engine itself"
noise_sd_m = {noise}
"""
PERIOD_S = 0.05
SPEED = 0.8
"""Of the motors in the robot.toml of a new project."""


def simulated_project(root: Path, gait: str, *, told: float) -> None:
    """A new project with a log `gait` of its own robot walking that policy, estimated; its robot.toml then says that
    the motors have the speed `told`."""
    where = ("--project", str(root))
    assert invoke("init", str(root)).exit_code == 0
    (root / "gait.toml").write_text(gait)
    assert invoke("simulate", str(root / "gait.toml"), "--no-draw", *where).exit_code == 0
    write_log(read_artifact(root / "iterations/001/simulation.h5")[1], "gait", root / "log" / "gait.csv")
    assert invoke("import", str(root / "log" / "gait.csv"), "--no-draw", *where).exit_code == 0
    assert invoke("estimate", "--no-draw", *where).exit_code == 0
    robot = root / "robot.toml"
    assert f"speed = {SPEED}" in robot.read_text()
    robot.write_text(robot.read_text().replace(f"speed = {SPEED}", f"speed = {told}"))


def write_log(data: ArtifactData, run: str, path: Path, *, noise: float = 0.001, seed: int = 0) -> None:
    """End caps of a simulated run every 50 ms with white noise [m], targets and commands in force; with sidecar."""
    frames, commands = data.groups[f"runs/{run}/frames"], data.groups[f"runs/{run}/commands"]
    t = np.arange(frames["t"][0], frames["t"][-1], PERIOD_S)
    rows = np.searchsorted(frames["t"], t - 1e-9)
    p_WE = frames["p_WE"][rows] + noise * np.random.default_rng(seed).normal(size=frames["p_WE"][rows].shape)
    held = np.maximum(np.searchsorted(commands["t"], frames["t"][rows] + 1e-9, side="right") - 1, 0)
    target, control = commands["target"][held], np.nan_to_num(commands["control"][held])
    names = ["t_s", *(f"cap{c}_{axis}_m" for c in range(p_WE.shape[1]) for axis in "xyz")]
    names += [f"{name}{k}" for name in ("target", "control") for k in range(target.shape[1])]
    table = np.column_stack([frames["t"][rows], p_WE.reshape(len(t), -1), target, control])
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([f"{value:.6f}" for value in row] for row in table)
    path.with_suffix(".toml").write_text(SIDECAR.format(noise=noise))
