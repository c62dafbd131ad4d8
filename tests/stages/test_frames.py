"""Kept frames, noise, rod lengths, ground offset and jitter against planted truths and closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.stages.frames import (
    BACKWARDS,
    DUPLICATE,
    KEPT,
    NOT_FINITE,
    fit_rod_length,
    ground_offset,
    holes,
    in_order,
    keep_frames,
    noise_sd,
    stamp_jitter,
)
from schemas.recording import DROP_REASONS
from tests.support.import_samples import CAP_RADIUS_M, ROD_M, glide

SD = 0.002


def irregular(n: int, rng: np.random.Generator) -> np.ndarray:
    """Stamps with gaps between 30 and 160 ms, as a tracker on a loaded machine gives them."""
    return np.cumsum(rng.uniform(0.03, 0.16, n))


def noisy(p_WE: np.ndarray, rng: np.random.Generator, sd: float = SD) -> np.ndarray:
    """White noise on every coordinate."""
    return p_WE + rng.normal(0.0, sd, p_WE.shape)


def typical(sd: np.ndarray) -> float:
    """One figure for all caps and axes."""
    return float(np.sqrt((sd**2).mean()))


def test_a_burst_leaves_one_frame_every_20_ms() -> None:
    """Frames are compared with the last kept one, so a burst at 1 kHz keeps every twentieth and not only the first."""
    reason = keep_frames(np.arange(100) * 0.001)
    assert np.flatnonzero(reason == KEPT).tolist() == [0, 20, 40, 60, 80]
    assert (reason[reason != KEPT] == DUPLICATE).all()


def test_a_gap_written_as_20_ms_is_kept() -> None:
    """Stamps rounded to milliseconds are not lost to binary rounding: 20 ms is kept, 19 ms is not."""
    tenths = np.array([round(0.1 + 0.02 * i, 3) for i in range(50)])
    assert (keep_frames(tenths) == KEPT).all()
    assert keep_frames(np.array([0.0, 0.019, 0.020])).tolist() == [KEPT, DUPLICATE, KEPT]


def test_time_that_runs_backwards_is_left_out_until_it_catches_up() -> None:
    """A frame before the last kept one is marked 2, an equal stamp is a duplicate."""
    reason = keep_frames(np.array([0.0, 0.1, 0.05, 0.1, 0.2]))
    assert reason.tolist() == [KEPT, KEPT, BACKWARDS, DUPLICATE, KEPT]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_unobserved_frame_does_not_hide_the_next_one(bad: float) -> None:
    """A frame with a coordinate that is not finite is marked 3, and a good frame 5 ms later is kept."""
    p = np.zeros((3, 2, 3))
    p[1, 0, 2] = bad
    assert keep_frames(np.array([0.0, 0.1, 0.105]), p).tolist() == [KEPT, NOT_FINITE, KEPT]
    assert keep_frames(np.array([0.0, bad, 0.105])).tolist() == [KEPT, NOT_FINITE, KEPT]


def test_codes_are_those_of_the_schema() -> None:
    """Every code that is given has its meaning in the layout."""
    assert {KEPT, DUPLICATE, BACKWARDS, NOT_FINITE} == set(DROP_REASONS)


def test_streams_keep_what_rises_in_time() -> None:
    """Dropped frames stay in the streams where they fit between their neighbours, so that stamps rise strictly."""
    t = np.array([0.0, 0.01, 0.005, 0.1, 0.1, np.nan, 0.05, 0.15, 0.2])
    reason = keep_frames(t)
    rows = in_order(t, reason)
    assert rows[reason == KEPT].all()
    assert np.flatnonzero(rows).tolist() == [0, 1, 3, 7, 8]
    assert (np.diff(t[rows]) > 0).all()


@pytest.mark.parametrize("turn", [0.0, 0.4], ids=["straight", "gently curved"])
def test_planted_noise_is_recovered(turn: float) -> None:
    """White noise is found within 3 % over all coordinates and 12 % in each, on straight and gently curved motion."""
    rng = np.random.default_rng(1)
    t = irregular(3000, rng)
    sd = noise_sd(t, noisy(glide(t, turn_rad_per_s=turn), rng))
    assert typical(sd) == pytest.approx(SD, rel=0.03)
    assert sd == pytest.approx(np.full((6, 3), SD), rel=0.12)


def test_noise_is_told_apart_by_cap_and_axis() -> None:
    """Different noise on every coordinate comes back in its place."""
    rng = np.random.default_rng(2)
    t = irregular(3000, rng)
    truth = 0.001 * (1 + np.arange(18).reshape(6, 3) % 4)
    sd = noise_sd(t, glide(t) + truth * rng.normal(size=(len(t), 6, 3)))
    assert sd == pytest.approx(truth, rel=0.12)


def test_noise_does_not_depend_on_the_stamps() -> None:
    """The degrees of freedom of a line are the same for regular, jittered and clustered stamps."""
    rng = np.random.default_rng(3)
    clustered = np.sort(np.concatenate([np.arange(1500) * 0.2, np.arange(1500) * 0.2 + 0.021]))
    for t in (np.arange(3000) * 0.1, irregular(3000, rng), clustered):
        assert typical(noise_sd(t, noisy(glide(t), rng))) == pytest.approx(SD, rel=0.03)


def test_noise_is_robust_to_jumps_and_tip_overs() -> None:
    """30 mm jumps in a quarter of the windows move the result by less than 4 %, and the plain mean by over 100 %."""
    rng = np.random.default_rng(4)
    t = irregular(4000, rng)
    p = noisy(glide(t), rng)
    for start in rng.choice(len(t), size=len(t) // 20, replace=False):
        p[start:] += rng.normal(0.0, 0.03, 3)
    assert typical(noise_sd(t, p)) == pytest.approx(SD, rel=0.04)
    windows = np.lib.stride_tricks.sliding_window_view(p, 5, axis=0)
    assert np.sqrt(windows.var(axis=-1).mean()) > 2 * SD


def test_noise_scales_with_the_data() -> None:
    """Ten times the coordinates have ten times the noise; a shift and a constant velocity change nothing."""
    rng = np.random.default_rng(5)
    t = irregular(200, rng)
    p = noisy(glide(t), rng)
    sd = noise_sd(t, p)
    assert noise_sd(t, 10 * p) == pytest.approx(10 * sd, rel=1e-6)
    assert noise_sd(t, p + 3.0 + 0.7 * t[:, None, None]) == pytest.approx(sd, rel=1e-5)


def test_noise_of_a_perfect_line_is_zero_and_of_too_few_frames_unknown() -> None:
    """A noise-free line leaves rounding only; four frames leave no figure."""
    t = np.arange(50) * 0.1
    assert noise_sd(t, glide(t)).max() < 1e-9
    assert np.isnan(noise_sd(t[:4], glide(t[:4]))).all()
    assert (noise_sd(t, np.zeros((50, 6, 3))) == 0).all()


def test_rod_length_is_the_planted_one_despite_lost_caps() -> None:
    """The median length is right to 0.1 mm with 4 % of the frames 0.2 m off, and the deviation shows them."""
    rng = np.random.default_rng(6)
    t = np.arange(500) * 0.1
    p = noisy(glide(t), rng, 0.001)
    clean_sd = fit_rod_length(p)[1]
    p[::25, 0, 2] += 0.2
    length, sd = fit_rod_length(p)
    assert length == pytest.approx(np.full(3, ROD_M), abs=2e-4)
    # Noise of both caps along the rod: sqrt(2) sd.
    assert clean_sd == pytest.approx(np.full(3, np.sqrt(2) * 0.001), rel=0.12)
    assert sd[0] > 0.01 > sd[1]


@pytest.mark.parametrize("height", [-0.004, 0.0, 0.03])
def test_ground_offset_is_the_planted_one(height: float) -> None:
    """A robot that stands on a plane at z = h needs -h added, with one radius or one a cap."""
    p = glide(np.arange(20) * 0.1, height_m=height)
    assert ground_offset(p, CAP_RADIUS_M) == pytest.approx(-height, abs=1e-12)
    radius = np.full(6, CAP_RADIUS_M)
    radius[1::2] += 0.001
    assert ground_offset(p, radius) == pytest.approx(-height, abs=1e-12)


def test_jitter_is_that_of_the_planted_gaps() -> None:
    """Gaps of 0.1 s +- 0.05 s (uniform) deviate by 0.05 / sqrt(3); regular stamps by nothing."""
    rng = np.random.default_rng(7)
    t = np.cumsum(0.1 + rng.uniform(-0.05, 0.05, 5000))
    assert stamp_jitter(t) == pytest.approx(0.05 / np.sqrt(3), rel=0.03)
    assert stamp_jitter(np.arange(10) * 0.25) == 0
    assert np.isnan(stamp_jitter(np.array([0.0, 1.0])))


def test_holes_are_found_longest_first() -> None:
    """Gaps above five median gaps are reported with their place; ordinary jitter is not."""
    t = np.cumsum([0.1] * 20 + [0.8] + [0.1] * 20 + [2.0] + [0.3])
    assert holes(t) == [pytest.approx((4.8, 2.0)), pytest.approx((2.0, 0.8))]
    assert holes(np.array([0.0, 5.0])) == []


def test_real_crawl_has_the_figures_of_its_readme(real_dir: Path) -> None:
    """71 of 202 frames are duplicates, noise lies at 1-4 mm, the ground about 4 mm off, jitter at some 50 ms."""
    table = np.loadtxt(real_dir / "tribar_crawl" / "crawl.csv", delimiter=",", skiprows=1)
    t, p = table[:, 0], table[:, 1:19].reshape(-1, 6, 3)
    kept = keep_frames(t, p) == KEPT
    assert (len(t), int((~kept).sum())) == (202, 71)
    sd = np.sort(noise_sd(t[kept], p[kept]).ravel())
    # One coordinate (cap 5, z) was held on the ground by the source's tracker.
    assert sd[0] < 0.0002
    assert 0.0008 < sd[1] < sd[-1] < 0.004
    assert ground_offset(p[kept], CAP_RADIUS_M) == pytest.approx(0.004, abs=0.0005)
    assert stamp_jitter(t[kept]) == pytest.approx(0.05, abs=0.015)
    assert fit_rod_length(p[kept])[0] == pytest.approx(np.full(3, 0.325), abs=1e-4)
