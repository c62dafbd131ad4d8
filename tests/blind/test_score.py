"""The table of the trials: closed forms, and that nobody passes it who does not look."""

import math
from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.blind.score import score_of
from r2s2r_cli.blind.score.facts import said_of, truth_of
from r2s2r_cli.blind.score.rows import Metric, calibrated_error, calibration_error, row as row_of, same_element
from r2s2r_cli.blind.score.wilson import Z95, bootstrap, of_median, wilson
from schemas.results_blind import BlindRow, BlindScoreResult
from tests.support import blind_bank

LABELS = blind_bank.bank()


def scored(answer: blind_bank.Answer, **options: bool) -> tuple[BlindScoreResult, dict[str, BlindRow]]:
    """The table of a reference diagnoser, and its rows by name."""
    result = score_of(
        blind_bank.answered(LABELS, answer), tier="B", bank="test", sets=len(LABELS), index="0", **options
    )
    return result, {row.name: row for row in result.rows}


@pytest.mark.parametrize("answer", [blind_bank.always, blind_bank.by_chance])
def test_who_does_not_look_fails(answer: blind_bank.Answer) -> None:
    """Always friction, or any answer: neither names the cause, and both cry wolf."""
    _, rows = scored(answer)
    for name in ("top1_clear", "top3_clear", "precision_named", "channel_clear", "element_clear", "false_alarm",
                 "false_claim", "sub_floor", "outside_recall", "coverage", "ece"):  # fmt: skip
        assert rows[name].passed is False, name


def test_who_knows_passes() -> None:
    """The same labels, answered rightly: every target is reached, so none is out of reach."""
    _, rows = scored(blind_bank.right)
    assert {name for name, row in rows.items() if row.passed is False} == set()
    assert rows["top1_clear"].value == 1.0 and rows["place_clear"].value == 0.0 and rows["onset_clear"].value == 1.0


def test_figures_count_the_sets_they_say() -> None:
    """Counted again from the labels: clear singles, those under the floor, the share that is always friction."""
    result, rows = scored(blind_bank.always)
    clear = [one for one in LABELS if one["kind"] == "single" and one["d"] >= 8]
    friction = sum(one["effects"][0]["id"] == "friction_field" for one in clear)
    assert rows["top1_clear"].n == len(clear) and rows["top1_clear"].value == pytest.approx(friction / len(clear))
    assert rows["sub_floor"].n == sum(one["d"] is not None and one["d"] < 3 for one in LABELS)
    assert rows["place_clear"].n == friction and rows["place_clear"].value == pytest.approx(0.3)
    assert sum(map(sum, result.confusion)) == sum(
        one["kind"] == "none" or (one["d"] >= 8 and one["kind"] != "pair") for one in LABELS
    )
    told = next(one for one in result.recall if one.effect == "friction_field")
    assert told.clear == told.top1 == told.named == friction


def test_wilson_solves_its_equation() -> None:
    """Its ends are where the share found lies z standard deviations away (Wilson 1927), and it stays within 0 .. 1."""
    for right, n in ((8, 10), (0, 7), (7, 7), (188, 250)):
        for end in wilson(right, n):
            assert (right / n - end) ** 2 == pytest.approx(Z95**2 * end * (1 - end) / n, abs=1e-14)
            assert 0.0 <= end <= 1.0


def test_not_shown_where_the_interval_holds_the_target() -> None:
    """80 per cent of few sets is no proof of 75; of many it is."""
    few, many = wilson(8, 10), wilson(800, 1000)
    assert few[0] < 0.75 < few[1] and many[0] > 0.75
    _, rows = scored(blind_bank.right)
    for row in rows.values():
        if row.target is not None and row.low is not None and row.high is not None and row.name != "coverage":
            assert row.shown is not (row.low < row.target < row.high)


def test_an_infinite_distance_is_no_number_in_between() -> None:
    """Whoever names no place is infinitely far: a median of such stays infinite."""
    low, high = of_median(np.array([0.1, 0.2, 0.3, 0.4, math.inf, math.inf, math.inf]))
    assert low == 0.1 and high == math.inf


@pytest.mark.parametrize("n", [6, 7, 14, 41])
def test_the_interval_of_a_median_holds_it_in_95_percent(n: int) -> None:
    """Of lognormal draws with the median 1; one value less on either side would hold it too seldom."""
    rng = np.random.default_rng(n)
    drawn = rng.lognormal(size=(4000, n))
    held = [low <= 1.0 <= high for low, high in map(of_median, drawn)]
    assert np.mean(held) > 0.94
    inner = np.sort(drawn, axis=1)
    cut = int(np.searchsorted(inner[0], of_median(drawn[0])[0]))
    assert np.mean((inner[:, cut + 1] <= 1.0) & (inner[:, n - cut - 2] >= 1.0)) < 0.96


@pytest.mark.parametrize("values", [[3.0], [1.0, 2.0], [1.0, 2.0, 3.0, 4.0, 5.0]])
def test_few_values_show_nothing(values: list[float]) -> None:
    """Five of a median lie all on one side in one of 16 trials: no interval of theirs holds it in 95 %, so a figure
    that reaches its target does not show it."""
    assert of_median(np.array(values)) == (-math.inf, math.inf)
    metric = Metric("m", "m", {"B": 9.0}, lambda pair: None, "number", above=False, of="median")
    chosen = iter(values)
    found = row_of(replace(metric, chosen=lambda pair: next(chosen)), [None] * len(values), "B")  # type: ignore[list-item]
    assert found.passed is True and found.shown is False and found.low is found.high is None
    assert bootstrap(np.array([3.0])) == (-math.inf, math.inf)


def test_elements_of_one_string_are_the_same() -> None:
    """Winch, sensor and cable share their numbers; a cap or a rod of that number is something else."""
    truth = {"kind": "motor", "index": 4}
    assert same_element(truth, {"kind": "cable", "index": 4}) and not same_element(truth, {"kind": "cap", "index": 4})
    assert not same_element(truth, {"kind": "motor", "index": 3}) and not same_element(truth, None)


def test_a_set_that_failed_is_a_miss_everywhere() -> None:
    """It counts among the clear ones, and under what was not named."""
    label = next(one for one in LABELS if one["kind"] == "single" and one["d"] > 8)
    found = [("a", truth_of(label), said_of({"failed": "no memory", "diagnosis": {}}))]
    result = score_of(found, tier="B", bank="test", sets=1, index="0")
    rows = {row.name: row for row in result.rows}
    assert result.failed == 1 and rows["top1_clear"].value == 0.0 and rows["share_named"].value == 0.0
    assert result.misses[0].why == "the diagnosis broke off"
    assert rows["channel_claimed"].value == 0.0 and rows["clear_no_gap"].value == 0.0


def test_a_diagnosis_that_broke_off_is_no_all_clear() -> None:
    """Where nothing is wrong it counts as an alarm, by either count."""
    label = next(one for one in LABELS if one["kind"] == "none")
    found = [("a", truth_of(label), said_of({"failed": "no memory", "diagnosis": {}}))]
    rows = {row.name: row for row in score_of(found, tier="B", bank="test", sets=1, index="0").rows}
    assert rows["false_alarm"].value == rows["false_claim"].value == 1.0


def test_where_no_gap_is_said_no_channel_is_asked_for() -> None:
    """Two clear sets, one said to have no gap: the row that is asked for counts both, the one beside it the other."""
    label = next(one for one in LABELS if one["kind"] == "single" and one["d"] > 8 and one["effects"][0]["element"])
    truth, rng = truth_of(label), np.random.default_rng(0)
    silent = blind_bank.document("no_gap", [], {"none": 0.9, "other": 0.1}) | {"where": {}}
    answers = (blind_bank.right(label, rng), silent)
    found = [(str(i), truth, said_of({"diagnosis": answer})) for i, answer in enumerate(answers)]
    rows = {row.name: row for row in score_of(found, tier="B", bank="test", sets=2, index="0").rows}
    assert (rows["channel_clear"].value, rows["channel_claimed"].value) == (0.5, 1.0)
    assert rows["channel_claimed"].n == 1 and rows["clear_no_gap"].value == 0.5


def test_a_calibrated_guesser_errs_by_what_chance_gives() -> None:
    """Probabilities that are right: the error of the guesses lies where the row beside it says, which for few sets is
    far from nothing and for many is near it."""
    label = next(one for one in LABELS if one["kind"] == "single" and one["d"] > 8)
    truth = truth_of(label)
    rng = np.random.default_rng(2)
    chance = {}
    for n in (60, 3000):
        p = rng.uniform(0.3, 1.0, n)
        names = np.where(rng.random(n) < p, str(truth.right), "wrong").tolist()
        answers = [blind_bank.document("effect", [], {name: one}) for name, one in zip(names, p.tolist(), strict=True)]
        pairs = [(truth, said_of({"diagnosis": answer})) for answer in answers]
        error, chance[n] = calibration_error(pairs, "B"), calibrated_error(pairs)
        low, high = chance[n].low, chance[n].high
        assert low is not None and high is not None and error.value is not None and low <= error.value <= high
    assert (chance[60].value or 0) > 4 * (chance[3000].value or 1) and chance[60].passed is None


def test_the_90_percent_set_of_a_diagnosis_that_broke_off_holds_nothing() -> None:
    """Two sets of three are right and hold two names, one broke off: coverage is 2 of 3, and the median of the sizes
    that of the two."""
    label = next(one for one in LABELS if one["kind"] == "single" and one["d"] > 8)
    truth = truth_of(label)
    broken = said_of({"failed": "no memory", "diagnosis": {}})
    good = replace(broken, failed=False, verdict="effect", order=(str(truth.right),), probability=(0.9,),
                   set90=(str(truth.right), "none"))  # fmt: skip
    found = [("a", truth, good), ("b", truth, good), ("c", truth, broken)]
    rows = {row.name: row for row in score_of(found, tier="B", bank="test", sets=3, index="0").rows}
    assert rows["coverage"].n == 3 and rows["coverage"].value == pytest.approx(2 / 3)
    assert rows["set_size"].n == 2 and rows["set_size"].value == 2.0


def test_of_shuffled_commands_only_the_control_is_told() -> None:
    """Nothing is true there, so nothing else can be scored."""
    result, rows = scored(blind_bank.always, shuffled=True)
    assert list(rows) == ["shuffled_named"] and rows["shuffled_named"].passed is False and len(result.rows) == 1
