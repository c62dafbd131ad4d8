"""Scores without a simulator: a linear arena, of which everything can be worked out by hand."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Hypothesis
from r2s2r_cli.stages.diagnose.which.mixture import ENOUGH as OF_A_FIT, FACTORS, density, minus_log, weight
from r2s2r_cli.stages.diagnose.which.rivals import chance, no_gap
from r2s2r_cli.stages.diagnose.which.score import Score, gains, scores
from r2s2r_cli.stages.diagnose.which.screen import Response, screen
from r2s2r_cli.stages.diagnose.which.search import WIDE, picked_of
from r2s2r_cli.stages.diagnose.which.starting import LOST_M
from tests.support.linear_arena import EACH, LinearArena, candidate


@dataclass
class Tried:
    """Fits of the refit model, the true effect and a wrong one, with their scores."""

    arena: LinearArena
    fits: list
    scores: list[Score]


def tried(truth: float, seed: int = 0) -> Tried:
    """All three, fitted from the same start."""
    arena = LinearArena(truth, seed=seed)
    solver = Fits(arena)  # type: ignore[arg-type]
    made = []
    for hypothesis in (Hypothesis(), Hypothesis((candidate("right", 0),)), Hypothesis((candidate("wrong", 1),))):
        made += solver.begun([(hypothesis, np.zeros(2), np.zeros(len(hypothesis.parts)))])
    solver.run(made)
    return Tried(arena, made, scores(arena, made, arena.gait))  # type: ignore[arg-type]


def test_a_fit_finds_the_planted_size_and_the_nuisances() -> None:
    """A linear problem is solved in a step or two, within the errors of its noise."""
    found = tried(0.8)
    assert found.fits[1].x == pytest.approx([0.8], abs=0.15)
    assert found.fits[1].z == pytest.approx([0.3, -0.2], abs=0.15)
    assert found.fits[1].moved and not found.fits[1].on_bound


def test_the_right_effect_predicts_better_and_the_wrong_one_does_not() -> None:
    """Held-out gain: large for what was planted, below what chance gives for the other."""
    found = tried(0.8)
    right, wrong = gains(found.scores[0], found.scores[1:])
    assert right > 20
    assert wrong < 3


def test_leaving_a_gait_out_is_fitting_without_it() -> None:
    """The one step to the numbers without a gait lands where a weighted fit of the others is."""
    found = tried(0.8)
    fit, arena = found.fits[1], found.arena
    w = weight(arena.squares(fit.residual[None])[0], arena.logdets, arena.sizes)
    rows = np.repeat(w @ np.array(FACTORS) ** -2.0, EACH)
    keep = np.repeat(arena.gait != 0, EACH)
    J = np.concatenate([arena.A, arena.B[:, :1]], axis=1)[keep]
    prior = np.diag([1.0, 1.0, 0.25])
    direct = np.linalg.solve(J.T @ (rows[keep, None] * J) + prior, J.T @ (rows[keep] * arena.y[keep]))
    assert found.scores[1].without[0] == pytest.approx(direct, abs=2e-3)


def test_a_number_of_which_the_data_say_nothing_stays() -> None:
    """Where the simulator is flat its prior alone would lead it back to off in one step, over whatever lies between;
    one of which the data say something goes where they say."""
    found = tried(0.8)
    fit = found.fits[1]
    flat = replace(fit, x=np.array([1.1]), jacobian=fit.jacobian * np.array([1.0, 1.0, 0.0]))
    told = replace(fit, x=np.array([1.1]))
    one, other = scores(found.arena, [flat, told], found.arena.gait)  # type: ignore[arg-type]
    assert (one.without[:, -1] == 1.1).all()
    assert (np.abs(other.without[:, -1] - 1.1) > 0.01).all()


def test_a_gait_without_a_key_frame_is_scored_by_its_pieces() -> None:
    """The robot tips over as both of its intervals begin: what they say counts as before, and no key frame is made."""
    found = tried(0.8)
    found.arena.whole = found.arena.many[:4]
    after = scores(found.arena, found.fits, found.arena.gait)  # type: ignore[arg-type]
    assert [one.elpd.tolist() for one in after] == [one.elpd.tolist() for one in found.scores]
    assert all(one.key.shape[0] == 4 and np.isfinite(one.key).all() for one in after)


def test_an_effect_far_smaller_than_what_is_tried_is_seen_in_the_screening() -> None:
    """A third of the least try: at that try it would make everything worse, at a share of it it gains."""
    found = tried(0.16)
    right, *_ = screen(found.arena, found.fits[0], [candidate("right", 0), candidate("wrong", 1)])  # type: ignore[arg-type]
    assert right.candidate.effect == "right"
    assert right.gain > 1.0
    assert 0.0 < right.size[0] < 0.5


def test_what_parity_speaks_for_is_fitted_at_its_element() -> None:
    """However many the screening has before it; and the best element of every effect before second ones."""

    def response(name: str, index: int | None, gain: float) -> Response:
        one = candidate(name, 0)
        element = None if index is None else Element("sensor", index)
        return Response(replace(one, element=element), gain, one.scale, one.scale, np.zeros(2), 9.0, 0.0, np.zeros(1))

    many = [response(f"e{k}", i, 90.0 - k - 0.1 * i) for k in range(WIDE - 1) for i in range(2)]
    sensors = [response("sensor_bias", k, 5.0 - k) for k in range(4)]
    picked = picked_of([*many, *sensors], {"sensor_bias": {3: 20.0, 1: 0.3}, "e7": {0: 0.5}})
    assert len(picked) == WIDE
    assert [one.candidate.number for one in picked if one.candidate.effect == "sensor_bias"][:1] == [3]
    assert {one.candidate.effect for one in picked} == {"sensor_bias", *(f"e{k}" for k in range(WIDE - 1))}


def test_without_an_effect_chance_is_not_beaten_often() -> None:
    """Of 40 sets without an effect, the better of two candidates beats the 95 % bound of chance in few."""
    beaten = 0
    for seed in range(40):
        found = tried(0.0, seed=seed)
        base = found.fits[0]
        responses = screen(found.arena, base, [candidate("right", 0), candidate("wrong", 1)])  # type: ignore[arg-type]
        bound = chance(found.arena, responses, found.arena.gait)  # type: ignore[arg-type]
        beaten += gains(found.scores[0], found.scores[1:]).max() > bound
    assert beaten <= 6


def test_one_bad_stretch_does_not_decide() -> None:
    """What a stretch costs grows by the logarithm of its excess: one that fell is worth little more than a bad one."""
    logdet = 2.0 * 60 * np.log(np.array([FACTORS]))
    size = np.array([60.0])

    def cost(share: float) -> float:
        squares = share * 60.0 / np.array(FACTORS) ** 2
        return float(minus_log(squares[None], logdet, size)[0])

    def whole(share: float) -> float:
        return float(density(share * 60.0 / np.array(FACTORS)[None] ** 2, logdet)[0])

    assert cost(0.8) == pytest.approx(whole(0.8))
    assert whole(1e4) - whole(1.0) > 200
    assert cost(1e4) - cost(1.0) < OF_A_FIT * np.log1p(400 / OF_A_FIT)
    assert cost(1e4) - cost(0.9e4) < 1.0


@pytest.mark.parametrize("share", [0.5, 1.5, 4.0, 40.0, 4000.0])
def test_weights_are_the_slope_of_the_cost(share: float) -> None:
    """Half the weighted sum of squares has the derivative of the cost by every sum of squares."""
    logdet = 2.0 * 60 * np.log(np.array([FACTORS]))
    size = np.array([60.0])
    squares = share * 60.0 / np.array(FACTORS)[None] ** 2
    for c in range(len(FACTORS)):
        by = np.zeros_like(squares)
        by[0, c] = 1e-4 * max(1.0, squares[0, c])
        slope = (minus_log(squares + by, logdet, size) - minus_log(squares - by, logdet, size))[0] / (2 * by[0, c])
        assert weight(squares, logdet, size)[0, c] / 2 == pytest.approx(slope, abs=1e-6)


def test_a_piece_that_one_hypothesis_explains_is_one_vote() -> None:
    """However far the others are off at one piece, they lose ENOUGH there; every other piece still counts."""
    one = np.zeros((6, 1, 3))
    refit, lucky, right = (
        Score(np.array(elpd), np.ones(4), one, np.zeros(1), np.zeros((1, 1)))
        for elpd in ([-500.0, 0.0, 0.0, 0.0], [0.0, -3.0, -3.0, -3.0], [-500.0, 9.0, 9.0, 9.0])
    )
    found = gains(refit, [lucky, right])
    assert found[1] > 15 > ENOUGH > found[0] > 0


def test_equivalence_needs_data() -> None:
    """Errors at the floor of many stretches show that there is no gap; two stretches do not."""

    def of(count: int) -> Score:
        key = np.random.default_rng(1).normal(0, 0.005 / np.sqrt(3), (count, 6, 3))
        return Score(np.zeros(count), np.ones(count), key, np.zeros(1), np.zeros((1, 1)))

    assert no_gap(of(40), 0.005).equivalent
    assert not no_gap(of(40), 0.003).equivalent
    two = Score(np.zeros(2), np.ones(2), np.stack([np.full((6, 3), 0.001), np.full((6, 3), 0.006)]), np.zeros(1),
                np.zeros((1, 1)))  # fmt: skip
    assert not no_gap(two, 0.005).equivalent


def of_ends(*off: float) -> Score:
    """All caps of an interval off by so much in x [m], one number an interval."""
    ends = np.zeros((len(off), 6, 3))
    ends[..., 0] = np.array(off)[:, None]
    return Score(np.zeros(len(off)), np.ones(len(off)), ends, np.zeros(1), np.zeros((1, 1)))


def test_a_lost_interval_counts_at_the_bound() -> None:
    """Off by 30 cm is worse than by 14 cm, no worse than by 25 cm, and as bad as what cannot be simulated; nothing that
    comes nearer is said to be worse, whatever the direction."""
    rmse = {off: float(np.sqrt(of_ends(0.01, off).squared.mean())) for off in (0.14, 0.25, 0.30, 3.0, np.nan)}
    assert rmse[0.14] < rmse[0.25] == rmse[0.30] == rmse[3.0] == rmse[np.nan]
    assert rmse[0.30] == pytest.approx(np.sqrt((1e-4 + LOST_M**2) / 2))
    way = np.random.default_rng(0).normal(size=(6, 3))
    one = of_ends(0.0)
    said = [float(replace(one, ends=size * way[None]).squared[0]) for size in np.linspace(0.0, 1.0, 40)]
    assert (np.diff(said) >= 0).all() and said[-1] == pytest.approx(LOST_M**2)


def test_from_where_a_fall_led_to_nothing_is_learned() -> None:
    """One lost cap makes an interval NaN for the black box and the pictures; the others stay as they are."""
    ends = np.zeros((3, 6, 3))
    ends[1, 4, 2], ends[2] = -0.26, 0.24
    key = replace(of_ends(0.0, 0.0, 0.0), ends=ends).key
    assert np.isnan(key[1]).all() and (key[0] == 0.0).all() and (key[2] == 0.24).all()


def test_two_intervals_of_three_that_are_lost_are_a_gap() -> None:
    """The others at the floor prove nothing: with them left out there would be none. One of ten may be set aside, as in
    the floor."""
    near = [0.005, -0.005] * 10
    assert no_gap(of_ends(*near), 0.005).equivalent
    lost = no_gap(of_ends(*near, *[0.4] * 40), 0.005)
    assert not lost.equivalent and lost.rmse > 0.2
    assert no_gap(of_ends(*near, 0.4, np.nan), 0.005, kept=0.9).equivalent


def test_a_response_that_nuisances_explain_is_absorbed() -> None:
    """A candidate along a nuisance is absorbed whole, an unrelated one hardly."""
    arena = LinearArena(0.0)
    arena.B[:, 0] = arena.A[:, 0]
    solver = Fits(arena)  # type: ignore[arg-type]
    (base,) = solver.begun([(Hypothesis(), np.zeros(2), np.zeros(0))])
    found: dict[str, Response] = {
        one.candidate.effect: one
        for one in screen(arena, base, [candidate("along", 0), candidate("across", 1)])  # type: ignore[arg-type]
    }
    assert found["along"].absorbed == pytest.approx(1.0, abs=1e-9)
    assert found["across"].absorbed < 0.05
