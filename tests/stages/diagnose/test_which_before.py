"""What an effect gains in the healthy runs too: a ratio of Gaussian densities, which is no news."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.before import Healthy, before, chronic
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.score import gains, scores
from tests.support.linear_arena import EACH, STRETCHES, LinearArena, candidate

QUIET = 0.5
"""Noise over what is stated: all pieces then err as noise says, and the robust cost is half the sum of squares."""


def healthy(arena: LinearArena) -> Healthy:
    """Its runs, the nuisances where half the squares and their prior are least."""
    z = np.linalg.solve(arena.A.T @ arena.A + arena.precision, arena.A.T @ arena.y + arena.precision @ arena.mean)
    (base,) = Fits(arena).begun([(Hypothesis(), z, np.zeros(0))])  # type: ignore[arg-type]
    return Healthy(arena, base)  # type: ignore[arg-type]


def fitted(x: float, place: int = 0) -> Fit:
    """What the runs of today gave the effect: all that counts is its size."""
    one, none = np.array([x]), np.zeros(0)
    return Fit(Hypothesis((candidate("effect", place),)), none, one, none, np.zeros((0, 0)), 0.0, one, none, [])


def squared(arena: LinearArena, y: np.ndarray, columns: list[int]) -> float:
    """y' (1 + A A')^-1 y: the nuisances of these columns, normal numbers of sd 1, integrated out."""
    A = arena.A[:, columns]
    return float(y @ np.linalg.solve(np.eye(len(y)) + A @ A.T, y))


@pytest.mark.parametrize("x", [-0.2, 0.1, 0.3, 0.5])
def test_the_gain_is_the_ratio_of_the_densities(x: float) -> None:
    """Linear and Gaussian: with the nuisances integrated out, the log density at this size over that at none. It is
    negative where the effect makes things worse."""
    arena = LinearArena(0.3, noise=QUIET)
    both = [0, 1]
    ratio = 0.5 * (squared(arena, arena.y, both) - squared(arena, arena.y - x * arena.B[:, 0], both))
    assert before(healthy(arena), [fitted(x)]) == pytest.approx([ratio], rel=1e-9)
    assert (ratio > 0) == (x > 0)


def test_every_fit_is_judged_alone() -> None:
    """Several fits give what each gives alone, in their order; none gives none."""
    runs = healthy(LinearArena(0.3, noise=QUIET))
    many = [fitted(0.3), fitted(0.5, place=1), fitted(-0.1)]
    assert before(runs, many) == pytest.approx([before(runs, [one])[0] for one in many], rel=1e-12)
    assert before(runs, []).shape == chronic(runs.arena, runs, []).shape == (0,)


def test_nuisances_make_up_for_what_looks_like_them() -> None:
    """An effect along a nuisance costs the healthy runs no more than the prior of the nuisance that takes it back;
    without room to do so it costs all."""
    arena = LinearArena(0.0, noise=QUIET)
    arena.B[:, 0] = arena.A[:, 0]
    runs = healthy(arena)
    (free,) = before(runs, [fitted(0.3)])
    assert free == pytest.approx(-0.5 * ((runs.base.z[0] - 0.3) ** 2 - runs.base.z[0] ** 2), abs=0.01)
    arena.lower, arena.upper = runs.base.z, runs.base.z
    (held,) = before(runs, [fitted(0.3)])
    left = arena.A @ runs.base.z - arena.y
    assert held == pytest.approx(0.5 * (left @ left - np.sum((left + 0.3 * arena.A[:, 0]) ** 2)), rel=1e-9)
    assert held < free - 8


def test_following_alone_is_no_gain() -> None:
    """Where the healthy fit stopped early nuisances that follow gain by themselves: an effect that does nothing gains
    nothing by that, and another one what it gains beyond."""
    arena = LinearArena(0.3, noise=QUIET)
    there = healthy(arena)
    early = Healthy(arena, Fits(arena).begun([(Hypothesis(), there.base.z + 0.1, np.zeros(0))])[0])  # type: ignore[arg-type]
    assert before(early, [fitted(0.0)]) == pytest.approx([0.0], abs=1e-9)
    assert before(early, [fitted(0.3)]) == pytest.approx(before(there, [fitted(0.3)]), rel=1e-6)


def test_a_nuisance_that_the_effect_sets_is_the_effects() -> None:
    """What the effect says of a nuisance holds, whatever its runs say; the other nuisances follow."""
    arena = LinearArena(0.0, noise=QUIET)
    y = arena.y - 0.25 * arena.A[:, 0]
    ratio = 0.5 * (squared(arena, arena.y, [0, 1]) - squared(arena, y, [1]))
    assert before(healthy(arena), [fitted(0.25, place=-2)]) == pytest.approx([ratio], rel=1e-9)


@pytest.mark.parametrize(("truth", "x", "nats"), [(8.0, 8.0, ENOUGH), (0.0, 8.0, -ENOUGH)])
def test_no_piece_says_more_than_enough(truth: float, x: float, nats: float) -> None:
    """One piece that the effect explains whole, or spoils, is worth ENOUGH, however far it is off."""
    arena = LinearArena(0.0, noise=QUIET)
    arena.B[EACH:, 0] = 0.0
    arena.y = arena.y + truth * arena.B[:, 0]
    arena.mean, arena.precision = np.array([0.3, -0.2]), 1e9 * np.eye(2)  # as good as known
    assert before(healthy(arena), [fitted(x)]) == pytest.approx([nats], abs=1e-3)


@pytest.mark.parametrize("now", [1, STRETCHES, 2 * STRETCHES, 15])
def test_more_pieces_now_owe_more(now: int) -> None:
    """What was there before counts by as many pieces as there are now, and never less than in the healthy runs."""
    runs = healthy(LinearArena(0.3, noise=QUIET))
    today = SimpleNamespace(many=range(now))
    own = before(runs, [fitted(0.3)])
    assert chronic(today, runs, [fitted(0.3)]) == pytest.approx(max(1.0, now / STRETCHES) * own)  # type: ignore[arg-type]


def test_nothing_is_owed_to_runs_that_are_worse_with_it_or_are_not_there() -> None:
    """A gain is never made larger by healthy runs, and without any all of it is of today."""
    arena = LinearArena(0.3, noise=QUIET)
    worse = [fitted(-0.2), fitted(1.5)]
    assert (before(healthy(arena), worse) < 0).all()
    assert chronic(arena, healthy(arena), worse) == pytest.approx([0.0, 0.0], abs=0)  # type: ignore[arg-type]
    assert chronic(arena, None, [fitted(0.3), fitted(9.0)]) == pytest.approx([0.0, 0.0], abs=0)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", range(3))
def test_what_was_there_before_is_no_news(seed: int) -> None:
    """The same effect in the healthy runs takes nearly all of today's gain; in runs that lack it, none."""
    today = LinearArena(0.5, seed=seed)
    solver = Fits(today)  # type: ignore[arg-type]
    both = (Hypothesis(), Hypothesis((candidate("effect", 0),)))
    fits = solver.begun([(one, np.zeros(2), np.zeros(len(one.parts))) for one in both])
    solver.run(fits)
    found = scores(today, fits, today.gait)  # type: ignore[arg-type]
    (gain,) = gains(found[0], found[1:])
    assert gain > 15
    same, none = (healthy(LinearArena(truth, seed=100 + seed)) for truth in (0.5, 0.0))
    (old,), (never,) = chronic(today, same, fits[1:]), chronic(today, none, fits[1:])  # type: ignore[arg-type]
    assert old > 0.65 * gain
    assert never < 0.05 * gain
