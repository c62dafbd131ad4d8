"""What is rough is averaged, over points close together; and what all hypotheses leave is counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Hypothesis
from r2s2r_cli.stages.diagnose.which.left import expected, left
from r2s2r_cli.stages.diagnose.which.rivals import no_gap
from r2s2r_cli.stages.diagnose.which.rough import DRAWS, JITTER, around, root_of
from r2s2r_cli.stages.diagnose.which.score import Score, scores
from tests.support.linear_arena import LinearArena, candidate


class RoughArena(LinearArena):
    """Every simulated number is off by luck that depends on the values in their last digits, `luck` sd in all."""

    luck = 0.0

    def raw(
        self, values: np.ndarray, z: np.ndarray, only: object = None, away: np.ndarray | None = None
    ) -> list[np.ndarray]:  # fmt: skip
        """As of the linear arena, and luck."""
        found = super().raw(values, z, only, away)
        for row, own in enumerate(values):
            rng = np.random.default_rng(np.abs(np.round(own * 1e6)).astype(int))
            for one in found:
                one[row] += self.luck * rng.standard_normal(one[row].shape)
        return found


def test_points_lie_about_the_middle_within_bounds() -> None:
    """The first is the middle; the others have the sd that was asked for, by the covariance's root."""
    precision = np.array([[4.0, 1.0], [1.0, 9.0]])
    root = root_of(precision)
    assert root @ root.T == pytest.approx(np.linalg.inv(precision))
    far = np.full(2, 1e9)
    points = around(np.array([1.0, 2.0]), root, -far, far)
    drawn = np.linalg.solve(root, (points[1:] - points[0]).T) / JITTER
    assert points.shape == (DRAWS, 2) and points[0] == pytest.approx([1.0, 2.0])
    assert 0.2 < np.abs(drawn).mean() < 2.0
    inside = around(np.array([1.0, 2.0]), root, np.array([1.0, 0.0]), far)
    assert inside[:, 0].min() == 1.0


def test_luck_is_worth_less_than_in_one_simulation() -> None:
    """The same hypothesis twice, at numbers a millionth apart: what one gains over the other is luck. It is less than
    half of what single simulations make of it, over twelve arenas."""

    def apart(seed: int) -> tuple[float, float]:
        arena = RoughArena(0.0, seed=seed)
        arena.luck = 0.5
        solver = Fits(arena)  # type: ignore[arg-type]
        fits = solver.begun([(Hypothesis(), np.full(2, by), np.zeros(0)) for by in (0.0, 1e-5)])
        one, other = scores(arena, fits, arena.gait)  # type: ignore[arg-type]
        single = [arena.squares(fit.residual[None])[0, :, 0].sum() for fit in fits]
        return float(one.elpd.sum() - other.elpd.sum()), 0.5 * float(single[1] - single[0])

    averaged, single = np.array([apart(seed) for seed in range(12)]).T
    assert averaged.std() < 0.5 * single.std()
    assert np.isfinite(averaged).all()


def test_roughness_makes_numbers_less_sure() -> None:
    """Luck of as many sd as noise has makes what is fitted as unsure as twice the noise would: sd by the root of two;
    without luck the sd is that of the noise."""

    def wider(luck: float, seed: int) -> np.ndarray:
        arena = RoughArena(0.8, seed=seed)
        solver = Fits(arena)  # type: ignore[arg-type]
        (fit,) = solver.begun([(Hypothesis((candidate("right", 0),)), np.zeros(2), np.zeros(1))])
        solver.run([fit])
        smooth = np.sqrt(np.diag(np.linalg.inv(solver.normal(fit)[0])))
        arena.luck = luck
        (one,) = scores(arena, [fit], arena.gait)  # type: ignore[arg-type]
        return np.asarray(one.sd / smooth)

    assert wider(0.0, 0) == pytest.approx(np.ones(3), abs=1e-6)
    squares = np.mean([wider(1.0, seed) ** 2 for seed in range(20)])
    assert squares == pytest.approx(2.0, rel=0.2)


def test_what_is_left_is_what_no_hypothesis_explains() -> None:
    """Linear: the right effect leaves nothing beyond the healthy rate, the refit model leaves what the effect gains,
    and something along neither effect is left by both."""

    def of(arena: LinearArena, healthy: Healthy) -> tuple[float, float, float]:
        solver = Fits(arena)  # type: ignore[arg-type]
        both = (Hypothesis(), Hypothesis((candidate("right", 0),)))
        fits = solver.begun([(one, np.zeros(2), np.zeros(len(one.parts))) for one in both])
        solver.run(fits)
        refit, own = scores(arena, fits, arena.gait)  # type: ignore[arg-type]
        found = left(expected(arena), arena.sizes, refit, [own], healthy)  # type: ignore[arg-type]
        assert found.refit >= found.best
        return found.refit, found.best, found.sd

    well = LinearArena(0.0, seed=5)
    solver = Fits(well)  # type: ignore[arg-type]
    (begun,) = solver.begun([(Hypothesis(), np.zeros(2), np.zeros(0))])
    solver.run([begun])
    healthy = Healthy(well, begun)  # type: ignore[arg-type]
    refit, best, sd = of(LinearArena(0.8), healthy)
    assert refit > 2 * sd > 2 * abs(best)
    strange = LinearArena(0.0, seed=1)
    strange.y = strange.y + np.random.default_rng(9).standard_normal(len(strange.y))
    refit, best, sd = of(strange, healthy)
    assert best > 2 * sd and refit - best < 0.3 * best
    loud, today = LinearArena(0.0, seed=5), LinearArena(0.0, seed=3)
    for k, one in enumerate((loud, today)):  # 40 % more noise than is stated, then and now
        one.y = one.y + np.random.default_rng(k).standard_normal(len(one.y))
    other = Fits(loud)  # type: ignore[arg-type]
    (begun,) = other.begun([(Hypothesis(), np.zeros(2), np.zeros(0))])
    other.run([begun])
    refit, best, sd = of(today, Healthy(loud, begun))  # type: ignore[arg-type]
    assert sd > 0 and abs(best) < 2 * sd


def test_equivalence_counts_the_share_that_the_floor_was_taken_from() -> None:
    """One interval of twelve in which the robot fell decides neither the floor nor the test."""
    rng = np.random.default_rng(1)
    key = rng.normal(0, 0.005 / np.sqrt(3), (40, 6, 3))
    key[0] = 0.1
    one = Score(np.zeros(40), np.ones(40), key, np.zeros(1), np.zeros((1, 1)))
    assert not no_gap(one, 0.005).equivalent
    assert no_gap(one, 0.005, kept=0.9).equivalent
    assert not no_gap(replace(one, ends=2.0 * key), 0.005, kept=0.9).equivalent
