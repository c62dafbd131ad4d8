"""From gains to probabilities: planted numbers come back, and what was left out is covered as often as promised."""

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.blind.score import calibration_published
from r2s2r_cli.blind.score.calibrate import LEAST_LIKELY, calibrated, learn
from r2s2r_cli.blind.score.cases import FEW, HELD, Case, case
from r2s2r_cli.blind.score.facts import truth_of
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from schemas.results_diagnose import LAWLESS
from tests.guards.listing import ROOT
from tests.support import blind_bank

EFFECTS = ("backlash", "payload", "motor_lag", "soft_ground")
TRUE = Calibration(temperature=20.0, parity=14.0, none=50.0, stranger=-2.5, wider=0.8, few=FEW, lapse=0.02)


def scores(by: Calibration, one: Case) -> dict[str, float]:
    """What a diagnosis makes of the evidence of a set; the parity stage has said what it says by chance too."""
    return {
        name: by.score(name, float(a), left_out=float(a), parity=float(b) + by.by_chance)
        for name, a, b in zip(one.names, one.gain, one.parity, strict=True)
    }


def probabilities(by: Calibration, one: Case) -> dict[str, float]:
    """Of all names, as a diagnosis has them."""
    return by.with_unknown(by.probabilities(scores(by, one)), FEW * np.expm1(one.strange), one.left_sd)


def planted(count: int, seed: int = 0, by: Calibration = TRUE) -> list[Case]:
    """Sets whose truth is drawn from the probabilities of known numbers."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        said = np.array([*np.maximum(rng.normal(30.0, 40.0, len(EFFECTS)), 0.0), 0.0])
        parity = np.array([*rng.exponential(1.5, len(EFFECTS)), 0.0])
        one = Case((*EFFECTS, "none"), said, parity, "", rng.uniform(0.0, 4.0))
        p = probabilities(by, one)
        found.append(replace(one, truth=str(rng.choice(list(p), p=list(p.values())))))
    return found


def known(made: dict[str, object]) -> Calibration:
    """The numbers of a file, as a diagnosis reads them."""
    return Calibration(**{name: made[name] for name in Calibration.__dataclass_fields__ if name in made})  # type: ignore[arg-type]


def test_planted_numbers_come_back() -> None:
    """Of 3000 sets: temperature, what parity is worth, what nothing is worth, and the odds of strangers."""
    found = calibrated(planted(3000), words="test")
    assert found["temperature"] == pytest.approx(TRUE.temperature, rel=0.1)
    assert found["parity"] == pytest.approx(TRUE.parity, rel=0.15)
    assert found["none"] == pytest.approx(TRUE.none, abs=5.0)
    assert found["stranger"] == pytest.approx(TRUE.stranger, abs=0.25)
    assert found["wider"] == pytest.approx(TRUE.wider, abs=0.12)


def test_no_shard_teaches_twice() -> None:
    """As what teaches all and as an older one: its strangers would count twice."""
    shard = ROOT / "docs/blind/calibration-10.json.gz"
    with pytest.raises(InputError, match="a shard teaches twice") as raised:
        calibration_published([shard], older=[shard])
    assert raised.value.where == "--older" and "2af6f7a4f9cd" in raised.value.received


def test_older_sets_teach_only_what_may_be_left() -> None:
    """Gains of older versions mean something else: they move neither temperature nor `none`, whatever they say."""
    sets = planted(200)
    older = [replace(one, said=1e3 * one.said, truth="payload", left_sd=2.0) for one in sets[:40]]
    older += [replace(sets[0], truth="unknown", left_sd=5.0)] * 3
    plain, more = calibrated(sets, words="test"), calibrated(sets, words="test", older=older)
    assert "unfit" not in plain
    assert (more["unfit"], more["unfit_share"]) == (3.5, 0.8)
    assert {name: value for name, value in more.items() if not name.startswith("unfit")} == plain


def test_the_set_of_names_lists_none_that_nothing_speaks_for() -> None:
    """Where a third of the truths gain nothing, holding nine of ten would take every name of the catalogue."""
    names = tuple(f"effect_{k}" for k in range(60))
    rng = np.random.default_rng(0)
    sets = []
    for k in range(60):
        said = np.zeros(61)
        said[k] = 0.0 if k % 3 == 0 else rng.uniform(100.0, 200.0)
        sets.append(Case((*names, "none"), said, np.zeros(61), names[k]))
    found = calibrated(sets, words="test")
    assert found["conformal"] == LEAST_LIKELY
    nothing = known(found).probabilities({name: known(found).score(name) for name in (*names, "none")})
    assert len(known(found).within(nothing)) < 5


def test_strangers_do_not_move_what_names_are_worth() -> None:
    """Sets whose cause no catalogue has, each with an effect that gains much: they raise the share of `unknown` and
    nothing else, and names are committed to from nearly as little on."""
    sets = planted(300)
    stranger = Case((*EFFECTS, "none"), np.array([500.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(5), "unknown")
    before, after = (calibrated(one, words="test") for one in (sets, [*sets, *[stranger] * 30]))
    for key in ("temperature", "parity", "none"):
        assert after[key] == pytest.approx(before[key], rel=1e-6), key
    assert after["commit"] < before["commit"] + 0.1 < 1.0

    def plain(of: dict[str, float]) -> float:
        """Share of `unknown` where nothing speaks for it."""
        return known(of).with_unknown({"none": 1.0}, 0.0, 0.0)["unknown"]

    assert plain(after) > plain(before) + 0.05


def test_a_set_of_90_per_cent_holds_the_truth_so_often() -> None:
    """On sets that no number was learned from, with thresholds from 900 others. A name is right as often as promised
    where the catalogue has the cause, and the likeliest of all names as often as its probability says."""
    found = known(calibrated(planted(900), words="test"))
    fresh = planted(1500, seed=1)
    held, said, sure, right = 0, [], [], []
    for one in fresh:
        p = probabilities(found, one)
        held += p[one.truth] >= found.conformal
        first = max(p, key=lambda name: p[name])
        sure.append(p[first])
        right.append(first == one.truth)
        if first in EFFECTS and found.commits(p[first]) and one.truth != "unknown":
            said.append(first == one.truth)
    assert 0.85 < held / len(fresh) < 0.95
    assert len(said) > 100 and sum(said) >= 0.84 * len(said)
    assert np.mean(sure) == pytest.approx(np.mean(right), abs=0.04)


def test_a_verdict_becomes_a_case() -> None:
    """What all data say, losses as nothing, parity beyond chance, `unknown` as what a wider floor gains. Pairs and what
    was never fitted are left out."""
    label = {"kind": "single", "effects": [{"id": "payload", "channel": "mass", "element": None, "onset": None}],
             "d": 9.0, "d_each": [9.0], "outside": None}  # fmt: skip
    document = {
        "ranking": [{"effect": "payload", "elpd_gain": -7.5, "marginal_nats": 11.0, "parity_nats": 6.5},
                    {"effect": "motor_lag", "elpd_gain": 3.0, "marginal_nats": -4.0, "parity_nats": 99.0},
                    {"effect": "dropout", "elpd_gain": 0.0, "marginal_nats": None, "parity_nats": 99.0},
                    {"effect": "none", "elpd_gain": 0.0},
                    {"effect": "unknown", "elpd_gain": 30.0}, {"effect": "backlash", "elpd_gain": -1e9}],
        "chance_nats": 2.0, "gap_nats": 31.0, "left_nats": 6.0, "left_sd_nats": 3.0, "floor_m": 0.010,
    }  # fmt: skip
    one = case(truth_of(label), document)
    assert one is not None and one.names == ("payload", "motor_lag", "dropout", "none") and one.truth == "payload"
    assert one.said.tolist() == [11.0, 0.0, 0.0, 0.0] and one.parity.tolist() == [2.5, 95.0, 95.0, 0.0]
    assert one.strange == pytest.approx(np.log(4.0)) and one.left_sd == 2.0
    assert one.left_out is not None and one.left_out.tolist() == [0.0, 3.0, 0.0, 0.0]
    assert one.gain.tolist() == pytest.approx([(1.0 - HELD) * 11.0, HELD * 3.0, 0.0, 0.0])
    assert one.heard.tolist() == pytest.approx([2.5, HELD * 3.0, 95.0, 0.0])  # no replay tells of a dropout
    assert replace(one, replayed=False).heard[1] == 95.0
    assert one.may_name("payload") and one.may_name("motor_lag") and not one.may_name("none")
    assert not replace(one, parity=np.zeros(4)).may_name("payload")
    pair = next(each for each in blind_bank.bank() if each["kind"] == "pair" and each["d"] > 3)
    assert case(truth_of(pair), document) is None
    for row in document["ranking"]:
        row.pop("marginal_nats", None)
    older = case(truth_of(label), {**document, "left_nats": None})
    assert older is not None and older.said.tolist() == [0.0, 3.0, 0.0, 0.0] and older.left_sd == 0.0


@pytest.mark.parametrize(
    ("marginal", "left_out", "parity", "unexplained"),
    [
        (75.0, 31.0, 9.0, 0.0),
        (-3.0, 1.0, 3.0, 20.0),
        (900.0, -80.0, 99.0, -4.0),
        (900.0, -80.0, 4.0, 0.0),
        (9.0, 0.0, 4.1, 0.0),
    ],
)
def test_what_is_learned_from_is_what_counts(
    marginal: float, left_out: float, parity: float, unexplained: float
) -> None:
    """For the learning as for a diagnosis: the same verdict has the same probabilities."""
    label = next(each for each in blind_bank.bank() if each["kind"] == "single" and each["d"] > 8)
    rows = {
        "payload": (marginal, parity),
        "sensor_gain": (marginal, parity),
        "dropout": (0.0, parity),
        "none": (0.0, 0.0),
    }
    document = {
        "ranking": [*({"effect": name, "elpd_gain": left_out, "marginal_nats": m, "parity_nats": p}
                      for name, (m, p) in rows.items()), {"effect": "unknown", "elpd_gain": unexplained}],
        "left_nats": 4.0, "left_sd_nats": 2.0,
    }  # fmt: skip
    one = case(truth_of(label), document)
    assert one is not None
    sets = planted(40)
    own, _ = learn(sets)
    by = known(calibrated(sets, words="test"))
    told = by.probabilities({name: by.score(name, m, left_out=left_out, parity=p) for name, (m, p) in rows.items()})
    assert own.probabilities(one) == pytest.approx(by.with_unknown(told, unexplained, 2.0), rel=1e-9)
    lawless = case(truth_of(label), {**document, "stranger_sd2": 60.0})
    assert lawless is not None
    told = by.with_unknown(told, unexplained, 2.0, lawless=True)
    assert own.probabilities(lawless) == pytest.approx(told, rel=1e-9) and told["unknown"] >= LAWLESS
    for name in ("payload", "sensor_gain", "dropout"):
        assert one.logs == (parity > 0.0)
        assert one.may_name(name) == by.witnessed(name, left_out, parity, rows[name][0], logs=one.logs)


def test_too_few_sets_teach_nothing() -> None:
    """Eleven are refused."""
    with pytest.raises(InputError, match="too few"):
        calibrated(planted(11), words="test")


def test_what_only_strangers_leave_is_learned() -> None:
    """Half-way between the most that any other set leaves and the least beyond, with the odds of as many strangers;
    nothing where a set that the catalogue explains leaves the most."""
    sets = [replace(one, left_sd=min(0.1 * k, 3.0)) for k, one in enumerate(planted(60))]
    sets = [replace(one, truth="none") if one.truth == "unknown" else one for one in sets]
    sets[7] = replace(sets[7], truth="unknown", left_sd=5.0)
    sets[8] = replace(sets[8], truth="unknown", left_sd=4.0)
    sets[9] = replace(sets[9], truth="payload", left_sd=3.0)
    found = calibrated(sets, words="test")
    assert found["unfit"] == pytest.approx(3.5)
    assert found["unfit_share"] == pytest.approx(0.75)
    assert known(found).refuses(3.6)
    own, _ = learn(sets)
    for left, refused in ((3.4, False), (3.6, True)):
        p = own.probabilities(replace(sets[0], left_sd=left, strange=0.0))
        assert sum(p.values()) == pytest.approx(1.0)
        assert (p["unknown"] == pytest.approx(0.75)) is refused
        assert p == pytest.approx(probabilities(known(found), replace(sets[0], left_sd=left, strange=0.0)))
    sets[9] = replace(sets[9], left_sd=6.0)
    assert "unfit" not in calibrated(sets, words="test")
