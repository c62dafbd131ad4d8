"""What remains of a gap when nothing is wrong: of healthy runs, of repeats, or of what noise and engines explain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run
from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.measures.floor import floor_of
from r2s2r_cli.stages.measures.gap import kept_rmse
from r2s2r_cli.stages.measures.steps import steps_of

NUMERICS_M = 3e-3
"""[m] What two good engines differ by at the end of a step of this robot, beside noise (tier B without an effect)."""
KEPT = 0.9
"""Share of healthy stretches that the floor is taken from: a tip-over that went the other way is not the floor."""
USUAL = 0.75
"""The same for the equivalence test. Healthy runs have about eleven intervals, and one or two falls among them, or
among those that are diagnosed, decide the root mean square of nine tenths: with nothing wrong one was 0.3 to 1.2 of the
other in seven calibration sets, of three quarters 0.7 to 1.1 (ADR 17)."""


def healthy_floor(healthy: Healthy) -> FloorGiven:
    """Of the healthy runs, as their own refit leaves them."""
    sensor = float(np.sqrt(np.mean([np.sum(one.noise[-1] ** 2, axis=-1).mean() for one in healthy.arena.whole])))
    squared = healthy.score.squared
    # A healthy robot that fell the other way says nothing of how large an error is where nothing is wrong; the share
    # that the equivalence test looks at is of all intervals, as in what it is compared with.
    stands = np.isfinite(healthy.score.key).all(axis=(1, 2))
    rmse, usual = kept_rmse(squared[stands] if stands.any() else squared, KEPT), kept_rmse(squared, USUAL)
    words = f"the healthy runs, refitted, the best {100 * KEPT:.0f} % of their intervals"
    return FloorGiven(rmse, min(sensor, rmse), words, True, KEPT, (usual, USUAL))


def floor_for(evidence: Evidence) -> tuple[FloorGiven, list[str]]:
    """The floor that was given; else of repeats among the runs; else of noise and a foreign engine's numerics, which is
    said."""
    if evidence.floor is not None:
        return evidence.floor, []
    sensor = _sensor(evidence.only(evidence.fit) or evidence.runs)
    steps = [
        step for run in evidence.runs
        for one in evidence.fit if one.run == run.name for step in steps_of(run.caps, one.intervals)
    ]  # fmt: skip
    found = floor_of(steps)
    if found is not None and found.contrasts >= 2:
        given = FloorGiven(found.floor_m, found.sensor_m, "repeats within the diagnosed runs", False)
    else:
        given = FloorGiven(
            float(np.hypot(NUMERICS_M, sensor)),
            sensor,
            "the noise of the caps and 3 mm for the numerics of engines",
            False,
        )
    said = [] if evidence.healthy else [f"no floor was given: taken from {given.words}, {1e3 * given.rmse:.1f} mm"]
    return given, said


def _sensor(runs: Sequence[Run]) -> float:
    """What noise alone makes of the cap RMSE at a key frame that was started from a frame [m]."""
    return float(np.sqrt(np.mean([np.sum(run.caps.noise**2, axis=-1).mean() for run in runs])))
