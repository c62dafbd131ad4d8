"""What makes residuals white: against the covariance itself, written out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.links import Way
from r2s2r_cli.stages.diagnose.which.mixture import FACTORS
from r2s2r_cli.stages.diagnose.which.white import OFFSET_SHARE, White, whitened, whites

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
    (white,) = whites([one], [by], [None], sensors=SENSORS, floor_m=FLOOR_M, noise=NOISE, lasts=request.param)
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


LINKED_SD, LASTS_S = np.array([3e-3, 3e-3, 3e-3, 0.02, 0.02, 0.08] + 3 * [0.02] + 2 * [0.1] + [0.1]), 0.7


def test_a_piece_begins_where_the_one_before_it_ended() -> None:
    """Squares and determinant of a linked piece are those of its residuals given those of the piece before: both are
    parts of one normal vector, in which the start of the second is the end of the first."""
    rng = np.random.default_rng(5)
    n, channels = len(LINKED_SD), 3 * CAPS + SENSORS
    first, second = stretch(rng), stretch(rng)
    by = [3e-3 * rng.standard_normal((n, channels, FRAMES)) for _ in range(2)]
    through, rough = 0.5 * rng.standard_normal((n, n)), 0.2 * rng.standard_normal((2, n))
    way = Way(0, through, rough, by[1], LINKED_SD, LASTS_S, rods=1)
    white = whites([first, second], by, [None, way], sensors=SENSORS, floor_m=FLOOR_M, noise=NOISE, lasts=0.0)
    none = np.zeros((OFFSETS, channels, FRAMES))
    S1, S2 = covariance(first, none, 1.0, 0.0), covariance(second, none, 1.0, 0.0)
    B1, B2 = (one.reshape(n, -1) for one in by)
    ends = through @ through.T + rough.T @ rough + np.diag((way.errs(FLOOR_M) / LINKED_SD) ** 2)
    # What a simulation from the seen start leaves: r1 = e1 - B1 s1 and r2 = e2 - B2 s2, where s2 = ahead + F s1.
    both = np.block([[S1 + B1.T @ B1, B1.T @ through.T @ B2], [B2.T @ through @ B1, S2 + B2.T @ ends @ B2]])
    m = S1.shape[0]
    gain = both[m:, :m] @ np.linalg.inv(both[:m, :m])
    S = both[m:, m:] - gain @ both[:m, m:]
    r1, r2 = (4e-3 * rng.standard_normal((3, channels, FRAMES)) for _ in range(2))
    ahead = rng.standard_normal((3, n))
    raw = [np.concatenate([r.reshape(3, -1), more], axis=1) for r, more in ((r1, 0 * ahead), (r2, ahead))]
    left = r2.reshape(3, -1) + ahead @ B2 - r1.reshape(3, -1) @ gain.T
    kind = white[1].kinds[0]
    found = np.sum(whitened(white, raw)[:, kind.rows] ** 2, axis=1)
    assert found == pytest.approx(np.einsum("ki,ij,kj->k", left, np.linalg.inv(S), left), rel=1e-5)
    assert kind.logdet == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-8)
    alone = white[1].kinds[1]
    seen = np.sum(whitened(white, raw)[:, alone.rows] ** 2, axis=1)
    flat = r2.reshape(3, -1)
    assert seen == pytest.approx(np.einsum("ki,ij,kj->k", flat, np.linalg.inv(S2 + B2.T @ B2), flat), rel=1e-5)
