"""From gains to probabilities: planted numbers come back, and what was left out is covered as often as promised."""

import numpy as np
import pytest

from r2s2r_cli.blind.score.calibrate import Case, calibrated, case
from r2s2r_cli.blind.score.facts import truth_of
from r2s2r_cli.errors import InputError
from tests.support import blind_bank

EFFECTS = ("backlash", "payload", "motor_lag", "soft_ground")
TEMPERATURE, PARITY, EQUIVALENT, UNKNOWN = 5.0, 3.5, 8.0, 20.0
BIAS = {"soft_ground": -9.0}


def planted(count: int, seed: int = 0) -> list[Case]:
    """Sets whose truth is drawn from the probabilities of known numbers."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        names = (*EFFECTS, "none", "unknown")
        score = np.array([*rng.normal(12.0, 10.0, len(EFFECTS)), 8.0, rng.uniform(0.0, 45.0)])
        parity = np.array([*rng.exponential(1.5, len(EFFECTS)), 0.0, 0.0])
        equivalent = bool(rng.random() < 0.3)
        x = (
            score
            + PARITY * parity
            + np.array([*(BIAS.get(name, 0.0) for name in EFFECTS), EQUIVALENT * equivalent, -UNKNOWN])
        )
        p = np.exp((x - x.max()) / TEMPERATURE)
        found.append(Case(names, score, parity, equivalent, names[rng.choice(len(names), p=p / p.sum())]))
    return found


def test_planted_numbers_come_back() -> None:
    """Of 800 sets: temperature, what the parity stage is worth, offsets and the effect that wins too easily."""
    found = calibrated(planted(800), words="test")
    assert found["temperature"] == pytest.approx(TEMPERATURE, rel=0.2)
    assert found["parity"] == pytest.approx(PARITY, rel=0.3)
    assert found["unknown"] == pytest.approx(UNKNOWN, abs=3.0)
    assert found["equivalent"] == pytest.approx(EQUIVALENT, abs=3.0)
    assert found["bias"]["soft_ground"] - found["bias"]["payload"] == pytest.approx(-9.0, abs=2.5)


def test_a_set_of_90_per_cent_holds_the_truth_so_often() -> None:
    """On sets that no number was learned from, with thresholds from 300 others."""
    found = calibrated(planted(300), words="test")
    held = sure = named = 0
    fresh = planted(1500, seed=1)
    for one in fresh:
        bias = np.array([found["bias"].get(name, 0.0) for name in one.names])
        offset = {"none": found["equivalent"] * one.equivalent, "unknown": -found["unknown"]}
        x = (one.score + found["parity"] * one.parity + bias + [offset.get(name, 0.0) for name in one.names]) / found[
            "temperature"
        ]
        p = np.exp(x - x.max())
        p = p / p.sum()
        held += p[one.names.index(one.truth)] >= found["conformal"]
        sure += p.max() >= found["commit"]
        named += p.max() >= found["commit"] and one.names[int(p.argmax())] == one.truth
    assert 0.85 < held / len(fresh) < 0.95
    assert named / sure > 0.85


def test_a_verdict_becomes_a_case() -> None:
    """Gains as they are; chance for `none`; pairs and what was never fitted are left out."""
    label = {"kind": "single", "effects": [{"id": "payload", "channel": "mass", "element": None, "onset": None}],
             "d": 9.0, "d_each": [9.0], "outside": None}  # fmt: skip
    document = {
        "ranking": [{"effect": "payload", "elpd_gain": 7.5, "parity_nats": 2.5}, {"effect": "none", "elpd_gain": 0.0},
                    {"effect": "unknown", "elpd_gain": 3.0}, {"effect": "backlash", "elpd_gain": -1e9}],
        "chance_nats": 2.0, "refit_upper_m": 0.012, "floor_m": 0.010,
    }  # fmt: skip
    one = case(truth_of(label), document)
    assert one is not None and one.names == ("payload", "none", "unknown") and one.score.tolist() == [7.5, 2.0, 3.0]
    assert one.parity.tolist() == [2.5, 0.0, 0.0]
    assert one.equivalent and one.truth == "payload"
    pair = next(each for each in blind_bank.bank() if each["kind"] == "pair" and each["d"] > 3)
    assert case(truth_of(pair), document) is None


def test_too_few_sets_teach_nothing() -> None:
    """Eleven are refused."""
    with pytest.raises(InputError, match="too few"):
        calibrated(planted(11), words="test")
