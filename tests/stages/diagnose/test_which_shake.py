"""Out of a hollow: on an arena whose cost has many, a fit that goes downhill stops where it began."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.shake import shaken
from tests.support.linear_arena import EACH, LinearArena, candidate

WAVES, DEEP, SLOPE = 5.0, 1.0, 0.3
"""Of the hollows along the first nuisance: how close, how deep, and how steep what leads to the right one is."""


class HollowArena(LinearArena):
    """What is simulated swings with the first nuisance, along directions that no nuisance has: where steps downhill
    lead to, at 0.3, there is a wall between two hollows."""

    def __init__(self) -> None:
        super().__init__(0.0, noise=1.0)
        self.A[:, 0] *= SLOPE
        self.y -= (1.0 - SLOPE) / SLOPE * self.A[:, 0] * 0.3
        self.by_nuisance[:, 0] *= SLOPE

    def raw(
        self, values: np.ndarray, z: np.ndarray, only: object = None, away: np.ndarray | None = None
    ) -> list[np.ndarray]:  # fmt: skip
        """As of the linear arena, and the swing."""
        found = super().raw(values, z, only, away)
        along = np.random.default_rng(7).standard_normal((len(found), EACH))
        swing = DEEP * (1.0 + np.cos(WAVES * (values[:, 0] - 0.3)))
        for one, way in zip(found, along, strict=True):
            one[:, :EACH] += swing[:, None] * way
        return found


def at(arena: LinearArena, hypothesis: Hypothesis, z: float) -> tuple[Fits, Fit]:
    """A fit at the first nuisance z."""
    solver = Fits(arena)  # type: ignore[arg-type]
    (fit,) = solver.begun([(hypothesis, np.array([z, -0.2]), np.zeros(len(hypothesis.parts)))])
    return solver, fit


@pytest.mark.parametrize("k", [-3, 3])
def test_a_better_hollow_is_found(k: int) -> None:
    """From the second hollow to either side, where going downhill stays: the first one, cheaper by far."""
    arena, (right, second) = HollowArena(), 0.3 + np.array([np.sign(k), k]) * np.pi / WAVES
    solver, fit = at(arena, Hypothesis(), second)
    _, downhill = at(arena, Hypothesis(), second)
    solver.run([downhill], iterations=8)
    assert downhill.z[0] == pytest.approx(second, abs=0.15)
    better = shaken(solver, fit)
    assert better.cost < downhill.cost - 15
    half = np.pi / WAVES / 2  # of the way from the bottom of a hollow to its walls
    assert min(abs(better.z[0] - right), abs(better.z[0] - (0.6 - right))) < half


def test_the_best_stays() -> None:
    """Without hollows the fit is where it should be: nothing is gained, and never is anything lost."""
    arena = LinearArena(0.4, noise=1.0)
    solver, fit = at(arena, Hypothesis((candidate("right", 0),)), 0.3)
    solver.run([fit], iterations=8)
    again = shaken(solver, fit)
    assert again.cost == pytest.approx(fit.cost, abs=0.5) and again.cost <= fit.cost
    assert again.z == pytest.approx(fit.z, abs=0.05) and again.x == pytest.approx(fit.x, abs=0.05)
    assert again.start == pytest.approx(fit.start)
