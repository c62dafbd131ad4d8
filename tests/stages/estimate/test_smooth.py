"""Tracks: honest covariance, symmetries, and what the tracker's faults become."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate.kalman import Smoothed
from r2s2r_cli.stages.estimate.run import observations
from r2s2r_cli.stages.estimate.smooth import (
    JUMP,
    MISSING,
    OBSERVED,
    OUTLIER,
    Tracks,
    _breaks,
    chi2_quantile,
    smooth,
    whiteness,
)
from r2s2r_cli.stages.frames import noise_sd
from tests.stages.estimate.builders import real_crawl
from tests.stages.estimate.dense import compare
from tests.stages.estimate.planted import CALIBRATION_SEEDS, JUDGING_SEEDS, Planted, planted

LIMIT = chi2_quantile(0.95)


def inside(error: np.ndarray, cov: np.ndarray) -> float:
    """Share of errors (frame, cap, 3) inside their 95 % ellipsoid."""
    return float(np.mean(np.einsum("tci,tcij,tcj->tc", error, np.linalg.inv(cov), error) < LIMIT))


@cache
def clean_run(seed: int) -> tuple[Planted, Tracks]:
    """A planted run without any fault, and its tracks: what a fault is compared with. Nobody changes either."""
    sample = planted(seed)
    return sample, smooth(sample.t, sample.observed, sample.noise_sd)


def switches(first: np.ndarray) -> np.ndarray:
    """Gaps to both sides of the first frame of every interval but the first."""
    return np.concatenate([first[1:] - 1, first[1:]])


def test_seeds_of_calibration_and_judging_differ() -> None:
    """No constant was chosen on a run that judges it."""
    assert not set(CALIBRATION_SEEDS) & set(JUDGING_SEEDS)


def test_covariance_is_honest_on_judging_seeds() -> None:
    """95 % ellipsoids of positions and velocities hold 92 to 98 % of the true errors, noise measured from the run."""
    position, velocity = [], []
    for seed in JUDGING_SEEDS:
        sample = planted(seed)
        tracks = smooth(sample.t, sample.observed, noise_sd(sample.t, sample.observed), changes=switches(sample.first))
        position.append(inside(tracks.p_WE - sample.p_WE, tracks.cov_p))
        velocity.append(inside(tracks.v_WE - sample.v_WE, tracks.cov_v))
    assert 0.92 < np.mean(position) < 0.98
    assert 0.92 < np.mean(velocity) < 0.98


def test_covariance_is_exact_where_the_model_is() -> None:
    """Tracks drawn from the model itself, noise known: 95 % ellipsoids hold 95 % (burst factor included)."""
    rng = np.random.default_rng(7)
    shares = []
    for _ in range(6):
        t = np.cumsum(rng.uniform(0.05, 0.15, 150))
        dt = np.diff(t)
        v = np.concatenate(
            [np.zeros((1, 6, 3)), np.cumsum(np.sqrt(0.01 * dt)[:, None, None] * rng.normal(size=(149, 6, 3)), axis=0)]
        )
        p = np.concatenate([np.zeros((1, 6, 3)), np.cumsum(0.5 * dt[:, None, None] * (v[1:] + v[:-1]), axis=0)])
        sd = np.full((6, 3), 0.002)
        tracks = smooth(t, p + sd * rng.normal(size=p.shape), sd)
        shares.append(inside(tracks.p_WE - p, tracks.cov_p))
        assert np.all(tracks.density > 0.01 / 2) and np.all(tracks.density < 0.01 * 8)
    assert 0.94 < np.mean(shares) < 0.98


def test_smoothing_helps() -> None:
    """Smoothed positions are nearer the truth than the observations, by more than a third."""
    sample = planted(JUDGING_SEEDS[0])
    tracks = smooth(sample.t, sample.observed, sample.noise_sd)
    before = np.sqrt(np.mean((sample.observed - sample.p_WE) ** 2))
    after = np.sqrt(np.mean((tracks.p_WE - sample.p_WE) ** 2))
    assert after < 0.65 * before


def test_world_axes_do_not_matter() -> None:
    """Turning and moving the world turns and moves the result, for noise that is alike in all directions."""
    sample = planted(JUDGING_SEEDS[1])
    sd = np.full((6, 3), 0.003)
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    turn = turn @ np.array([[1, 0, 0], [0, np.cos(0.4), -np.sin(0.4)], [0, np.sin(0.4), np.cos(0.4)]])
    plain = smooth(sample.t, sample.observed, sd, changes=switches(sample.first))
    moved = smooth(sample.t, sample.observed @ turn.T + [1.0, -2.0, 0.5], sd, changes=switches(sample.first))
    assert moved.p_WE == pytest.approx(plain.p_WE @ turn.T + [1.0, -2.0, 0.5], abs=1e-8)
    assert moved.v_WE == pytest.approx(plain.v_WE @ turn.T, abs=1e-7)
    assert np.array_equal(moved.quality, plain.quality)


def test_time_can_run_backwards() -> None:
    """Reversed in time, positions stay and velocities change sign."""
    sample = planted(JUDGING_SEEDS[2])
    plain = smooth(sample.t, sample.observed, sample.noise_sd, changes=switches(sample.first))
    n = len(sample.t)
    back = smooth(
        sample.t[-1] - sample.t[::-1], sample.observed[::-1], sample.noise_sd, changes=n - 2 - switches(sample.first)
    )
    assert back.p_WE[::-1] == pytest.approx(plain.p_WE, abs=1e-6)
    assert -back.v_WE[::-1] == pytest.approx(plain.v_WE, abs=1e-5)


def test_an_isolated_outlier_is_marked_and_not_used() -> None:
    """One frame 5 cm off is flagged, at that cap and frame only, and hardly moves the track."""
    sample, clean = clean_run(JUDGING_SEEDS[3])
    broken = sample.observed.copy()
    broken[60, 3] += [0.05, 0.0, 0.0]
    tracks = smooth(sample.t, broken, sample.noise_sd)
    assert tracks.quality[60, 3] == OUTLIER
    assert np.sum(tracks.quality != clean.quality) == 1
    assert np.max(np.abs(tracks.p_WE - clean.p_WE)) < 0.004
    assert np.isnan(tracks.score[60, 3])


def test_a_jump_is_marked_and_not_smoothed_over() -> None:
    """A track that jumps by 6 cm and stays there: marked at the first frame after, positions follow on both sides."""
    sample, clean = clean_run(JUDGING_SEEDS[4])
    broken = sample.observed.copy()
    broken[70:, 1] += [0.0, 0.06, 0.0]
    tracks = smooth(sample.t, broken, sample.noise_sd)
    assert tracks.quality[70, 1] == JUMP
    assert np.sum(tracks.quality != clean.quality) == 1
    moved = clean.p_WE.copy()
    moved[70:, 1] += [0.0, 0.06, 0.0]
    assert np.max(np.abs(tracks.p_WE - moved)) < 0.006
    assert np.max(np.abs(tracks.v_WE - clean.v_WE)) < 0.08


def test_clean_runs_are_not_called_broken() -> None:
    """False alarms on planted runs without any fault: fewer than one in 500 frames and caps."""
    flagged, total = 0, 0
    for seed in JUDGING_SEEDS[:5]:
        sample = planted(seed)
        tracks = smooth(sample.t, sample.observed, sample.noise_sd, changes=switches(sample.first))
        flagged += int(np.sum(tracks.quality != OBSERVED))
        total += tracks.quality.size
    assert flagged < total / 500


def test_unobserved_frames_are_predicted_with_a_wider_covariance() -> None:
    """A cap that is hidden for three frames gets states there, marked, with more than the usual uncertainty."""
    sample = planted(JUDGING_SEEDS[5])
    hidden = sample.observed.copy()
    hidden[80:83, 2] = np.nan
    tracks = smooth(sample.t, hidden, sample.noise_sd)
    assert np.all(tracks.quality[80:83, 2] == MISSING)
    sd = np.sqrt(tracks.cov_p[:, 2, 0, 0])
    assert sd[81] > 1.3 * np.median(sd)
    assert np.linalg.norm(tracks.p_WE[81, 2] - sample.p_WE[81, 2]) < 0.02


def test_white_acceleration_predicts_as_well_as_white_jerk_and_is_more_honest() -> None:
    """The choice of model: the same held-out likelihood to 0.02 nats, ellipsoids that hold more of the truth."""
    gain, honest = [], []
    for seed in JUDGING_SEEDS[:2]:
        sample = planted(seed)
        kick = np.zeros(len(sample.t) - 1)
        kick[switches(sample.first)] = 0.02**2
        none = np.zeros((len(sample.t), 6), dtype=np.uint8)
        two, three = (compare(sample.t, sample.observed, sample.noise_sd, kick, none, order) for order in (2, 3))
        gain.append(two.held_out - three.held_out)
        share = [inside(c.velocity - sample.v_WE, c.velocity_var[..., None] * np.eye(3)) for c in (two, three)]
        honest.append(share[0] - share[1])
    assert abs(np.mean(gain)) < 0.02
    assert np.mean(honest) > 0.1


def test_real_crawl_is_explained_by_white_acceleration(real_dir: Path) -> None:
    """On the real crawl the innovations are nearly white and no larger than the measured noise says."""
    streams = dict(real_crawl(real_dir).streams("crawl"))
    _, t, p_WE = observations("crawl", streams)
    sd = np.maximum(noise_sd(t, p_WE), 4e-4)
    tracks = smooth(t, p_WE, sd)
    variance, lag1, _ = whiteness(tracks.innovation)
    assert np.all((variance > 0.6) & (variance < 1.3))
    assert np.max(np.abs(lag1)) < 0.25


def test_whiteness_tells_white_from_coloured() -> None:
    """Independent numbers have lag-1 correlation 0, a moving average of two has 1/2."""
    z = np.random.default_rng(3).standard_normal((2000, 2, 3))
    z[1:, 1] = (z[1:, 1] + z[:-1, 1]) / np.sqrt(2)
    variance, lag1, white = whiteness(z)
    assert variance == pytest.approx(1.0, abs=0.05)
    assert lag1 == pytest.approx([0.0, 0.5], abs=0.03)
    assert white.tolist() == [True, False]


@pytest.mark.parametrize(("probability", "value"), [(0.5, 2.36597), (0.95, 7.81473), (0.999, 16.2662)])
def test_chi2_quantiles(probability: float, value: float) -> None:
    """Quantiles of chi-square with three degrees of freedom, from the printed table."""
    assert chi2_quantile(probability) == pytest.approx(value, rel=1e-5)


def test_too_few_frames_and_backward_stamps_are_refused() -> None:
    """Fewer than five frames of a cap, or stamps that do not increase, are numerical errors that name the place."""
    sample = planted(0)
    with pytest.raises(NumericalError, match="too few frames"):
        smooth(sample.t[:4], sample.observed[:4], sample.noise_sd)
    with pytest.raises(NumericalError, match="do not increase"):
        smooth(sample.t[::-1], sample.observed, sample.noise_sd)


def test_wild_data_are_refused() -> None:
    """A track that no process noise explains (positions in micrometres taken for metres) is an error, not a number."""
    rng = np.random.default_rng(0)
    with pytest.raises(NumericalError, match="wildly"):
        smooth(np.arange(30) * 0.1, 1e4 * rng.standard_normal((30, 6, 3)), np.full((6, 3), 0.002))


@pytest.mark.parametrize("size", [0.5, *(pytest.param(size, marks=pytest.mark.slow) for size in (1.0, 5.0)), 100.0])
@pytest.mark.parametrize("frame", [0, 60, -1])
def test_an_outlier_of_any_size_is_marked(size: float, frame: int) -> None:
    """One cap in one frame, half a metre or a hundred off: marked there and nowhere else, process noise as without."""
    sample, clean = clean_run(JUDGING_SEEDS[3])
    broken = sample.observed.copy()
    broken[frame, 3] += [size, 0.0, 0.0]
    tracks = smooth(sample.t, broken, sample.noise_sd)
    assert tracks.quality[frame, 3] == OUTLIER
    assert np.sum(tracks.quality != clean.quality) == 1
    assert np.abs(np.log10(tracks.density / clean.density)) == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("size", [0.5, pytest.param(3.0, marks=pytest.mark.slow), 100.0])
def test_a_jump_of_the_whole_robot_is_marked(size: float) -> None:
    """A tracker that finds all caps elsewhere from one frame on: six jumps, states that follow on both sides."""
    sample, clean = clean_run(JUDGING_SEEDS[3])
    broken = sample.observed.copy()
    broken[70:] += [size, 0.0, 0.0]
    tracks = smooth(sample.t, broken, sample.noise_sd)
    assert np.all(tracks.quality[70] == JUMP)
    assert np.sum(tracks.quality != clean.quality) == 6
    moved = clean.p_WE + np.where(np.arange(len(sample.t)) < 70, 0.0, size)[:, None, None] * np.array([1.0, 0.0, 0.0])
    assert np.max(np.abs(tracks.p_WE - moved)) < 0.006


def test_the_size_of_a_jump_is_free() -> None:
    """Closed form: a resting cap that is found 1 m away is at rest before and after, at both places, to 0.02 mm.

    A jump of variance J^2 ties the two places by s^2 / (n J^2) of the way: 1e-7 m here; with J = 10 mm, 1 mm.
    """
    t = np.arange(40) * 0.1
    p = np.zeros((40, 1, 3))
    p[20:, 0, 0] = 1.0
    tracks = smooth(t, p, np.full((1, 3), 0.002))
    assert tracks.quality[:, 0].tolist() == [OBSERVED] * 20 + [JUMP] + [OBSERVED] * 19
    assert tracks.p_WE == pytest.approx(p, abs=2e-5)
    assert tracks.v_WE == pytest.approx(0.0, abs=2e-5)


@pytest.mark.parametrize("seed", JUDGING_SEEDS[:4])
@pytest.mark.parametrize("frame", [0, -1])
def test_a_fault_at_an_end_is_an_outlier(seed: int, frame: int) -> None:
    """First or last frame off: outlier or jump cannot be told apart, and the one that claims less is marked."""
    sample, clean = clean_run(seed)
    broken = sample.observed.copy()
    broken[frame, 2] += [0.0, 0.05, 0.0]
    tracks = smooth(sample.t, broken, sample.noise_sd)
    assert tracks.quality[frame, 2] == OUTLIER
    assert not np.any((tracks.quality == JUMP) & (clean.quality != JUMP))


@pytest.mark.parametrize(("outlier", "jump"), [(0, 1), (-1, -1)])
def test_a_jump_score_at_an_end_does_not_count(outlier: int, jump: int) -> None:
    """Scores that tie, or differ by rounding only, at the ends give one outlier and no jump."""
    scores = np.zeros((2, 30, 3))
    scores[0, outlier], scores[1, jump] = 5.0, 5.0 * (1 + 1e-6)
    unused = np.zeros((30, 3, 2))
    state = Smoothed(unused, unused[..., None], scores[0], scores[1])
    found = _breaks(state, np.zeros((30, 1), dtype=np.uint8), limit=20.0)
    assert found[outlier, 0] == OUTLIER
    assert np.sum(found != 0) == 1
