"""Where stretches begin: fits that carry their own starts along, on an arena whose starts act along a curve."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.search import exchanged
from tests.support.linear_arena import EACH, STRETCHES, LinearArena, candidate

RIGHT = Hypothesis((candidate("right", 0),))


def begun_away(*, truth: float, bend: float, noise: float = 0.5) -> LinearArena:
    """Stretches that began up to two sd from where they are known to. A sd is three times the noise along one
    direction, and `bend` times that along another by the square."""
    rng = np.random.default_rng(3)
    along, across = 3.0 * rng.standard_normal((2, EACH))
    arena = LinearArena(truth, noise=noise, begins=[along], bends=[bend * across])
    arena.began = np.clip(rng.standard_normal((STRETCHES, 1)), -2.0, 2.0)
    return arena


def fitted(arena: LinearArena, hypothesis: Hypothesis, *, starts: bool = True) -> Fit:
    """From nothing. starts: they may move."""
    solver = Fits(arena)  # type: ignore[arg-type]
    if not starts:
        solver.settle = lambda fits: None  # type: ignore[method-assign]
    (fit,) = solver.begun([(hypothesis, np.zeros(2), np.zeros(len(hypothesis.parts)))])
    solver.run([fit], iterations=8)
    return fit


def test_starts_are_found_where_straight_lines_mislead() -> None:
    """Offsets within what noise leaves open, the planted size, and a cost far below that of a fit whose starts stay."""
    arena = begun_away(truth=0.6, bend=0.25)
    fit, stays = fitted(arena, RIGHT), fitted(arena, RIGHT, starts=False)
    assert fit.away == pytest.approx(arena.began, abs=0.15)
    assert fit.x == pytest.approx([0.6], abs=0.1)
    assert fit.cost < stays.cost - 50


def test_where_starts_act_along_straight_lines_it_does_not_matter_from_where() -> None:
    """What is white is what no start explains: the same from every start, and so are cost and numbers."""
    arena = begun_away(truth=0.6, bend=0.0)
    values, z = np.array([[0.1, 0.0, 0.3, 0.0]]), np.array([[0.1, 0.0]])
    here = arena.residuals(values, z)
    there = arena.residuals(values, z, away=np.full((1, STRETCHES, 1), 1.7))
    assert there == pytest.approx(here, abs=1e-9)
    fit, stays = fitted(arena, RIGHT), fitted(arena, RIGHT, starts=False)
    assert fit.cost == pytest.approx(stays.cost, abs=0.5)
    assert fit.x == pytest.approx(stays.x, abs=0.02)


@pytest.mark.parametrize("bend", [0.0, 0.25, 1.0])
def test_settling_never_costs_anything(bend: float) -> None:
    """Each stretch keeps the better of its two starts; what is said of a fit afterwards is what is simulated there."""
    arena = begun_away(truth=0.6, bend=bend)
    solver = Fits(arena)  # type: ignore[arg-type]
    fits = solver.begun([(Hypothesis(), np.zeros(2), np.zeros(0)), (RIGHT, np.zeros(2), np.array([0.5]))])
    for _ in range(4):
        before = [fit.cost for fit in fits]
        solver.settle(fits)
        for fit, cost in zip(fits, before, strict=True):
            assert fit.cost <= cost + 1e-9
            values = solver.values(fit.hypothesis, fit.z[None], fit.x[None])
            again = arena.residuals(values, fit.z[None], away=fit.away[None])
            assert again[0] == pytest.approx(fit.residual, abs=1e-9)
            assert solver.cost(fit.hypothesis, fit.z[None], fit.x[None], again)[0] == pytest.approx(fit.cost, abs=1e-6)


def test_who_stands_badly_is_shown_where_the_others_stand() -> None:
    """The refit nominal model far from where it belongs, an effect near: both end near, nobody worse than before, and
    each keeps its own numbers of the effect."""
    arena = begun_away(truth=0.0, bend=0.25)
    solver = Fits(arena)  # type: ignore[arg-type]
    lost, found = solver.begun(
        [(Hypothesis(), np.array([4.0, -4.0]), np.zeros(0)), (RIGHT, np.array([0.3, -0.2]), np.array([0.1]))]
    )
    solver.settle([found])
    before = lost.cost, found.cost
    lost, found = exchanged(solver, [lost, found])
    assert lost.cost < before[0] - 50 and found.cost <= before[1]
    assert lost.z == pytest.approx([0.3, -0.2]) and lost.away == pytest.approx(found.away)
    assert len(lost.x) == 0 and found.x == pytest.approx([0.1])
    assert not lost.ended


def test_a_size_that_is_far_off_is_found_beside_the_nuisances_of_another() -> None:
    """A fit at a fifth of its size with nuisances that make up for the rest, beside one whose nuisances are right: its
    own size alone leaves it where it is or worse, five times of it brings it home, and nobody is worse than before."""
    arena = begun_away(truth=0.6, bend=0.0)
    solver = Fits(arena)  # type: ignore[arg-type]
    wrong = Hypothesis((candidate("wrong", 1),))
    home = fitted(arena, RIGHT)
    beside, held = solver.begun([(wrong, home.z, np.array([0.3])), (RIGHT, np.array([4.0, -4.0]), np.array([0.12]))])
    before = beside.cost, held.cost
    (_, alone), (first, found) = (exchanged(solver, [beside, held], others=by) for by in ((), (5.0, 2.0, 0.5)))
    assert found.x == pytest.approx([0.6]) and found.z == pytest.approx(home.z)
    assert found.cost < alone.cost - 20 and found.cost == pytest.approx(home.cost, abs=5.0)
    assert alone.x == pytest.approx([0.12])
    assert first.cost <= before[0] and found.cost <= before[1]


def test_nobody_shows_the_refit_nominal_model_alone_anything() -> None:
    """Where no effect can be fitted, it stays as it is."""
    arena = begun_away(truth=0.0, bend=0.0)
    (one,) = Fits(arena).begun([(Hypothesis(), np.zeros(2), np.zeros(0))])  # type: ignore[arg-type]
    assert exchanged(Fits(arena), [one], others=(5.0,)) == [one] and exchanged(Fits(arena), []) == []  # type: ignore[arg-type]


def test_other_sizes_stay_within_the_bounds() -> None:
    """Five times a size that is half the bound is the bound, where the truth lies beyond it."""
    arena = begun_away(truth=8.0, bend=0.0)
    solver = Fits(arena)  # type: ignore[arg-type]
    part = candidate("right", 0)
    (one,) = solver.begun([(Hypothesis((part,)), np.zeros(2), 0.5 * part.upper)])
    (found,) = exchanged(solver, [one], others=(5.0,))
    assert found.x == pytest.approx(part.upper)
