"""How much: shares with intervals, and the black box that corrects what can be predicted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.much.blackbox import corrected
from r2s2r_cli.stages.diagnose.much.shrink import share_with_interval
from r2s2r_cli.stages.diagnose.which.calibration import Calibration


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
    """Scores a temperature apart differ by e; a bias counts like nats; a high threshold leaves the best name."""
    p = Calibration(temperature=5.0, bias={"b": 5.0}).probabilities({"a": 10.0, "b": 0.0, "c": -np.inf})
    assert p["a"] / p["b"] == pytest.approx(np.e)
    assert p["c"] == 0.0 and sum(p.values()) == pytest.approx(1.0)
    assert Calibration(conformal=0.99).within(p) == ("a",)
    assert Calibration(conformal=0.2).within(p) == ("a", "b")
