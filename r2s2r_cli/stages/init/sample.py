"""The sample log of `init`: a closed-form kinematic sample, no physics, in the trajectory CSV layout of `import`.

It exists so that a project without a robot can be imported, checked and drawn. It is labelled in its own text.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.init.robots import robot_facts
from r2s2r_cli.stages.init.truth import WINCH_RATE, KinematicTruth, kinematic_truth

SOURCE = "closed-form kinematic sample, no physics"

NOISE_SD = 0.002
"""Position noise, standard deviation per axis [m]: that of the real tracker is 1-4 mm."""

LENGTH_NOISE_SD = 0.002
"""Noise of the cable lengths [m]: the real sensors' line fits leave 1.2-1.9 mm rms."""

FRAME_STEP = 0.1
"""Nominal time between frames [s]: the real recording has 7-10 useful frames a second."""

STAMP_JITTER = 0.025
"""Standard deviation of that time [s]; real stamps jitter by some 50 ms, duplicates included."""

SHORTEST_STEP = 0.04
"""Two honest frames are never closer [s], so that only the planted duplicates fall under the 20 ms of `import`."""

DUPLICATE_SHARE = 0.2
"""Share of frames that are followed by a second one within `DUPLICATE_GAP` [s]; a third in the real log."""
DUPLICATE_GAP = (0.002, 0.012)

INTERVALS = 8


def sample_truth(robot: str = "threebar", *, intervals: int = INTERVALS) -> KinematicTruth:
    """The noise-free motion behind `kinematic_sample`. Raises UsageError for a robot that is no 3-bar prism."""
    return kinematic_truth(robot_facts(robot), intervals)


def kinematic_sample(
    seed: int,
    *,
    robot: str = "threebar",
    intervals: int = INTERVALS,
    noise_sd_m: float = NOISE_SD,
) -> tuple[str, str]:
    """(CSV text, sidecar TOML text) of one noisy sample; the same for the same seed.

    About 1.7 s a target interval. Stamps jitter and some are duplicated, as in the real logs; caps and lengths carry
    white noise. Raises UsageError for a robot that is no 3-bar prism, or fewer than one interval.
    """
    truth = sample_truth(robot, intervals=intervals)
    rng = np.random.default_rng(seed)
    t = _stamps(truth.t_end, rng)
    caps = truth.caps(t) + noise_sd_m * rng.standard_normal((len(t), 6, 3))
    lengths = truth.lengths(t) + LENGTH_NOISE_SD * rng.standard_normal((len(t), 9))
    header = ["t_s"]
    header += [f"cap{cap}_{axis}_m" for cap in range(6) for axis in "xyz"]
    header += [f"{name}{i}" for name in ("target", "control") for i in range(6)]
    header += [f"length{i}_m" for i in range(9)]
    columns = [t[:, None], caps.reshape(len(t), -1), truth.targets(t), truth.controls(t), lengths]
    decimals = [3] + [6] * 18 + [1] * 12 + [6] * 9
    rows = (
        ",".join(f"{x + 0.0:.{d}f}" for x, d in zip(row, decimals, strict=True))
        for row in np.round(np.hstack(columns), 6)
    )
    return "\n".join([",".join(header), *rows]) + "\n", _sidecar(robot, seed, noise_sd_m)


def _stamps(t_end: float, rng: np.random.Generator) -> np.ndarray:
    """Time stamps [s], rounded to the millisecond as they are written, from 0 to at most t_end."""
    stamps = [0.0]
    while True:
        step = max(SHORTEST_STEP, FRAME_STEP + STAMP_JITTER * float(rng.standard_normal()))
        if rng.random() < DUPLICATE_SHARE:
            stamps.append(stamps[-1] + float(rng.uniform(*DUPLICATE_GAP)))
        if stamps[-1] + step > t_end:
            return np.round(stamps, 3)
        stamps.append(stamps[-1] + step)


def _sidecar(robot: str, seed: int, noise_sd_m: float) -> str:
    facts = robot_facts(robot)
    return f"""\
# Sidecar of the sample log. The log is a {SOURCE}:
# an equilateral prism with rigid rods, winches at {WINCH_RATE * 1e3:g} mm/s, a steady roll, and white noise.
robot = "{robot}"
nature = "kinematic sample"
source = "{SOURCE}; seed {seed}"
frame = "world, z up, metres"
noise_sd_m = {noise_sd_m}

[pid]
min_length_m = {facts.min_length.value}
range_m = {facts.range.value}
tolerance = {facts.tolerance.value}
motor_speed = {facts.speed.value}      # fraction of the no-load speed; the sample's winches do not use it
winch_radius_m = {facts.winch_radius.value}
"""
