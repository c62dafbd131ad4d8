"""From gains to probabilities: planted numbers come back, and what was left out is covered as often as promised."""

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.blind.score.calibrate import calibrated
from r2s2r_cli.blind.score.cases import Case, case
from r2s2r_cli.blind.score.facts import truth_of
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from tests.support import blind_bank

EFFECTS = ("backlash", "payload", "motor_lag", "soft_ground")
TRUE = Calibration(
    temperature=20.0, parity=14.0, none=9.0, equivalent=16.0, gap=0.4, unknown=110.0, unknown_share=0.7,
    left=0.5, beside=0.6, marginal=0.4, lapse=0.05, bias={"soft_ground": -27.0},
)  # fmt: skip


def scores(by: Calibration, one: Case) -> dict[str, float]:
    """What a diagnosis makes of the evidence of a set; the parity stage has said what it says by chance too."""
    beyond = {"none": one.gap, "unknown": one.left}
    found = {
        name: by.score(
            name, float(a), marginal=float(m), parity=float(b) + by.by_chance, equivalent=one.equivalent,
            beyond=beyond.get(name, 0.0),
        )
        for name, a, b, m in zip(one.names, one.score, one.parity, one.marginal, strict=True)
    }  # fmt: skip
    found["unknown"] += by.beside * max(0.0, *(found[name] for name in EFFECTS))
    return found


def planted(
    count: int, seed: int = 0, by: Calibration = TRUE, gains: tuple[float, float] = (67.0, 45.0)
) -> list[Case]:  # fmt: skip
    """Sets whose truth is drawn from the probabilities of known numbers; gains: mean and sd of those of effects."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        names = (*EFFECTS, "none", "unknown")
        score = np.array([*rng.normal(*gains, len(EFFECTS)), 90.0, rng.uniform(0.0, 300.0)])
        parity = np.array([*rng.exponential(1.5, len(EFFECTS)), 0.0, 0.0])
        marginal = np.array([*np.maximum(rng.normal(30.0, 20.0, len(EFFECTS)), 0.0), 0.0, 0.0])
        gap = rng.uniform(0.0, 120.0)
        one = Case(
            names, score, parity, marginal, bool(rng.random() < 0.3), "", gap, gap * rng.uniform(0.0, 1.0)
        )  # fmt: skip
        p = np.array(list(by.probabilities(scores(by, one)).values()))
        found.append(replace(one, truth=names[rng.choice(len(names), p=p)]))
    return found


def test_planted_numbers_come_back() -> None:
    """Of 2000 sets: temperature, what each kind of evidence is worth, offsets and the effect that wins too easily."""
    found = calibrated(planted(2000), words="test")
    assert found["temperature"] == pytest.approx(TRUE.temperature, rel=0.15)
    assert found["parity"] == pytest.approx(TRUE.parity, rel=0.15)
    assert found["unknown_share"] == pytest.approx(TRUE.unknown_share, abs=0.15)
    assert found["beside"] == pytest.approx(TRUE.beside, abs=0.15)
    assert found["marginal"] == pytest.approx(TRUE.marginal, abs=0.1)

    def middle(of: dict[str, float]) -> float:
        """Where `unknown` has a chance."""
        return of["beside"] * 150.0 + of["unknown_share"] * 150.0 + of["left"] * 30.0 - of["unknown"]

    assert middle(found) == pytest.approx(middle(vars(TRUE)), abs=20.0)
    assert found["none"] == pytest.approx(TRUE.none, abs=10.0)
    assert found["gap"] == pytest.approx(TRUE.gap, abs=0.15)
    assert found["left"] == pytest.approx(TRUE.left, abs=0.2)
    assert found["equivalent"] == pytest.approx(TRUE.equivalent, abs=8.0)
    assert found["bias"]["soft_ground"] - found["bias"]["payload"] == pytest.approx(-27.0, abs=7.0)


@pytest.mark.parametrize("share", [0.1, 1.0])
def test_what_chance_gives_counts_a_share(share: float) -> None:
    """It is learned whether nats below the usual gain say as much as those above: here a tenth, and all."""
    by = replace(
        TRUE, temperature=4.0, parity=4.0, none=-85.0, unknown=128.0, usual=8.0, usual_share=share, bias={}
    )  # fmt: skip
    found = calibrated(planted(2000, by=by, gains=(8.0, 12.0)), words="test")
    assert found["usual"] == by.usual and found["usual_share"] == pytest.approx(share, abs=0.15)
    assert found["temperature"] == pytest.approx(by.temperature, rel=0.4)


def test_strangers_do_not_move_the_threshold_of_names() -> None:
    """Sets whose cause no catalogue has, each with an effect that gains much: names are committed to as before, though
    the first guess is wrong in every one of these sets."""
    sets = planted(300)
    stranger = Case(
        (*EFFECTS, "none", "unknown"), np.array([500.0, 0.0, 0.0, 0.0, 90.0, 0.0]), np.zeros(6), np.zeros(6), False,
        "unknown",
    )  # fmt: skip
    before, after = (calibrated(one, words="test") for one in (sets, [*sets, *[stranger] * 30]))
    assert after["commit"] < before["commit"] + 0.1 < 1.0


def test_a_set_of_90_per_cent_holds_the_truth_so_often() -> None:
    """On sets that no number was learned from, with thresholds from 900 others. A name is right as often as
    promised where the catalogue has the cause."""
    made = calibrated(planted(900), words="test")
    found = Calibration(**{name: made[name] for name in Calibration.__dataclass_fields__ if name in made})
    found = replace(found, luck=np.inf, marginal_most=np.inf)  # planted evidence has no bounds
    held = 0
    said: dict[str, list[bool]] = {"effect": [], "none": [], "unknown": []}
    fresh = planted(1500, seed=1)
    for one in fresh:
        p = np.array(list(found.probabilities(scores(found, one)).values()))
        held += p[one.names.index(one.truth)] >= found.conformal
        first = one.names[int(p.argmax())]
        if found.commits(first, p.max()) and not (first in EFFECTS and one.truth == "unknown"):
            said[first if first in said else "effect"].append(first == one.truth)
    assert 0.85 < held / len(fresh) < 0.95
    assert len(said["effect"]) > 100 and len(said["unknown"]) > 20
    for kind, wanted in (("effect", 0.9), ("unknown", 0.75)):
        assert sum(said[kind]) >= (wanted - 0.06) * len(said[kind]), kind


def test_a_verdict_becomes_a_case() -> None:
    """Gains as they are, parity beyond chance, losses on all data as nothing, chance for `none`. Pairs and what was
    never fitted are left out."""
    label = {"kind": "single", "effects": [{"id": "payload", "channel": "mass", "element": None, "onset": None}],
             "d": 9.0, "d_each": [9.0], "outside": None}  # fmt: skip
    document = {
        "ranking": [{"effect": "payload", "elpd_gain": 7.5, "marginal_nats": 11.0, "parity_nats": 6.5},
                    {"effect": "none", "elpd_gain": 0.0},
                    {"effect": "unknown", "elpd_gain": 3.0}, {"effect": "backlash", "elpd_gain": -1e9}],
        "chance_nats": 2.0, "gap_nats": 31.0, "left_nats": -4.0, "refit_upper_m": 0.012, "floor_m": 0.010,
    }  # fmt: skip
    one = case(truth_of(label), document)
    assert one is not None and one.names == ("payload", "none", "unknown") and one.score.tolist() == [7.5, 2.0, 3.0]
    assert one.parity.tolist() == [2.5, 0.0, 0.0] and one.marginal.tolist() == [11.0, 0.0, 0.0]
    assert one.equivalent and one.truth == "payload" and (one.gap, one.left) == (31.0, 0.0)
    pair = next(each for each in blind_bank.bank() if each["kind"] == "pair" and each["d"] > 3)
    assert case(truth_of(pair), document) is None
    for row in document["ranking"]:
        row.pop("marginal_nats", None)
    older = case(truth_of(label), document)
    assert older is not None and older.marginal.tolist() == [7.5, 0.0, 3.0]


@pytest.mark.parametrize(("gain", "marginal"), [(75.0, 9.0), (20.0, 9.0), (75.0, -3.0), (400.0, 900.0), (-5.0, 2.0)])
def test_what_is_learned_from_is_what_counts(gain: float, marginal: float) -> None:
    """A gain on left-out gaits beyond what all data show is luck, for the learning as for a diagnosis: 75 nats left out
    with 9 in all count 28."""
    label = next(each for each in blind_bank.bank() if each["kind"] == "single" and each["d"] > 8)
    document = {
        "ranking": [{"effect": "payload", "elpd_gain": gain, "marginal_nats": marginal},
                    {"effect": "none", "elpd_gain": 0.0}],
        "chance_nats": 2.0, "refit_upper_m": 0.012, "floor_m": 0.010,
    }  # fmt: skip
    one = case(truth_of(label), document)
    known = calibrated(planted(12), words="test")
    by = Calibration(**{name: known[name] for name in Calibration.__dataclass_fields__ if name in known})
    assert one is not None
    plain = replace(by, luck=np.inf, marginal_most=np.inf)
    expected = plain.score("payload", float(one.score[0]), marginal=float(one.marginal[0]))
    assert by.score("payload", gain, marginal=marginal) == pytest.approx(expected, rel=1e-12)
    if (gain, marginal) == (75.0, 9.0):
        assert one.score[0] == 28.0


def test_too_few_sets_teach_nothing() -> None:
    """Eleven are refused."""
    with pytest.raises(InputError, match="too few"):
        calibrated(planted(11), words="test")


def test_what_only_strangers_leave_is_learned() -> None:
    """Half-way between the most that any other set leaves and the least beyond, with the odds of as many strangers;
    nothing where a set that the catalogue explains leaves the most."""
    sets = [replace(one, left_sd=min(0.1 * k, 3.0)) for k, one in enumerate(planted(60))]
    sets[7] = replace(sets[7], truth="unknown", left_sd=5.0)
    sets[8] = replace(sets[8], truth="unknown", left_sd=4.0)
    sets[9] = replace(sets[9], truth="payload", left_sd=3.0)
    found = calibrated(sets, words="test")
    assert found["unfit"] == pytest.approx(3.5)
    assert found["unfit_share"] == pytest.approx(0.75)
    assert Calibration(**{key: found[key] for key in ("unfit", "unfit_share")}).refuses(3.6)
    sets[9] = replace(sets[9], left_sd=6.0)
    assert "unfit" not in calibrated(sets, words="test")
