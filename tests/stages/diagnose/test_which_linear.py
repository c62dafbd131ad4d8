"""Gains of the linearised problem: on a problem that is linear they are what leaving out really gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.diagnose.which.fit import Fits, Hypothesis
from r2s2r_cli.stages.diagnose.which.line import Line
from r2s2r_cli.stages.diagnose.which.linear import AMPLITUDE_SD, by_element, linear_gains
from r2s2r_cli.stages.diagnose.which.mixture import FACTORS, minus_log, weight
from r2s2r_cli.stages.diagnose.which.score import ENOUGH
from r2s2r_cli.stages.diagnose.which.screen import screen
from tests.support.linear_arena import EACH, LinearArena, candidate


def begun(arena: LinearArena) -> tuple[object, list]:
    """The refit nominal model where it stands, and responses of the right effect and of a wrong one."""
    solver = Fits(arena)  # type: ignore[arg-type]
    residual = arena.residuals(np.zeros((1, 4)), np.zeros((1, 2)))[0]
    base = solver.begin(Hypothesis(), np.zeros(2), np.zeros(0), residual)
    solver.run([base])
    found = screen(arena, base, [candidate("right", 0), candidate("wrong", 1)])  # type: ignore[arg-type]
    return base, sorted(found, key=lambda one: one.candidate.effect)


def test_a_planted_effect_gains_and_another_one_does_not() -> None:
    """Without any fit of it."""
    arena = LinearArena(0.8)
    base, responses = begun(arena)
    right, wrong = linear_gains(arena, base, responses)  # type: ignore[arg-type]
    assert right > 20
    assert wrong < 3


def test_the_gain_is_that_of_a_fit_without_the_gait() -> None:
    """Every gait is predicted by the weighted least squares of the others, with and without the effect's column."""
    arena = LinearArena(0.4)
    base, responses = begun(arena)
    one = responses[0]
    w = weight(arena.squares(base.residual[None])[0], arena.logdets, arena.sizes)  # type: ignore[attr-defined]
    by_row = np.repeat(w @ np.array(FACTORS) ** -2.0, EACH)
    M = len(by_row)

    def cost(J: np.ndarray, precision: np.ndarray, mean: np.ndarray) -> np.ndarray:
        found = np.zeros(len(arena.gait))
        for gait in np.unique(arena.gait):
            keep = np.repeat(arena.gait != gait, EACH)
            H = (J[keep] * by_row[keep, None]).T @ J[keep] + precision
            step = np.linalg.solve(H, J[keep].T @ (by_row[keep] * base.residual[:M][keep]) + precision @ mean)  # type: ignore[attr-defined]
            after = base.residual[:M] - J @ step  # type: ignore[attr-defined]
            kinds = np.concatenate([after / factor for factor in FACTORS])
            costs = minus_log(arena.squares(kinds[None]), arena.logdets, arena.sizes)[0]
            found[arena.gait == gait] = costs[arena.gait == gait]
        return found

    z = base.z  # type: ignore[attr-defined]
    plain = cost(arena.A, np.eye(2), z)
    change = Line(arena, base).changes([(one.candidate, one.size)])[0]  # type: ignore[arg-type]
    J = np.concatenate([arena.A, change[:M, None]], axis=1)
    beside = cost(J, np.diag([1.0, 1.0, AMPLITUDE_SD**-2.0]), np.append(z, 0.0))
    expected = np.clip(plain - beside, -ENOUGH, ENOUGH).sum()
    assert linear_gains(arena, base, [one])[0] == pytest.approx(expected, rel=1e-3)  # type: ignore[arg-type]


@pytest.mark.parametrize(("before", "now", "gains"), [(0.8, 0.8, False), (0.0, 0.8, True), (0.8, -0.4, True)])
def test_what_the_healthy_runs_show_as_well_is_no_change(before: float, now: float, gains: bool) -> None:
    """An amplitude that was there before makes up for the simulator; another one than before is what has gone wrong."""
    arena, healthy = LinearArena(now), LinearArena(before, seed=7)
    base, responses = begun(arena)
    known = Healthy(healthy, begun(healthy)[0])  # type: ignore[arg-type]
    right = next(one for one in responses if one.candidate.effect == "right")
    alone = linear_gains(arena, base, [right])[0]  # type: ignore[arg-type]
    found = linear_gains(arena, base, [right], known)[0]  # type: ignore[arg-type]
    assert alone > 10
    assert (found > 10) == gains and found <= alone
    assert gains or found < 1


def test_an_amplitude_is_that_of_least_squares() -> None:
    """With the nuisances, all weights 1: of the closed form, with its sd."""
    arena = LinearArena(0.6, noise=0.5)
    base, responses = begun(arena)
    one = responses[0]
    line = Line(arena, base)  # type: ignore[arg-type]
    change = line.changes([(one.candidate, np.array([1.0]))])[0]
    M = len(arena.y)
    assert change[:M] == pytest.approx(arena.B[:, 0])
    value, sd = line.amplitude(one.candidate, change, 100.0)
    kinds = weight(arena.squares(base.residual[None])[0], arena.logdets, arena.sizes)  # type: ignore[attr-defined]
    w = np.repeat(kinds @ np.array(FACTORS) ** -2.0, EACH)
    X = np.column_stack([arena.A, arena.B[:, 0]])
    H = (X * w[:, None]).T @ X + np.diag([1.0, 1.0, 1e-4])
    P = np.linalg.inv(H)
    assert value == pytest.approx((P @ (X.T @ (w * arena.y)))[2], rel=1e-3)
    assert sd == pytest.approx(np.sqrt(P[2, 2]), rel=1e-3)
    assert abs(value - 0.6) < 4 * sd


def test_gains_are_kept_by_element_and_the_unseen_have_none() -> None:
    """The best of what shares an element; what these gaits would not show is not there."""
    arena = LinearArena(0.8)
    _, (right, wrong) = begun(arena)
    two = replace(right, candidate=replace(right.candidate, element=Element("cap", 2)))
    unseen = replace(wrong, seen=0.0)
    found = by_element([two, two, right, unseen], np.array([3.0, 5.0, 1.0, 9.0]))
    assert found == {"right": {2: 5.0, None: 1.0}}
