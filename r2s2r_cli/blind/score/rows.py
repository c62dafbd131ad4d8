"""The table of the issue: every metric with its target, its sets, its interval, and whether the interval shows it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from r2s2r_cli.blind.score.facts import NONE, UNKNOWN, WEAK, Said, Truth
from r2s2r_cli.blind.score.wilson import bootstrap, of_median, wilson
from schemas.results_blind import BlindRow, Tier

Pair = tuple[Truth, Said]
MOTOR_KINDS = frozenset({"motor", "cable", "sensor"})
"""Elements of one string, which have one number on the robot of the trials: its motor i winds cable i."""
BINS = 10


@dataclass(frozen=True)
class Metric:
    """value: of the sets that `chosen` gives, True or False each, or a number (infinite where a place was asked for and
    none said), or None where it does not apply."""

    name: str
    what: str
    targets: dict[Tier, float | None]
    chosen: Callable[[Pair], bool | float | None]
    unit: Literal["share", "m", "number"] = "share"
    above: bool = True
    of: Literal["mean", "median"] = "mean"


def row(metric: Metric, pairs: Sequence[Pair], tier: Tier) -> BlindRow:
    """One line of the table."""
    values = [value for value in map(metric.chosen, pairs) if value is not None]
    target = metric.targets.get(tier)
    if not values:
        return _row(metric, target, None, 0, None)
    if metric.unit == "share" and all(isinstance(value, bool) for value in values):
        right = sum(bool(value) for value in values)
        return _row(metric, target, right / len(values), len(values), wilson(right, len(values)))
    numbers = np.array(values, dtype=float)
    if metric.of == "median":
        found = _row(metric, target, float(np.median(numbers)), len(numbers), of_median(numbers))
        return found.model_copy(update={"unsaid": int(np.isinf(numbers).sum())})
    return _row(metric, target, float(numbers.mean()), len(numbers), bootstrap(numbers))


def calibration_error(pairs: Sequence[Pair], tier: Tier) -> BlindRow:
    """Expected calibration error of the first guess over ten equal steps of probability."""
    metric = Metric("ece", "calibration error of the first guess's probability, all sets but pairs",
                    {"A": 0.07, "B": 0.10}, lambda pair: None, above=False)  # fmt: skip
    p, right = _guesses(pairs)
    if not len(p):
        return _row(metric, metric.targets[tier], None, 0, None)
    rng = np.random.default_rng(0)
    drawn = sorted(_ece(p[i], right[i]) for i in rng.integers(0, len(p), (500, len(p))))
    return _row(metric, metric.targets[tier], _ece(p, right), len(p), (drawn[12], drawn[487]))


def calibrated_error(pairs: Sequence[Pair]) -> BlindRow:
    """What the calibration error of as many guesses comes to by chance where every probability is right: few sets in
    a step are never half right. In the mean, with 95 % of what is drawn."""
    metric = Metric("ece_calibrated", "the same error where all these probabilities were right, by chance", {},
                    lambda pair: None)  # fmt: skip
    p, _ = _guesses(pairs)
    if not len(p):
        return _row(metric, None, None, 0, None)
    drawn = sorted(_ece(p, right) for right in np.random.default_rng(0).random((500, len(p))) < p)
    return _row(metric, None, float(np.mean(drawn)), len(p), (drawn[12], drawn[487]))


def _guesses(pairs: Sequence[Pair]) -> tuple[np.ndarray, np.ndarray]:
    """Probability of the first guess, and whether it is right, of all sets but pairs."""
    told = [(s.probability[0], s.first == t.right) for t, s in pairs if t.right is not None and s.order]
    return np.array([p for p, _ in told], dtype=float), np.array([right for _, right in told], dtype=float)


def coverage(pairs: Sequence[Pair], tier: Tier) -> BlindRow:
    """How often the 90 % set holds the truth: too often is as wrong as too seldom. One of a diagnosis that broke off
    holds nothing."""
    held = [t.right in s.set90 for t, s in pairs if t.right is not None]
    low, high = (0.87, 0.93) if tier == "A" else (0.85, 0.95)
    metric = Metric("coverage", f"90 % set holds the truth ({low:.0%} to {high:.0%} asked for), all sets but pairs",
                    {tier: low}, lambda pair: None)  # fmt: skip
    if not held:
        return _row(metric, low, None, 0, None)
    n, right = len(held), sum(held)
    found = _row(metric, low, right / n, n, wilson(right, n))
    a, b = wilson(right, n)
    inside = low <= right / n <= high
    return found.model_copy(update={"passed": inside, "shown": (low <= a and b <= high) or b < low or a > high})


def _row(
    metric: Metric, target: float | None, value: float | None, n: int, interval: tuple[float, float] | None
) -> BlindRow:
    low, high = interval or (None, None)
    passed = shown = None
    if target is not None and value is not None and low is not None and high is not None:
        passed = value >= target if metric.above else value <= target
        shown = low >= target or high < target if metric.above else high <= target or low > target
    finite = [None if x is None or not math.isfinite(x) else x for x in (value, low, high)]
    return BlindRow(name=metric.name, what=metric.what, target=target, above=metric.above, unit=metric.unit,
                    value=finite[0], n=n, low=finite[1], high=finite[2], passed=passed, shown=shown)  # fmt: skip


def _ece(p: np.ndarray, right: np.ndarray) -> float:
    place = np.minimum((p * BINS).astype(int), BINS - 1)
    return float(np.abs(np.bincount(place, p - right, BINS)).sum() / len(p))


def _claimed(s: Said) -> bool:
    """Whether it says that there is a gap."""
    return s.verdict != "no_gap"


def _clear(t: Truth) -> bool:
    return t.kind == "single" and t.stratum == "clear"


def _weak(t: Truth) -> bool:
    return t.kind == "single" and t.stratum == "weak"


def same_element(truth: dict[str, object], said: dict[str, object] | None) -> bool:
    """Whether an element is the true one; winch, sensor and cable of one number are the same string."""
    if said is None or said.get("index") != truth["index"]:
        return False
    kinds = {truth["kind"], said.get("kind")}
    return len(kinds) == 1 or kinds <= MOTOR_KINDS


def _element(pair: Pair) -> bool | None:
    t, s = pair
    return same_element(t.element, s.element) if _clear(t) and t.element is not None else None


def _place(pair: Pair) -> float | None:
    t, s = pair
    if not (_clear(t) and t.place is not None):
        return None
    xy = (s.element or {}).get("xy_m")
    return math.inf if not xy else math.dist(t.place, (float(xy[0]), float(xy[1])))


def _onset(pair: Pair) -> bool | None:
    t, s = pair
    return s.onset == t.onset["of_set"] if _clear(t) and t.onset is not None else None


def _both(t: Truth) -> bool:
    return t.kind == "pair" and len(t.each) == 2 and min(t.each) >= WEAK


def _own(pair: Pair) -> float | None:
    t, s = pair
    return s.own_share if _clear(t) and s.named == t.effects else None


def _foretold(pair: Pair) -> float | None:
    s = pair[1]
    return None if s.own_share is None or s.predicted is None else abs(s.own_share - s.predicted)


def _rival(pair: Pair) -> bool | None:
    """Whether the right effect leaves less than the most probable wrong one, of clear sets where both were fitted."""
    t, s = pair
    wrong = [name for name in s.order if name not in (NONE, UNKNOWN, t.right) and name in s.rmse]
    if not _clear(t) or t.right not in s.rmse or not wrong:
        return None
    return s.rmse[str(t.right)] < s.rmse[wrong[0]]


METRICS = (
    Metric("top1_clear", "first guess right, clear single effects", {"A": 0.90, "B": 0.75},
           lambda p: p[1].first == p[0].right if _clear(p[0]) else None),
    Metric("top3_clear", "truth among the first three, clear", {"A": 0.98, "B": 0.92},
           lambda p: p[0].right in p[1].order[:3] if _clear(p[0]) else None),
    Metric("precision_named", "right where one name is committed to, clear", {"A": 0.95, "B": 0.90},
           lambda p: p[1].named == p[0].effects if _clear(p[0]) and p[1].named else None),
    Metric("share_named", "a name is committed to, clear", {"A": 0.85, "B": 0.65},
           lambda p: bool(p[1].named) if _clear(p[0]) else None),
    Metric("top1_weak", "first guess right, weak single effects", {"A": 0.65, "B": 0.50},
           lambda p: p[1].first == p[0].right if _weak(p[0]) else None),
    Metric("top3_weak", "truth among the first three, weak", {"A": 0.85, "B": 0.75},
           lambda p: p[0].right in p[1].order[:3] if _weak(p[0]) else None),
    Metric("channel_clear", "channel right, clear", {"A": 0.95, "B": 0.88},
           lambda p: p[1].channel == p[0].channel if _clear(p[0]) else None),
    Metric("channel_claimed", "channel right, clear, where a gap is claimed", {},
           lambda p: p[1].channel == p[0].channel if _clear(p[0]) and _claimed(p[1]) else None),
    Metric("element_clear", "element right, clear effects that have one", {"A": 0.90, "B": 0.80}, _element),
    Metric("element_claimed", "element right, clear effects that have one, where a gap is claimed", {},
           lambda p: _element(p) if _claimed(p[1]) else None),
    Metric("clear_no_gap", "'no gap' said, clear single effects", {},
           lambda p: not _claimed(p[1]) if _clear(p[0]) else None),
    Metric("place_clear", "distance to the middle of a patch, clear, median", {"A": 0.06, "B": 0.10}, _place, "m",
           above=False, of="median"),
    Metric("onset_clear", "target interval in which it begins right, clear effects that begin", {"A": 0.85, "B": 0.75},
           _onset),
    Metric("false_alarm", "anything but 'no gap' where nothing is wrong", {"A": 0.05, "B": 0.10},
           lambda p: p[1].verdict != "no_gap" if p[0].kind == "none" else None, above=False),
    Metric("false_claim", "an effect, a pair or 'unknown' said where nothing is wrong", {"A": 0.05, "B": 0.10},
           lambda p: p[1].verdict not in ("no_gap", "ambiguous") if p[0].kind == "none" else None, above=False),
    Metric("sub_floor", "'no gap' where the effect lies under the floor", {"A": 0.90, "B": 0.85},
           lambda p: p[1].verdict == "no_gap" if p[0].stratum == "sub-floor" else None),
    Metric("outside_recall", "'unknown' where no catalogue has it, clear", {"A": 0.80, "B": 0.65},
           lambda p: p[1].verdict == "unknown" if p[0].kind == "outside" and p[0].stratum == "clear" else None),
    Metric("outside_recall_all", "'unknown' where no catalogue has it, however little it does", {},
           lambda p: p[1].verdict == "unknown" if p[0].kind == "outside" else None),
    Metric("outside_precision", "no catalogue has it where 'unknown' is said", {"A": 0.85, "B": 0.75},
           lambda p: p[0].kind == "outside" if p[1].verdict == "unknown" else None),
    Metric("outside_channel", "channel right where 'unknown' is said rightly", {"A": 0.75, "B": 0.60},
           lambda p: p[1].channel == p[0].channel if p[0].kind == "outside" and p[1].verdict == "unknown" else None),
    Metric("pair_top3", "both among the first three, pairs whose parts are at least weak", {"A": 0.75, "B": 0.60},
           lambda p: set(p[0].effects) <= set(p[1].order[:3]) if _both(p[0]) else None),
    Metric("pair_exact", "the pair named, parts at least weak", {"A": 0.55, "B": 0.40},
           lambda p: set(p[1].named) == set(p[0].effects) if _both(p[0]) else None),
    Metric("set_size", "size of the 90 % set, median, of diagnoses that did not break off", {"A": 2.0, "B": 3.0},
           lambda p: None if p[1].failed else float(len(p[1].set90)), "number", above=False, of="median"),
    Metric("own_share", "own share of the gap above the floor, right effect named and a gap left, clear, median",
           {"A": 0.80, "B": 0.60}, _own, of="median"),
    Metric("foretold", "predicted against realised own share, mean distance", {"A": 0.08, "B": 0.12}, _foretold,
           above=False),
    Metric("wrong_less", "the right effect leaves less error on left-out intervals than its nearest rival, clear", {},
           _rival),
    Metric("next_gait_resolves", "ambiguous sets that the suggested gait resolves", {"A": 0.60, "B": 0.50},
           lambda p: p[1].suggested),
    Metric("next_gait_random", "ambiguous sets that a random gait resolves", {}, lambda p: p[1].random),
    Metric("top1_all", "first guess right, all sets but pairs", {},
           lambda p: p[1].first == p[0].right if p[0].right is not None else None),
    Metric("ambiguous", "'ambiguous', all sets", {}, lambda p: p[1].verdict == "ambiguous"),
)  # fmt: skip
"""In the order of the table; calibration and coverage are made apart."""
CONTROL = Metric("shuffled_named", "a name is committed to although the commands were exchanged (negative control)",
                 {"A": 0.0, "B": 0.0}, lambda p: bool(p[1].named), above=False)  # fmt: skip
"""The only row where commands were exchanged between target intervals: nothing may be named."""
WITHOUT = Metric("without_named", "an effect is named that the catalogue was not given (negative control)",
                 {"A": 0.0, "B": 0.0}, lambda p: p[1].failed, above=False)  # fmt: skip
"""Where `failed` says that one was."""
AGAIN = Metric("same_verdict", "the same verdict under other noise on the same world (negative control)",
               {"A": 0.95, "B": 0.95}, lambda p: not p[1].failed)  # fmt: skip
"""Where `failed` says that both verdicts differ."""
CLASSES_LAST = (NONE, UNKNOWN)
