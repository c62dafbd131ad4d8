"""What makes residuals white: against the covariance itself, written out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.mixture import FACTORS
from r2s2r_cli.stages.diagnose.which.white import OFFSET_SHARE, White, whites

FRAMES, CAPS, SENSORS, OFFSETS = 9, 2, 1, 4
FLOOR_M, NOISE = 3e-3, 1.4


def stretch(rng: np.random.Generator) -> Any:
    """One whose second sensor reading is missing."""
    t = 0.4 + np.cumsum(rng.uniform(0.05, 0.15, FRAMES))
    length = np.full((FRAMES, SENSORS), 0.2)
    length[1] = np.nan
    noise = rng.uniform(2e-3, 5e-3, (CAPS, 3))
    return SimpleNamespace(
        t=t, window=SimpleNamespace(start=0.4), noise=np.repeat(noise[None] / 2.0, FRAMES, axis=0), frame_noise=noise,
        length=length, length_sd=np.full((FRAMES, SENSORS), 2e-3),
    )  # fmt: skip


def covariance(one: Any, by: np.ndarray, factor: float, lasts: float) -> np.ndarray:
    """(channel F, channel F): floor, tracker's offset, errors that last, and starts of sd 1."""
    since = one.t - one.window.start
    walk = np.minimum.outer(since, since) * (factor * FLOOR_M) ** 2 / 3.0
    apart = np.abs(np.subtract.outer(one.t, one.t))
    alike = np.exp(-apart / lasts) if lasts else np.eye(FRAMES)
    found = np.zeros((3 * CAPS + SENSORS, FRAMES, 3 * CAPS + SENSORS, FRAMES))
    for c in range(3 * CAPS):
        sd, frame = NOISE * one.noise.reshape(FRAMES, -1)[0, c], NOISE * one.frame_noise.ravel()[c]
        found[c, :, c] = walk + sd**2 * alike + (OFFSET_SHARE * frame) ** 2
    for c in range(3 * CAPS, 3 * CAPS + SENSORS):
        found[c, :, c] = walk + np.diag(np.where(np.isfinite(one.length[:, 0]), 2e-3, 1e3) ** 2)
    size = len(by.reshape(OFFSETS, -1).T)
    return found.reshape(size, size) + by.reshape(OFFSETS, -1).T @ by.reshape(OFFSETS, -1)


@pytest.fixture(params=[0.0, 0.2], ids=["white", "lasting"])
def both(request: pytest.FixtureRequest) -> tuple[White, Any, np.ndarray, float]:
    """A stretch's `White`, the stretch, what its offsets change, and how long errors last."""
    rng = np.random.default_rng(1)
    one = stretch(rng)
    by = 4e-3 * rng.standard_normal((OFFSETS, 3 * CAPS + SENSORS, FRAMES))
    by[-1] = 0.0  # an offset that changes nothing
    (white,) = whites([one], [by], sensors=SENSORS, floor_m=FLOOR_M, noise=NOISE, lasts=request.param)
    return white, one, by, request.param


@pytest.mark.parametrize("kind", range(len(FACTORS)))
def test_squares_and_determinant_are_those_of_the_covariance(both: Any, kind: int) -> None:
    """r' S^-1 r of any residuals, and log |S|, of every kind of error."""
    white, one, by, lasts = both
    S = covariance(one, by, FACTORS[kind], lasts)
    residual = 5e-3 * np.random.default_rng(2).standard_normal((3, *by.shape[1:]))
    found = np.sum(white.kinds[kind].white(residual) ** 2, axis=1)
    flat = residual.reshape(3, -1)
    assert found == pytest.approx(np.einsum("ki,ij,kj->k", flat, np.linalg.inv(S), flat), rel=1e-5)
    assert white.kinds[kind].logdet == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-8)
    assert white.size == 3 * CAPS * FRAMES + SENSORS * FRAMES - 1


def test_the_likely_start_is_the_posterior_mean(both: Any) -> None:
    """Offsets of sd 1 that left these residuals: B S^-1 r with the sign that takes them off."""
    white, one, by, lasts = both
    residual = 5e-3 * np.random.default_rng(3).standard_normal((1, *by.shape[1:]))
    wanted = -by.reshape(OFFSETS, -1) @ np.linalg.solve(covariance(one, by, 1.0, lasts), residual.ravel())
    kind = white.kinds[0]
    assert kind.start(kind.rooted(residual)[0]) == pytest.approx(wanted, abs=1e-6)


def test_what_is_known_of_the_start_is_its_posterior(both: Any) -> None:
    """Covariance of the offsets once the residuals are seen: 1 - B S^-1 B', never more than before."""
    white, one, by, lasts = both
    B = by.reshape(OFFSETS, -1)
    root = white.kinds[0].known
    assert root @ root.T == pytest.approx(
        np.eye(OFFSETS) - B @ np.linalg.solve(covariance(one, by, 1.0, lasts), B.T), abs=1e-6
    )
    assert root[-1, -1] == pytest.approx(1.0, abs=1e-6)
