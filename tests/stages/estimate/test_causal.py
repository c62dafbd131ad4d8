"""What is known of caps at a frame: nothing later counts, where motors start it leans to no side, and it knows how
well it knows."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.causal import SPEED_M_PER_S, Known, known
from r2s2r_cli.stages.estimate.smooth import MISSING, smooth

DT, BEGIN, SPEED, NOISE = 0.1, 30, 0.06, 0.008


def started(seed: int, n: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Six caps at rest for 3 s, then moving along x at 60 mm/s: stamps, truth and what is seen, with noise of which 0.7
    lasts from frame to frame."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(n)
    truth = np.zeros((n, 6, 3)) + rng.uniform(-0.2, 0.2, (6, 3))
    truth[:, :, 0] += SPEED * np.maximum(t - t[BEGIN], 0.0)[:, None]
    noise = np.zeros(truth.shape)
    noise[0] = rng.standard_normal(truth.shape[1:])
    for k in range(1, n):
        noise[k] = 0.7 * noise[k - 1] + np.sqrt(1 - 0.49) * rng.standard_normal(truth.shape[1:])
    return t, truth, truth + NOISE * noise


def asked(t: np.ndarray, seen: np.ndarray, sd: float, changes: tuple[int, ...] = (BEGIN,)) -> Known:
    """All caps were seen, with this sd of every coordinate."""
    return known(
        t, seen, np.full(seen.shape[1:], sd), np.zeros(seen.shape[:2], dtype=int), np.array(changes, dtype=int)
    )


def test_where_motion_begins_it_leans_to_no_side_and_a_smoothed_pose_does() -> None:
    """Over 12 runs, at the frame at which motors start: the smoothed pose has moved on, this one has not."""
    ahead, smoothed = [], []
    for seed in range(12):
        t, truth, seen = started(seed)
        sd = NOISE * np.sqrt(1.7 / 0.3)  # white noise that says as little of a pose at rest
        own = asked(t, seen, sd)
        ahead.append((own.p_WE - truth)[BEGIN, :, 0].mean())
        smoothed.append((smooth(t, seen, np.full(seen.shape[1:], sd)).p_WE - truth)[BEGIN, :, 0].mean())
    unsure = np.std(ahead) / np.sqrt(len(ahead))
    assert abs(np.mean(ahead)) < 3 * unsure
    assert np.mean(smoothed) > 2e-3 + 3 * unsure


def test_the_sd_is_that_of_the_errors() -> None:
    """Of white noise, over all frames of 8 runs: within a third for the poses; the speeds' is no more than what speeds
    are to begin with."""
    pulls = []
    for seed in range(8):
        t, truth, _ = started(seed)
        seen = truth + 0.005 * np.random.default_rng(seed).standard_normal(truth.shape)
        own = asked(t, seen, 0.005)
        pulls.append(((own.p_WE - truth) / own.sd_p)[5:])
        assert (own.sd_v <= SPEED_M_PER_S).all()
    assert np.std(pulls) == pytest.approx(1.0, abs=0.33)


def test_later_frames_change_nothing_but_how_jerky_the_run_is_taken_to_be() -> None:
    """Other frames after one, of the same motion: what is known at it moves by far less than its sd."""
    t, truth, seen = started(3)
    other = seen.copy()
    other[BEGIN + 1 :] = started(4)[2][BEGIN + 1 :] + (truth[0] - started(4)[1][0])
    one, two = asked(t, seen, NOISE), asked(t, other, NOISE)
    moved = np.sqrt(np.mean((one.p_WE - two.p_WE) ** 2, axis=(1, 2)))
    assert moved[BEGIN] < 0.5 * one.sd_p[BEGIN].mean() < 0.5 * moved[-1]


def test_what_was_not_seen_is_not_known_better_for_it() -> None:
    """A cap that is hidden for five frames: its numbers there are not looked at, and its sd grows."""
    t, _, seen = started(5)
    quality = np.zeros(seen.shape[:2], dtype=int)
    quality[10:15, 2] = MISSING
    strange = seen.copy()
    strange[10:15, 2] = 9.0
    sd = np.full(seen.shape[1:], NOISE)
    found = known(t, strange, sd, quality, np.array([BEGIN]))
    assert np.abs(found.p_WE[14, 2] - seen[9, 2]).max() < 0.05
    assert (found.sd_p[14, 2] > found.sd_p[9, 2]).all()
    assert np.isfinite(found.v_WE).all()
