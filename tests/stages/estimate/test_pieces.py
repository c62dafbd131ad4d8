"""Long runs in pieces: nothing is lost or doubled where they meet, and it makes no difference that matters."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings, SensorClock, Sighted, TrackedRun
from r2s2r_cli.stages.estimate.motion.smooth_run import smooth_run
from r2s2r_cli.stages.estimate.pieces import smooth_pieces
from tests.stages.estimate.builders import threebar

ROBOT, SETTINGS = threebar(), MotionSettings()
N = 100


def sightings(n: int = N) -> Sighted:
    """Every number tells its frame."""
    p_WE = np.arange(n)[:, None, None] * np.ones((n, 6, 3))
    return Sighted(np.arange(n) / 30, p_WE, np.broadcast_to(np.eye(3), (n, 6, 3, 3)).copy())


def readings(n: int = N) -> Readings:
    """Three samples a frame."""
    t = np.arange(3 * n) / 90
    return Readings(t, np.ones((len(t), 9)), np.arange(9))


class Pretended:
    """A smoother that hands back what it was given, and remembers it."""

    def __init__(self, delays: tuple[float | None, ...] = (0.02,)) -> None:
        self.seen: list[tuple[Sighted, Readings | None, np.ndarray]] = []
        self._delays = delays

    def __call__(self, sighted: Sighted, heard: Readings | None, *_: Any, switches: np.ndarray) -> TrackedRun:
        """A tracked run whose numbers tell the frame, as in the sightings."""
        delay = self._delays[len(self.seen) % len(self._delays)]
        self.seen.append((sighted, heard, switches))
        n, frame = len(sighted.t), np.nan_to_num(sighted.p_WE)
        one, cov = frame[:, :, 0], frame[..., None] * np.ones(3)
        nine = frame[:, :1, 0] * np.ones(9)
        return TrackedRun(
            t=sighted.t, p_WE=frame, cov_p=cov, v_WE=frame, cov_v=cov, length=nine, length_sd=nine, sensor_bias=nine,
            sensor_bias_sd=nine, sensor_noise_sd=np.full(9, float(n)), sensor_dead=np.arange(9) == 0,
            clock=SensorClock(delay or 0.0, 0.001, delay is not None), ground=np.zeros(3), ground_sd=np.ones(3),
            contact=one > 0, contact_probability=one, quality=one.astype(np.uint8), mode=one[:, 0].astype(np.uint8),
            score=one, noise_scale=np.ones(2), acceleration=one[:-1], rounds=1, settled=True,
        )  # fmt: skip


def joined(smooth: Pretended, sighted: Sighted, **more: Any) -> TrackedRun:
    """Pieces of 20 frames with overlaps of 5."""
    switches = more.pop("switches", np.array([3, 30, 61]))
    return smooth_pieces(sighted, readings(), ROBOT, SETTINGS, switches=switches, piece=20, overlap=5, smooth=smooth,
                         **more)  # fmt: skip


def test_every_frame_comes_once_and_in_order() -> None:
    """All rows and gaps of the run, from the middle of the overlaps."""
    smooth, sighted = Pretended(), sightings()
    run = joined(smooth, sighted)
    for values in (run.p_WE[:, 0, 0], run.cov_p[:, 0, 0, 0], run.length[:, 0], run.score[:, 0], run.mode):
        assert values.tolist() == list(range(N))
    assert run.acceleration[:, 0].tolist() == list(range(N - 1))
    assert max(len(cut.t) for cut, _, _ in smooth.seen) == 30
    assert run.sensor_dead.tolist() == [True, *[False] * 8]


def test_pieces_get_their_own_switches_and_readings() -> None:
    """Switches count from the piece's first frame; readings lie within a second of it."""
    smooth = Pretended()
    joined(smooth, sightings())
    found = [(round(30 * cut.t[0]) + inside).tolist() for cut, _, inside in smooth.seen]
    assert sorted({k for piece in found for k in piece}) == [3, 30, 61]
    for cut, heard, _ in smooth.seen:
        assert heard is not None
        assert heard.t.min() >= cut.t[0] - 1.0 and heard.t.max() <= cut.t[-1] + 1.0


def test_a_piece_without_one_of_the_caps_reaches_farther() -> None:
    """Cap 2 is hidden from frame 18 to 70: the pieces in between go on until they have seen it."""
    sighted = sightings()
    sighted.p_WE[18:70, 2] = np.nan
    smooth = Pretended()
    joined(smooth, sighted)
    assert all(np.isfinite(cut.p_WE[:, :, 0]).any(axis=0).all() for cut, _, _ in smooth.seen)


def test_clock_of_the_run_is_the_mean_of_pieces_that_know_it() -> None:
    """A piece at rest knows none."""
    run = joined(Pretended((0.02, None, 0.04, 0.04, 0.02)), sightings())
    assert run.clock.delay_s == pytest.approx(0.03)
    assert run.clock.sd_s == pytest.approx(0.001 / 2)
    assert not joined(Pretended((None,)), sightings()).clock.known


def test_a_short_run_is_one_piece() -> None:
    """Nothing is cut where memory is no concern."""
    smooth = Pretended()
    done: list[tuple[int, int]] = []
    joined(smooth, sightings(30), show=lambda k, n: done.append((k, n)))
    assert len(smooth.seen) == 1
    assert done == [(0, 1), (1, 1)]


@pytest.mark.slow
def test_pieces_differ_from_the_whole_by_less_than_they_are_sure() -> None:
    """A run of the rig's plant: within a standard deviation, at the seams as well."""
    from tests.support import camera_motion

    motion = camera_motion.motion(seed=100, seconds=9.0)
    rng = np.random.default_rng(100)
    sighted = camera_motion.sighted(motion, rng)
    heard, _ = camera_motion.readings(motion, rng)
    whole = smooth_run(sighted, heard, motion.robot, SETTINGS, switches=np.zeros(0, dtype=int))
    parts = smooth_pieces(sighted, heard, motion.robot, SETTINGS, switches=np.zeros(0, dtype=int), piece=90, overlap=60)
    sd = np.sqrt(np.diagonal(whole.cov_p, axis1=2, axis2=3))
    off = np.abs(parts.p_WE - whole.p_WE) / sd
    assert np.mean(off < 1.0) > 0.95
    assert off[80:100].mean() < 1.0
