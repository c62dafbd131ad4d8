"""How much: shares with intervals, and the black box that corrects what can be predicted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.diagnose.much import much
from r2s2r_cli.stages.diagnose.much.blackbox import corrected
from r2s2r_cli.stages.diagnose.much.much import _likely
from r2s2r_cli.stages.diagnose.much.shrink import Shrinkage, foretold, share_with_interval, squared_of
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.measures.gap import counting, own_share


def test_a_share_is_of_the_gap_above_the_floor() -> None:
    """5 mm of gap that shrink to 0 above a floor of 5 mm are all of it; its interval holds it."""
    rng = np.random.default_rng(0)
    before = 2 * 0.005**2 * rng.uniform(0.9, 1.1, 30)
    after = 0.005**2 * rng.uniform(0.9, 1.1, 30)
    share, ends = share_with_interval(before, after, 0.005)
    assert share is not None and share > 0.75
    assert ends is not None and ends[0] <= share <= ends[1]


def test_at_the_floor_there_is_no_share() -> None:
    """A refit error at the floor leaves nothing to share."""
    share, ends = share_with_interval(np.full(10, 0.005**2), np.full(10, 0.004**2), 0.005)
    assert share is None and ends is None


def _errors(squared: np.ndarray, rng: np.random.Generator | None = None) -> np.ndarray:
    """Errors (segment, 6, 3) [m] with so large mean squared distances, all caps one way; rng: of a random one."""
    way = np.tile([1.0, 0.0, 0.0], (len(squared), 1))
    way = way if rng is None else rng.standard_normal(way.shape)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.repeat((np.sqrt(squared)[:, None] * way)[:, None], 6, axis=1)


NOWHERE = np.zeros((1, 6, 6, 3))
"""Of six further segments, on which refit and effect do not part."""


def test_a_forecast_holds_what_as_many_further_segments_have() -> None:
    """An effect that leaves 12 mm and moves the robot by 16 mm, whichever way: 90 % intervals from 24 segments hold 80
    to 100 % of 50 shares of 6 further ones, be it believed or only measured."""
    rng = np.random.default_rng(1)
    groups = [f"g{k // 6}" for k in range(24)]

    def drawn(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        after = _errors(1.5e-4 * rng.gamma(4.0, 0.25, count), rng)
        apart = _errors(2.5e-4 * rng.gamma(4.0, 0.25, count), rng)
        return after + apart, after, apart

    for likely in (0.0, 1.0):
        held, widths = [], []
        for seed in range(50):
            (before, after, _), (later, left, apart) = drawn(24), drawn(6)
            told, ends = foretold(before, after, apart[None], 0.005, groups=groups, likely=likely, seed=seed)
            share = own_share(squared_of(later), squared_of(left), 0.005)
            assert told is not None and ends is not None and share is not None
            held.append(ends[0] <= share <= ends[1])
            widths.append(ends[1] - ends[0])
        assert np.mean(held) >= 0.80
        assert np.mean(widths) < 0.7


def test_what_an_effect_does_elsewhere_is_no_forecast() -> None:
    """An effect that takes all of 20 mm off the fitted gaits: on commands under which it moves nothing its share is 0,
    on others it is as large as it moves the robot; a name that is surely wrong has the share that was measured."""
    before, after = _errors(np.full(24, 4e-4)), _errors(np.full(24, 4e-5))
    groups = [f"g{k // 6}" for k in range(24)]
    measured, _ = foretold(before, after, NOWHERE, 0.005, groups=groups, likely=0.0)
    assert measured == pytest.approx(0.80, abs=0.01)
    assert foretold(before, after, NOWHERE, 0.005, groups=groups)[0] == pytest.approx(0.0)
    moved = _errors(np.full(6, 1e-3))[None]
    share = own_share(squared_of(after[:6] + moved[0]), squared_of(after[:6]), 0.005)
    assert foretold(before, after, moved, 0.005, groups=groups)[0] == pytest.approx(share)
    # Between the two: what is likelier decides, and the interval holds both.
    for likely, middle in ((0.8, 0.0), (0.2, 0.80)):
        told, ends = foretold(before, after, NOWHERE, 0.005, groups=groups, likely=likely)
        assert told == pytest.approx(middle, abs=0.01)
        assert ends == pytest.approx((0.0, 0.80), abs=0.01)


def test_one_fall_that_an_effect_explains_moves_the_forecast_little() -> None:
    """It moves the ratio of all by more than 20 points, the forecast of 6 by less than 10."""
    groups = [f"g{k // 6}" for k in range(24)]
    before, after = np.full(24, 4e-4), np.full(24, 2.9e-4)
    plain, _ = foretold(_errors(before), _errors(after), NOWHERE, 0.005, groups=groups, likely=0.0)
    before[3], after[3] = 1e-2, 2.9e-4
    told, _ = foretold(_errors(before), _errors(after), NOWHERE, 0.005, groups=groups, likely=0.0)
    share, _ = share_with_interval(before, after, 0.005)
    assert plain is not None and told is not None and share is not None
    assert share - plain > 0.2
    assert told - plain < 0.1


@pytest.mark.parametrize(
    ("verdict", "own", "p"),
    [(("payload",), ("payload",), 0.8), (("a", "b"), ("b", "a"), 0.8), ((), ("payload",), 0.3), ((), ("lost",), 0.0)],
)
def test_a_forecast_is_as_sure_as_its_effect(verdict: tuple[str, ...], own: tuple[str, ...], p: float) -> None:
    """Of what is named, one or two, the verdict's probability; where nothing is, that of the effect in the ranking,
    not that of what is first there."""
    ranking = (SimpleNamespace(effect="none", probability=0.6), SimpleNamespace(effect="payload", probability=0.3))
    which = SimpleNamespace(effects=verdict, probability=0.8, ranking=ranking)
    fit = SimpleNamespace(hypothesis=SimpleNamespace(effects=own))
    assert _likely(SimpleNamespace(which=which), fit) == p  # type: ignore[arg-type]


def test_at_the_floor_nothing_is_foretold() -> None:
    """Errors at the floor, no segments, nothing to be judged: no forecast."""
    at = _errors(np.full(8, 0.005**2))
    groups = ["g"] * 8
    assert foretold(at, at / 2, NOWHERE, 0.005, groups=groups) == (None, None)
    assert foretold(np.full_like(at, np.nan), at, NOWHERE, 0.005, groups=groups) == (None, None)
    assert foretold(2 * at, at, NOWHERE[:, :0], 0.005, groups=groups) == (None, None)


@pytest.mark.parametrize(("count", "left"), [(1, 1), (2, 1), (5, 4), (10, 9), (11, 10), (12, 10), (21, 19)])
def test_the_best_nine_in_ten_count(count: int, left: int) -> None:
    """As many as in the floor of the healthy runs (their 0.9 quantile): the worst go, in whatever order they come."""
    worst = np.random.default_rng(count).permutation(count).astype(float)
    kept = counting(worst, 0.9)
    assert kept.sum() == left == (worst <= np.quantile(worst, 0.9)).sum()
    assert worst[kept].max(initial=-1.0) < worst[~kept].min(initial=np.inf)
    assert counting(worst, 1.0).all()


def test_what_is_not_finite_does_not_count() -> None:
    """A segment that left the finite numbers is among the worst; of several rows each has its own."""
    many = counting(np.array([[1.0, np.nan, 2.0, 3.0, 4.0], [5.0, 1.0, 1.0, np.inf, 1.0]]), 0.75)
    assert many.tolist() == [[True, False, True, True, True], [True, True, True, False, True]]
    assert not counting(np.full(3, np.nan), 1.0).any()


def test_one_fall_decides_no_share() -> None:
    """A model that halves the error everywhere but in one interval, where both fall: without it the share is that of
    the others, forecast and realised, and the fall is named; with it nothing is left of the share."""
    before, after = np.full(10, 4 * 0.006**2), np.full(10, 0.006**2)
    before[4] = after[4] = 0.2**2
    share, ends = share_with_interval(before, after, 0.006, kept=0.9)
    told, _ = foretold(
        _errors(before), _errors(after), NOWHERE, 0.006, groups=[f"g{k // 5}" for k in range(10)], likely=0.0, kept=0.9
    )  # fmt: skip
    plain, _ = share_with_interval(before, after, 0.006)
    assert share == pytest.approx(1.0) and ends is not None and ends[1] == pytest.approx(1.0)
    assert told is not None and told > 0.9
    assert plain is not None and plain < 0.05
    made = Shrinkage(
        effects=("payload",), names=tuple(f"g:{k}" for k in range(10)), floor=0.006, share=share, ci90=ends,
        squared={"refit": before, "effect": after, "nominal": 2 * before}, predicted=told, predicted_ci90=None,
        within_run=False, kept=0.9,
    )  # fmt: skip
    assert made.set_aside == ("g:4",)
    assert made.rmse("refit") == pytest.approx(0.012) and made.rmse("nominal") == pytest.approx(0.012 * np.sqrt(2))
    assert made.gap("effect") == pytest.approx(0.0, abs=1e-9)


def _stretches(count: int, rng: np.random.Generator) -> tuple[list[SimpleNamespace], np.ndarray]:
    """Stretches of random binary targets whose errors follow the first cable in the robot's heading."""
    target = rng.integers(0, 2, (count + 1, 6)).astype(float)
    rest = np.array([[0.1, 0, 0], [-0.1, 0, 0], [0, 0.1, 0], [0, -0.1, 0], [0, 0, 0.1], [0, 0, 0.1]])
    many, errors = [], []
    for k in range(count):
        angle = rng.uniform(-3, 3)
        R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
        run = SimpleNamespace(intervals=SimpleNamespace(target=target), observed=(rest @ R.T)[None])
        many.append(SimpleNamespace(window=SimpleNamespace(run=run), interval=k + 2))
        own = 0.01 * (target[k + 1, 0] - target[k, 0]) * np.tile([1.0, 0.5, 0.0], (6, 1))
        errors.append(own @ R.T + 1e-4 * rng.standard_normal((6, 3)))
    return many, np.array(errors)


def test_the_black_box_takes_what_commands_predict_and_nothing_of_noise() -> None:
    """Errors that follow a command go; noise stays as large as it was."""
    rng = np.random.default_rng(3)
    fitted, errors = _stretches(40, rng)
    judged, others = _stretches(12, rng)
    left = corrected(fitted, errors, judged, others)  # type: ignore[arg-type]
    assert np.sqrt(np.mean(left**2)) < 0.15 * np.sqrt(np.mean(others**2))
    noise = rng.standard_normal(errors.shape)
    unknown = rng.standard_normal(others.shape)
    assert np.mean(corrected(fitted, noise, judged, unknown) ** 2) < 1.3 * np.mean(unknown**2)  # type: ignore[arg-type]


def test_probabilities_are_a_softmax_and_the_set_is_never_empty() -> None:
    """Scores a temperature apart differ by e; a high threshold leaves the best name."""
    p = Calibration(temperature=5.0).probabilities({"a": 10.0, "b": 5.0, "c": -np.inf})
    assert p["a"] / p["b"] == pytest.approx(np.e)
    assert p["c"] == 0.0 and sum(p.values()) == pytest.approx(1.0)
    assert Calibration(conformal=0.99).within(p) == ("a",)
    assert Calibration(conformal=0.2).within(p) == ("a", "b")


def test_a_run_without_a_whole_interval_is_passed_over() -> None:
    """One that was broken off: where there is no other, it is said that nothing can be judged, not that max() of
    nothing is no number; starts are asked for of the others alone."""
    asked: list[tuple[str, dict[str, int]]] = []

    def at(runs: Any, replayer: Any, values: Any, last: dict[str, int]) -> dict[Any, Any]:
        asked.append((",".join(run.name for run in runs), last))
        return {}

    broken = SimpleNamespace(name="broken")
    with pytest.raises(NumericalError, match="no judged interval"):
        much._errors((broken,), [Selection("broken", ())], SimpleNamespace(replayer=None), None, None,
                     SimpleNamespace(at=at))  # type: ignore[arg-type]  # fmt: skip
    assert asked == [("", {})]
