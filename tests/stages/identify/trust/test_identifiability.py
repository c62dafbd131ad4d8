"""What data can identify: spectrum, words, refusals."""

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.trust.identifiability import Trust, identifiability
from tests.stages.identify.solve.problems import formula
from tests.stages.identify.trust.planted import linear_frees, planted

LINE = np.linspace(0.5, 1.0, 20)


def _product():
    """y = a b t + c: only the product of a and b is seen."""
    frees = (
        Free("motor_speed", "1", 1.0, 0.1, 10.0, prior_sd=0.3), Free("friction", "1", 0.5, 0.05, 5.0, prior_sd=0.3),
        Free("ground_height", "m", 0.0, -1.0, 1.0, Coordinate.LINEAR, prior_sd=0.2),
    )  # fmt: skip
    z0 = np.array([free.to_z(free.start) for free in frees])
    lower, upper = np.array([free.bounds_z() for free in frees]).T
    problem = formula(
        lambda z: (np.exp(z[0] + z[1]) * LINE**2 + z[2] - 0.5) / 0.01,
        lambda z: np.column_stack([np.exp(z[0] + z[1]) * LINE**2] * 2 + [np.ones(20)]) / 0.01,
        3, lower=lower, upper=upper, prior_mean=z0, prior_sd=np.array([0.3, 0.3, 0.2]),
        names=tuple(free.name for free in frees),
    )  # fmt: skip
    return problem, z0, frees


def test_product_is_one_weak_direction_in_words():
    """The ratio of two factors is weak and said in words; neither is identified, what stands apart is."""
    found = identifiability(*_product())
    assert list(found.weak) == [True, False, False]
    assert found.eigenvalue[0] == pytest.approx(0.0, abs=1e-6)
    both = {"raising motor_speed by 35 % and lowering friction", "raising friction by 35 % and lowering motor_speed"}
    end = " by 35 % together changes no residual: the data cannot tell them apart"
    assert found.words[0] in {start + end for start in both}
    assert found.trust == (Trust.WEAK, Trust.WEAK, Trust.IDENTIFIED)
    assert np.isinf(found.sd_flat_z[:2]).all()
    # What is known of a is what is known of b: one width.
    np.testing.assert_allclose(found.sd_z[:2], 0.3, rtol=0.02)


def test_expected_sd_is_the_block_inverse():
    """Expected sds from data are the roots of the inverse of everything, priors of the parameters off."""
    case = planted(0)
    found = identifiability(case.problem, np.zeros(len(case.matrix[0])), case.frees)
    prior = np.concatenate([np.zeros(4), case.problem.prior_sd[4:] ** -2.0])
    whole = np.linalg.inv(case.matrix.T @ case.matrix + np.diag(prior))
    np.testing.assert_allclose(found.sd_flat_z, np.sqrt(np.diag(whole)[:4]), rtol=1e-6)
    assert found.condition == pytest.approx(found.eigenvalue[-1] / found.eigenvalue[0])
    half = identifiability(case.problem, np.zeros(len(case.matrix[0])), case.frees, inflation=4.0, refuse=False)
    assert np.all(half.sd_flat_z > found.sd_flat_z)


@pytest.mark.parametrize(
    ("effect", "trust"),
    [(20.0, Trust.IDENTIFIED), (1.0, Trust.WEAK), (0.1, Trust.NOT_IDENTIFIABLE), (0.0, Trust.NOT_IDENTIFIABLE)],
)
def test_trust_follows_what_data_add_to_the_prior(effect, trust):
    """A width that changes residuals by 20, 1, 0.1 and 0 sd in all; at 0 the reason says that nothing depends on it."""
    column = np.full((4, 1), 0.5 * effect / 0.3)
    problem = formula(lambda z: column @ z, lambda z: column, 1, prior_sd=0.3, names=("restitution",))
    found = identifiability(problem, np.zeros(1), linear_frees(("restitution",)), refuse=False)
    assert found.trust == (trust,)
    assert found.column_norm[0] == pytest.approx(effect)
    assert ("no compared frame" in found.reason[0]) == (effect == 0.0)
    assert found.no_effect == (("restitution",) if effect == 0.0 else ())


def test_no_effect_is_refused_with_a_hint():
    """A parameter that changes nothing is named, with the option that drops it."""
    problem = formula(lambda z: z[:1] * 3.0, lambda z: np.array([[3.0, 0.0]]), 2, names=("motor_speed", "restitution"))
    frees = (linear_frees(("motor_speed",))[0], Free("restitution", "1", 0.2, 0.0, 1.0, Coordinate.LINEAR))
    with pytest.raises(InputError, match="restitution has no effect") as caught:
        identifiability(problem, np.array([0.0, 0.2]), frees)
    assert caught.value.hint == "r2s2r identify --fix restitution=0.2"
    # Of a default set, which nobody asked for, it is told and not refused; the other is known as if it were alone.
    found = identifiability(problem, np.array([0.0, 0.2]), frees, excused=[free.name for free in frees])
    assert found.no_effect == ("restitution",)
    assert [trust.name for trust in found.trust] == ["IDENTIFIED", "NOT_IDENTIFIABLE"]
    assert found.sd_z[0] == pytest.approx(1 / 3)


def test_vanishing_derivative_is_told_from_no_effect():
    """A parameter that acts only further away is refused for where it starts, and known by its finite change."""

    def dead_zone(z):
        return 10.0 * np.maximum(z - 0.1, 0.0)

    problem = formula(dead_zone, lambda z: np.diag(10.0 * (z > 0.1)), 1, prior_sd=1.0, names=("friction",))
    with pytest.raises(InputError, match="friction has no derivative where it starts"):
        identifiability(problem, np.zeros(1), linear_frees(("friction",)))
    found = identifiability(problem, np.zeros(1), linear_frees(("friction",)), refuse=False)
    assert found.stalled == ("friction",)
    # From -0.3 to 0.3 the residual changes by 2: a quotient of 10 / 3.
    assert found.sd_z[0] == pytest.approx(0.3)


def test_derivative_of_a_kink_is_not_believed():
    """A steep derivative that no finite change confirms does not make a parameter known."""
    problem = formula(
        lambda z: 0.1 * np.sin(1e4 * z), lambda z: 1e3 * np.cos(1e4 * z)[:, None], 1, prior_sd=1.0, names=("a",)
    )
    found = identifiability(problem, np.zeros(1), linear_frees(("a",)))
    assert found.trust == (Trust.NOT_IDENTIFIABLE,)
    assert found.rough == ("a",)
    assert identifiability(problem, np.zeros(1), linear_frees(("a",)), secant=None).trust == (Trust.IDENTIFIED,)


def test_one_side_that_cannot_be_simulated_is_left_out():
    """A finite change towards values where the simulation is not finite is taken on the other side."""
    problem = formula(
        lambda z: np.where(z > 0.05, np.nan, 7.0 * z), lambda z: np.array([[7.0]]), 1, prior_sd=1.0, names=("a",)
    )
    found = identifiability(problem, np.zeros(1), linear_frees(("a",)))
    assert found.secant_norm[0] == pytest.approx(7.0)


@pytest.mark.parametrize("start", [0.1, 10.0, 11.0])
def test_starts_on_a_bound_are_refused(start):
    """On a bound or beyond, with a start inside as hint."""
    free = Free("friction", "1", start, 0.1, 10.0)
    problem = formula(lambda z: z, lambda z: np.eye(1), 1, names=("friction",))
    problem.lower, problem.upper = (np.array([np.log(one)]) for one in (0.1, 10.0))
    with pytest.raises(InputError, match="friction starts on a bound") as caught:
        identifiability(problem, np.log([start]), (free,))
    assert caught.value.hint == "r2s2r identify --free friction=1,0.1..10"
