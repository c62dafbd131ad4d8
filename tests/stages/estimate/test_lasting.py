"""Errors that last: seen in rod lengths, and as large as white noise that says as little."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.lasting import lasting
from r2s2r_cli.stages.frames import noise_sd

RODS, LENGTH_M, RATE_HZ, SECONDS = 3, 0.36, 30.0, 60.0


def seen(rho: float, sd: float, *, seed: int = 0, seconds: float = SECONDS) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and caps of rods that turn slowly, with AR(1) errors of correlation rho from frame to frame."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    angle = 0.3 * t[:, None] + np.arange(RODS)
    u = np.stack([np.cos(angle), np.sin(angle), 0.2 * np.ones_like(angle)], axis=-1)
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    middle = 0.05 * np.sin(0.5 * t)[:, None, None] * np.ones((1, RODS, 3))
    caps = np.stack([middle - LENGTH_M / 2 * u, middle + LENGTH_M / 2 * u], axis=2).reshape(len(t), 2 * RODS, 3)
    error = np.empty_like(caps)
    error[0] = rng.standard_normal(caps.shape[1:])
    for k in range(1, len(t)):
        error[k] = rho * error[k - 1] + np.sqrt(1 - rho**2) * rng.standard_normal(caps.shape[1:])
    return t, caps + sd * error


@pytest.mark.parametrize("seed", range(5))
def test_white_noise_does_not_last(seed: int) -> None:
    """Exactly 1: logs of white noise are estimated as before."""
    t, caps = seen(0.0, 0.003, seed=seed)
    assert lasting(t, caps, noise_sd(t, caps)) == 1.0


@pytest.mark.parametrize("rho", [0.5, 0.7, 0.85])
def test_an_ar1_error_counts_as_the_white_noise_of_its_spectrum_at_rest(rho: float) -> None:
    """S(0) of an AR(1) process is sd^2 (1 + rho) / (1 - rho); lags that are left out make it a little less."""
    sd = 0.01
    found = []
    for seed in range(5):
        t, caps = seen(rho, sd, seed=seed)
        stated = noise_sd(t, caps)
        found.append(lasting(t, caps, stated) * float(np.sqrt(np.mean(stated**2))))
    wanted = sd * np.sqrt((1 + rho) / (1 - rho))
    assert 0.8 * wanted < np.median(found) < 1.15 * wanted


def test_the_mean_of_some_frames_is_as_sure_as_the_white_noise_says() -> None:
    """What smoothing makes of it: means over 2 s scatter as those of the white noise."""
    rho, sd, count = 0.7, 0.01, 60
    t, caps = seen(rho, sd, seconds=400.0)
    _, true = seen(rho, 0.0, seconds=400.0)
    white = lasting(t, caps, noise_sd(t, caps)) * np.sqrt(np.mean(noise_sd(t, caps) ** 2))
    error = (caps - true)[: len(t) // count * count].reshape(-1, count, 2 * RODS * 3).mean(axis=1)
    assert np.std(error) == pytest.approx(white / np.sqrt(count), rel=0.2)


def test_a_wrong_scale_and_exchanged_caps_are_no_noise_that_lasts() -> None:
    """A length that is wrong all the time, and one that is wrong for three frames."""
    t, caps = seen(0.0, 0.003)
    caps = 1.04 * caps
    caps[100:103, [0, 1]] = caps[100:103, [3, 2]]
    assert lasting(t, caps, noise_sd(t, caps)) == 1.0


def test_a_few_frames_say_nothing() -> None:
    """45 frames."""
    t, caps = seen(0.7, 0.01, seconds=1.5)
    assert lasting(t, caps, noise_sd(t, caps)) == 1.0
