"""Late and early observations, and gradients that contradict each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.examples.load import load

noisy, contradiction, run = (load("04_observations", name) for name in ("noisy", "contradiction", "run"))


def spread(path: object, t: float) -> float:
    """Standard deviation of the fitted speed about the truth, from 20000 draws."""
    speeds = noisy.monte_carlo(path, t, 20000, np.random.default_rng(1))
    return float(np.sqrt(np.mean((speeds - 1) ** 2)))


@pytest.mark.parametrize("t", [1.0, 3.0, 9.0])
def test_noise_on_a_line(t: float) -> None:
    """On x = v t the speed deviates by sd / t: a late observation is better by the ratio of the times."""
    assert float(noisy.closed_form(noisy.LINE, np.array(t))) == pytest.approx(noisy.SD / t)
    assert spread(noisy.LINE, t) == pytest.approx(noisy.SD / t, rel=0.03)


@pytest.mark.parametrize("t", [0.3, 3.0, 6.0, 9.0])
def test_noise_on_a_zigzag(t: float) -> None:
    """Away from the turning points the closed form sd / |df/dv| holds on the zigzag too."""
    assert noisy.solutions(noisy.ZIGZAG, t) == 1
    assert spread(noisy.ZIGZAG, t) == pytest.approx(float(noisy.closed_form(noisy.ZIGZAG, np.array(t))), rel=0.04)


def test_late_is_not_always_better() -> None:
    """Near a turning point a later observation fits several speeds and is worse than an early one."""
    assert noisy.solutions(noisy.ZIGZAG, 4.2) == 3
    assert spread(noisy.ZIGZAG, 4.2) > 3 * spread(noisy.ZIGZAG, 0.3)


def test_all_observations_are_better_than_the_last() -> None:
    """Least squares over n even times on a line has sd / sqrt(sum t^2), sqrt(n / 3) times less than the last alone."""
    t = np.arange(1, 91) / 10
    everything = noisy.closed_form_all(noisy.LINE, t)
    draws = np.random.default_rng(2).standard_normal((4000, 90)) * noisy.SD + t
    assert everything == pytest.approx(float(np.std(draws @ t / np.sum(t * t))), rel=0.05)
    assert noisy.SD / 9 / everything == pytest.approx(np.sqrt(90 / 3), rel=0.02)


def test_pulls_are_minus_the_derivative_of_the_losses() -> None:
    """The pull of every target is minus the central difference of its loss by the speed."""
    v = np.array([0.13, 0.3, 0.45, 0.72, 1.21, 1.83])

    def losses(v: np.ndarray) -> np.ndarray:
        t = contradiction.TARGETS
        return (contradiction.triangle(v[:, None] * t)[0] - contradiction.triangle(t)[0]) ** 2

    np.testing.assert_allclose(
        contradiction.pulls(v), -(losses(v + 1e-6) - losses(v - 1e-6)) / 2e-6, rtol=1e-6, atol=1e-3
    )


def test_the_figure_of_the_paper() -> None:
    """At 0.3 m/s the first and the third target pull the speed up, the second drags it down; the key frames agree."""
    slow = np.array(0.3)
    assert np.sign(contradiction.pulls(slow)).tolist() == [1, -1, 1]
    assert np.sign(contradiction.key_frame_pulls(slow)).tolist() == [1, 1, 1]


def test_key_frames_never_contradict() -> None:
    """From 0.05 to 3 m/s all key frames pull towards 1 m/s, while some target pulls away over half of that range."""
    v = np.linspace(0.05, 3, 60)
    right = np.sign(1 - v)[:, None]
    assert np.all(np.sign(contradiction.key_frame_pulls(v)) == right)
    assert np.mean(np.any(np.sign(contradiction.pulls(v)) == -right, axis=1)) > 0.5


def test_run_prints_and_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The example prints both tables and writes both figures."""
    run.main(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"noisy.png", "contradiction.png"}
    assert "speeds that fit" in capsys.readouterr().out
