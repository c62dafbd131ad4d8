"""What is committed to: a probable first guess, and `unknown` where no effect of the catalogue is enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.effects import CATALOGUE
from r2s2r_cli.stages.diagnose.parity.finding import ABSOLUTE
from r2s2r_cli.stages.diagnose.which.calibration import Calibration, calibration
from r2s2r_cli.stages.diagnose.which.doubts import unwitnessed
from r2s2r_cli.stages.diagnose.which.found import Ranked
from r2s2r_cli.stages.diagnose.which.left import Left
from r2s2r_cli.stages.diagnose.which.pair_share import LEAST, SHARE, TwoCauses, with_pairs
from r2s2r_cli.stages.diagnose.which.rivals import NoGap, no_gap
from r2s2r_cli.stages.diagnose.which.score import Score
from r2s2r_cli.stages.diagnose.which.verdict import verdict_of
from schemas.results_diagnose import LAWLESS, LOGGED, NO_REPLAY

BY = Calibration(commit=0.6, held=0.3)
CHANCE = 5.0
GAP, NO_GAP = NoGap(0.02, 0.03, 0.01, 0.0), NoGap(0.009, 0.011, 0.01, 0.95)
"""A refit error of twice the floor, and one at the floor."""


def ranking(first: str, probability: float, gain: float) -> list[Ranked]:
    """The first guess and another one."""
    return [Ranked(first, gain, probability, marginal=gain), Ranked("backlash", 0.0, 1.0 - probability)]


def test_a_name_has_its_threshold() -> None:
    """From it on, and not below; that the cause has no name is never a verdict for being probable alone."""
    assert verdict_of(ranking("payload", 0.6, 30.0), BY, None, GAP)[:2] == ("effect", ("payload",))
    assert verdict_of(ranking("payload", 0.59, 30.0), BY, None, GAP) == ("ambiguous", (), 0.59)
    assert verdict_of(ranking("unknown", 0.99, 30.0), BY, None, GAP) == ("ambiguous", (), 0.99)


def test_a_name_needs_a_witness() -> None:
    """Left-out gaits or the parity stage; what explains only that which it was fitted to is not named, nor is a pair
    that begins with it, and where the error is at the floor there is no gap."""
    by = replace(BY, by_chance=4.0)
    alone = Ranked("payload", -25.0, 0.9, marginal=95.0, parity=3.9)
    other = Ranked("backlash", 30.0, 0.1)
    assert verdict_of([alone, other], by, None, GAP) == ("ambiguous", (), 0.9)
    assert verdict_of([alone, other], by, ("payload", "backlash"), GAP) == ("ambiguous", (), 0.9)
    assert verdict_of([alone, other], by, None, NO_GAP) == ("no_gap", (), 0.95)
    shared = [replace(alone, probability=0.45), replace(other, probability=0.4), Ranked("none", 0.0, 0.15)]
    for pair, count in ((("payload", "backlash"), 1), (None, 0)):
        assert verdict_of(shared, by, pair, GAP) == ("ambiguous", (), 0.45)
        assert len(unwitnessed(shared, by, pair)) == count
    for seen in (replace(alone, gain=0.1), replace(alone, parity=4.1)):
        assert verdict_of([seen, other], by, None, GAP) == ("effect", ("payload",), 0.9)
        assert not unwitnessed([seen, other], by, None)


def test_left_out_gaits_alone_are_no_witness() -> None:
    """What they say for an effect is one event where all data together say nothing for it, unless the logs do."""
    alone = Ranked("command_latency", 104.8, 0.85, marginal=-4.1, parity=0.1)
    other = Ranked("motor_dead_zone", 6.6, 0.1, marginal=0.3)
    by = replace(BY, by_chance=4.0)
    assert verdict_of([alone, other], by, None, GAP) == ("ambiguous", (), 0.85)
    (said,) = unwitnessed([alone, other], by, None)
    assert "+104.8 nats" in said and "-4.1 nats" in said
    for seen in (replace(alone, marginal=0.3), replace(alone, parity=4.1)):
        assert verdict_of([seen, other], by, None, GAP)[0] == "effect"


def test_what_logs_show_by_themselves_they_must_show() -> None:
    """Sensors that the replay alone finds wrong are not named, but where nobody looked at the logs."""
    by = replace(BY, by_chance=4.0)
    for name, left_out_is_enough in (("sensor_gain", False), ("sensor_bias", False), ("payload", True)):
        ranks = [Ranked(name, 55.0, 0.74, marginal=33.0, parity=1.7), Ranked("none", 0.0, 0.26)]
        verdict = "effect" if left_out_is_enough else "ambiguous"
        assert verdict_of(ranks, by, None, GAP)[0] == verdict
        assert verdict_of(ranks, by, None, GAP, logs=False)[0] == "effect"
        assert verdict_of([replace(ranks[0], parity=4.1), ranks[1]], by, None, GAP)[0] == "effect"
        said = unwitnessed(ranks, by, None)
        assert bool(said) != left_out_is_enough and all(name in text for text in said)


def test_a_pair_needs_the_logs_of_both_its_names() -> None:
    """A sensor that the replay alone finds wrong is no second cause either; the first may be named for itself."""
    by = replace(BY, by_chance=4.0)
    names = ("payload", "sensor_gain")
    first = Ranked("payload", 30.0, 0.5, marginal=30.0)
    ranks = [first, Ranked("sensor_gain", 20.0, 0.4, marginal=20.0), Ranked("none", 0.0, 0.1)]
    assert verdict_of(ranks, by, names, GAP) == ("ambiguous", (), 0.5)
    assert verdict_of([replace(first, probability=0.7), *ranks[1:]], by, names, GAP) == ("effect", ("payload",), 0.7)
    (said,) = unwitnessed(ranks, by, names)
    assert said.startswith("sensor_gain is no second cause")
    assert verdict_of(ranks, by, names, GAP, logs=False)[0] == "pair"
    heard = [first, replace(ranks[1], parity=4.1), ranks[2]]
    assert verdict_of(heard, by, names, GAP)[0] == "pair" and not unwitnessed(heard, by, names)


def test_what_no_law_has_is_unknown() -> None:
    """However well an effect explains the rest; without strangers (an ablation) nothing is."""
    names = BY.probabilities({"sensor_bias": 100.0, "none": 0.0})
    p = BY.with_unknown(names, 0.0, 0.0, lawless=True)
    assert p["unknown"] == LAWLESS and sum(p.values()) == pytest.approx(1.0)
    assert BY.with_unknown(names, -np.inf, 0.0, lawless=True)["unknown"] == 0.0
    ranks = [Ranked("unknown", 0.0, LAWLESS), Ranked("sensor_bias", 100.0, 0.1, marginal=100.0, parity=50.0)]
    assert verdict_of(ranks, BY, None, NO_GAP, lawless=True) == ("unknown", (), LAWLESS)
    assert verdict_of(ranks, BY, None, NO_GAP)[0] == "no_gap"


def test_no_gap_is_a_claim_about_size() -> None:
    """Said where the error is at the floor and no cause is likelier than not, and never where the error is larger,
    however probable it is that nothing is wrong."""
    assert verdict_of(ranking("none", 0.99, 0.0), BY, None, GAP) == ("ambiguous", (), 0.99)
    assert verdict_of(ranking("none", 0.3, 0.0), BY, None, NO_GAP) == ("no_gap", (), 0.95)
    assert verdict_of(ranking("unknown", 0.7, 0.0), BY, None, NO_GAP) == ("no_gap", (), 0.95)
    assert verdict_of(ranking("payload", 0.49, 30.0), BY, None, NO_GAP) == ("no_gap", (), 0.95)
    assert verdict_of(ranking("payload", 0.51, 30.0), BY, None, NO_GAP) == ("ambiguous", (), 0.51)
    assert verdict_of(ranking("payload", 0.7, 30.0), BY, None, NO_GAP)[0] == "effect"


def test_no_name_where_the_best_effect_leaves_too_much() -> None:
    """An effect that gains most and is far the likeliest is not named where what it leaves stands out from the healthy
    runs, as it did in strangers only, nor is a pair; without healthy runs nobody knows what may be left."""
    by = replace(BY, temperature=5.0, unfit=4.4, unfit_share=0.75)
    names = by.probabilities({"payload": 100.0, "backlash": 10.0, "none": 0.0})
    usual, beyond = by.with_unknown(names, 0.0, 4.3), by.with_unknown(names, 0.0, 4.5)
    assert usual["unknown"] == pytest.approx(1.0 / (1.0 + np.exp(2.0)))
    assert beyond["unknown"] == 0.75 and beyond["payload"] == pytest.approx(0.25 * names["payload"])
    for found in (usual, beyond):
        assert sum(found.values()) == pytest.approx(1.0)
    likely = [Ranked("unknown", 0.0, by.unfit_share), Ranked("payload", 100.0, 0.2)]
    for pair in (None, ("payload", "backlash"), ("unknown", "backlash")):
        assert verdict_of(likely, by, pair, NO_GAP, left_sd=4.5) == ("unknown", (), 0.75)
    assert verdict_of(likely, by, None, GAP, left_sd=4.3)[0] == "ambiguous"
    assert by.absolute().with_unknown(names, 0.0, 99.0) == usual


def test_a_stranger_is_as_probable_as_what_a_wider_floor_explains() -> None:
    """Log odds grow with the logarithm of what that gains, and nothing is gained by a loss; where it was not asked
    there is none. Names keep their proportions."""
    by = replace(BY, stranger=-2.0, wider=0.7, few=10.0)
    names = {"payload": 0.6, "none": 0.4}
    share = [by.with_unknown(names, nats, 0.0)["unknown"] for nats in (-5.0, 0.0, 10.0, 30.0, 310.0)]
    odds = np.log(np.array(share) / (1.0 - np.array(share)))
    assert odds == pytest.approx(-2.0 + 0.7 * np.log([1.0, 1.0, 2.0, 4.0, 32.0]))
    assert by.with_unknown(names, -np.inf, 0.0) == {**names, "unknown": 0.0}
    assert replace(by, unfit=4.4, unfit_share=0.75).with_unknown(names, -np.inf, 9.0)["unknown"] == 0.0
    assert by.with_unknown(names, np.nan, 0.0) == by.with_unknown(names, 0.0, 0.0)
    found = by.with_unknown(names, 100.0, 0.0)
    assert found["payload"] / found["none"] == pytest.approx(1.5)


def test_the_rule_of_the_package_names_a_stranger() -> None:
    """What is shipped: a certain effect, and a certain pair, that leave more than its own threshold are `unknown`. That
    is no tighter than healthy runs leave, and no wider than the strangers did that taught it."""
    by = calibration()
    assert 4.3 < by.unfit < 6.1
    certain = {"payload": 0.97, "none": 0.01, "backlash": 0.02}
    for left, verdict in ((by.unfit + 0.5, ("unknown", ())), (by.unfit - 0.5, ("effect", ("payload",)))):
        found = by.with_unknown(certain, 0.0, left)
        ranks = [Ranked(name, 100.0, p, marginal=100.0) for name, p in sorted(found.items(), key=lambda item: -item[1])]
        assert verdict_of(ranks, by, None, GAP, left_sd=left)[:2] == verdict
    found = by.with_unknown(certain, 0.0, by.unfit + 0.5)
    ranks = [Ranked(name, 100.0, p, marginal=100.0) for name, p in sorted(found.items(), key=lambda item: -item[1])]
    assert verdict_of(ranks, by, ("payload", "backlash"), GAP, left_sd=by.unfit + 0.5)[0] == "unknown"


def test_what_is_left_is_told_in_its_sd() -> None:
    """0 where nothing is known of how healthy pieces differ."""
    assert Left(50.0, 30.0, 10.0).beyond == 3.0
    assert Left(50.0, 30.0, float("nan")).beyond == 0.0


def test_the_bound_and_its_confidence_agree() -> None:
    """The 90 % bound lies below 1.25 floor just where the confidence is 90 % or more."""
    rng = np.random.default_rng(3)
    seen = set()
    for scale in np.linspace(0.7, 1.3, 25):
        squared = (0.01 * scale) ** 2 * rng.chisquare(6, size=15) / 6
        found = no_gap(_score(squared), 0.01)
        assert found.equivalent == (found.sure >= 0.9) and 0.0 <= found.sure <= 0.99
        seen.add(found.equivalent)
    assert seen == {True, False}


def test_an_effect_that_harms_is_not_there_and_no_less_than_that() -> None:
    """What it gains counts, on all data for the larger part and on left-out gaits for the rest, and a loss as nothing:
    one that breaks everything is as improbable as one that changes nothing. What `none` is worth depends on no
    evidence."""
    assert BY.score("payload", 30.0, left_out=5.0) - BY.score("payload", 10.0, left_out=5.0) == pytest.approx(14.0)
    assert BY.score("payload", 30.0, left_out=15.0) - BY.score("payload", 30.0, left_out=5.0) == pytest.approx(3.0)
    assert BY.score("payload", 30.0, left_out=-400.0) == BY.score("payload", 30.0) == pytest.approx(21.0)
    assert BY.score("payload", -500.0) == BY.score("payload", 0.0) == 0.0
    assert BY.score("none", 99.0, parity=99.0) == BY.none


def test_a_pair_is_as_probable_as_both_its_names() -> None:
    """What speaks for both is shared between them, so that neither alone need reach the threshold."""
    first = Ranked("payload", 30.0, 0.4, marginal=30.0)
    pair = [first, Ranked("motor_lag", 8.0, 0.3), Ranked("none", 0.0, 0.3)]
    assert verdict_of(pair, BY, ("payload", "motor_lag"), GAP) == ("pair", ("payload", "motor_lag"), 0.7)
    assert verdict_of(pair, BY, None, GAP)[0] == "ambiguous"
    assert verdict_of(ranking("payload", 0.9, 30.0), BY, ("motor_lag", "none"), GAP)[0] == "effect"


ALONE = {"payload": 40.0, "motor_lag": 10.0, "backlash": 2.0}
NAMES = {"payload": 0.7, "motor_lag": 0.1, "backlash": 0.1, "none": 0.1}


def shared(added: float) -> tuple[dict[str, float], tuple[str, str] | None]:
    """With one pair whose second effect adds as much."""
    pair = TwoCauses(("payload", "motor_lag"), ALONE["payload"] + added, 200.0, added)
    return with_pairs(NAMES, [pair], ALONE, CHANCE)


def test_a_second_effect_must_add_a_share_of_the_first_and_more() -> None:
    """At just that the pair is as probable as its first effect alone; half of it goes to each name."""
    needed = SHARE * ALONE["payload"] + LEAST + CHANCE
    at, believed = shared(needed)
    assert believed is None
    assert at["payload"] == pytest.approx(1.05 / 1.7) and at["motor_lag"] == pytest.approx(0.45 / 1.7)
    assert shared(needed + 0.1)[1] == ("payload", "motor_lag")


def test_pairs_share_without_adding() -> None:
    """Probabilities stay ones of a whole, the second name rises with what it adds, and a pair that adds nothing changes
    next to nothing."""
    seen = [shared(added)[0] for added in (-40.0, 20.0, 40.0, 120.0, 1e6)]
    assert all(sum(one.values()) == pytest.approx(1.0) for one in seen)
    second = [one["motor_lag"] for one in seen]
    assert second == sorted(second) and second[-1] == pytest.approx(0.5)
    assert seen[0]["payload"] == pytest.approx(NAMES["payload"], abs=0.05)
    assert with_pairs(NAMES, [], ALONE, CHANCE) == (NAMES, None)


def test_without_healthy_runs_less_counts() -> None:
    """The parity stage for less, and no gain that left-out data do not confirm; whoever reads the probabilities is
    told."""
    own = BY.absolute()
    both = [by.score("payload", 7.0, left_out=7.0, parity=5.0) for by in (own, BY)]
    assert both[0] - 7.0 == pytest.approx(ABSOLUTE * (both[1] - 7.0)) and both[1] > 7.0
    assert own.score("payload", 7.0, left_out=9.0) == pytest.approx(7.0)
    assert own.score("payload", 95.0, left_out=9.0) == 9.0 and own.score("payload", 95.0, left_out=-3.0) == 0.0
    assert BY.score("payload", 95.0, left_out=-3.0) == pytest.approx(0.7 * 95.0)
    assert "healthy runs" in own.words and own.commit == BY.commit


def test_between_look_alikes_that_both_stand_out_the_replay_decides() -> None:
    """A lag and a latency, 36 and 48 nats from the ramps of the winches, 69 and 33 from the replay."""
    learned = replace(BY, parity=4.5, by_chance=4.0)
    lag, late = learned.score("motor_lag", 69.0, parity=36.0), learned.score("command_latency", 33.0, parity=48.0)
    assert lag - late == pytest.approx(0.7 * 36.0 + 4.5 * (32.0 - 0.7 * 33.0))


def test_a_finding_that_the_replay_refutes_says_nothing() -> None:
    """A comparison of logs may err by any number of nats: what it says of an effect that a replay could see counts as
    much as the effect gains there. What no replay can tell rests on the logs alone."""
    learned = replace(BY, parity=4.5, by_chance=4.0)
    assert learned.score("motor_lag", -5.0, left_out=-35.0, parity=21.0) == 0.0
    assert learned.score("motor_lag", 2.0, left_out=2.0, parity=21.0) == pytest.approx((1.0 + 4.5) * 2.0)
    assert learned.score("motor_lag", 9.0, left_out=9.0, parity=8.0) == pytest.approx(9.0 + 4.5 * 4.0)
    assert learned.score("dropout", parity=36.0) == pytest.approx(4.5 * 32.0)
    assert {*NO_REPLAY, *LOGGED} <= {effect.name for effect in CATALOGUE}


def _score(squared: np.ndarray) -> Score:
    """Of intervals with these errors, the same for all six caps."""
    key = np.zeros((len(squared), 6, 3))
    key[..., 0] = np.sqrt(squared)[:, None]
    none = np.zeros(len(squared))
    return Score(elpd=none, misfit=none, ends=key, sd=np.zeros(0), without=np.zeros((1, 0)))
