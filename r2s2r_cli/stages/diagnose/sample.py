"""An evidence of the engine's own making, with an effect planted: for benchmarks and tests of the algorithm.

No claim of accuracy rests on it: the simulator that is diagnosed is the one that made the data.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run
from r2s2r_cli.stages.diagnose.imagined import commands, speed_of, target_ends
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.floor.runs import SensedRun
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.windows import Window
from r2s2r_cli.stages.model import rest_state
from r2s2r_cli.stages.segments import Intervals, Segments
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

FRAME_S, STEP_S = 0.1, 2e-3
NOISE_M, LENGTH_NOISE_M = 3e-3, 1e-3


def planted(
    robot: Robot, effect: Mapping[str, float], *, gaits: int = 5, targets: int = 5, judged: int = 1, seed: int = 0,
    tick_s: float | None = None, cache_dir: Path | None = None, threads: int = 1,
) -> Evidence:  # fmt: skip
    """Random binary gaits of the robot with these numbers of effects (`motor_lag.tau_s`: 0.2); the last are judged.
    tick_s [s]: of frames and commands, both on one grid, as in a log of rows; None: frames every 0.1 s, commands when
    they change."""
    model = Model(nominal(robot))
    values = model.values0.copy()
    for name, value in effect.items():
        values[model.place[name]] = value
    replayer = Replayer(model, step=STEP_S, cache_dir=cache_dir, threads=threads)
    rng = np.random.default_rng(seed)
    runs = tuple(_run(replayer, values, f"g{k + 1}", targets, rng, tick_s) for k in range(gaits))
    whole = tuple(Selection(run.name, tuple(range(1, targets + 1))) for run in runs)
    return Evidence(
        robot, nominal(robot), runs, whole[:-judged], whole[-judged:],
        FloorGiven(2 * NOISE_M, 1.8 * NOISE_M, "the noise that was planted"),
    )  # fmt: skip


def _run(
    replayer: Replayer, values: np.ndarray, name: str, targets: int, rng: np.random.Generator, tick_s: float | None
) -> Run:
    """One gait: commands of an ideal controller, what camera and sensors see of them."""
    robot = replayer.model.robot
    shapes = rng.integers(0, 2, (targets, len(robot.actuated))).astype(float)
    speed = speed_of(replayer.model)
    control, t_command = commands(tuple(map(tuple, shapes.tolist())), robot.pid.range_m, speed)
    begins = _begins(shapes, robot.pid.range_m, speed)
    t = np.arange(0.0, t_command[-1], tick_s or FRAME_S)
    if tick_s is not None:
        control, t_command = control[np.searchsorted(t_command, t + 1e-9, side="right") - 1], t
    first = np.searchsorted(t, begins - 1e-9)
    last = np.append(first[1:], len(t)) - 1
    intervals = Intervals(first, last, t[first], t[last], shapes, np.ones(targets, dtype=bool))
    segments = Segments(np.arange(targets) + 1, first, last, t[first], t[last], None, np.ones(targets, dtype=bool))
    row = np.clip(np.searchsorted(begins, t_command, side="right") - 1, 0, targets - 1)
    still = np.zeros((len(t), robot.n_caps, 3))
    noise = np.full((robot.n_caps, 3), NOISE_M)
    caps = RunData(
        name, t, still, noise, still, still + NOISE_M, still, still + 0.02, np.zeros(still.shape[:2], np.uint8),
        t_command, control, shapes[row], intervals, segments,
    )  # fmt: skip
    window = Window(
        run=caps, intervals=(1,), first=0, frames=np.arange(1, len(t)), key=np.zeros(len(t) - 1, bool),
        place=np.zeros(len(t) - 1, dtype=int), state=_at_rest(replayer),
    )  # fmt: skip
    cables = tuple(range(len(robot.cables)))
    seen = replayer.seen([Stretch(name, name, 1, 0, window, still[1:], still[1:], None, None, cables)], values[None])[0]
    begin = np.array(robot.rest_caps_m)
    true = np.concatenate([begin[None], seen.caps[0]])
    ends = np.array([cable.caps for cable in robot.cables])
    length = np.concatenate([np.linalg.norm(begin[ends[:, 1]] - begin[ends[:, 0]], axis=-1)[None], seen.length[0]])
    observed = true + NOISE_M * rng.standard_normal(true.shape)
    heard = length + LENGTH_NOISE_M * rng.standard_normal(length.shape)
    made = RunData(**{**vars(caps), "observed": observed, "p_WE": observed})
    return Run(made, SensedRun(name, t, heard, np.array(cables), intervals), gait=name)


def _at_rest(replayer: Replayer) -> State:
    """The rest pose, effects without a past."""
    import torch

    structure = replayer.structure
    past = {
        f"{effect.name}.{name}": torch.zeros(1, n, dtype=torch.float64)
        for effect in structure.effects for name, n in effect.state_sizes(structure).items()
    }  # fmt: skip
    return replace(rest_state(replayer.model.robot), extra=past)


def _begins(shapes: np.ndarray, wide: float, speed: float) -> np.ndarray:
    """Times at which the targets begin [s]."""
    return np.concatenate([[0.0], target_ends(tuple(map(tuple, shapes.tolist())), wide, speed)[:-1]])
