"""Gauss-Newton over the whole run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.chain import Eliminated, eliminate, substitute
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.equations import equations
from r2s2r_cli.stages.estimate.motion.evidence import Evidence

SETTLED_M = 1e-4
"""[m] A step that moves no cap by more is the last one: a fraction of what is uncertain even where all is seen."""
SETTLED_COST = 0.1
"""Nor does one matter that lowers the cost (minus log posterior) of the whole run by less: no state is moved by half of
its standard deviation, and of thousands of states hardly any by a tenth. Robust costs settle in many small steps."""
HALVINGS = 8


@dataclass(frozen=True)
class Solved:
    """x: states (frame, dim). done: of the equations at x. rounds: steps taken. settled: the last one was small."""

    x: np.ndarray
    done: Eliminated
    cost: float
    rounds: int
    settled: bool


def solve(x: np.ndarray, evidence: Evidence, body: Body, settings: MotionSettings, *, rounds: int) -> Solved:
    """Minimise the cost from x. Raises NumericalError where sightings or covariances are not finite, or where nothing
    observes a state."""
    cost, normal = equations(x, evidence, body, settings)
    if not np.isfinite(cost):
        raise NumericalError(
            "the smoother's states are not finite", where="sightings", expected="finite sightings and covariances",
            received=f"cost {cost}", hint="r2s2r inspect 10-record.h5   # shows what was recorded",
        )  # fmt: skip
    done = eliminate(normal)
    settled, taken = False, 0
    while taken < rounds and not settled:
        step = substitute(done)
        taken += 1
        share = 1.0
        for _ in range(HALVINGS):
            tried, equation = equations(x + share * step, evidence, body, settings)
            if tried <= cost + 1e-9 * abs(cost):
                break
            share *= 0.5
        else:
            break
        small = np.max(np.abs(step[:, : 3 * body.caps])) < SETTLED_M or cost - tried < SETTLED_COST
        x, cost = x + share * step, tried
        done = eliminate(equation)
        settled = bool(share == 1.0 and small)
    return Solved(x, done, cost, taken, settled)
