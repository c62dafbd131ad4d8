"""The camera's clock and its scheduled faults."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.rig.camera.clock import Exposure, Shutter, within
from r2s2r_cli.rig.camera.settings import CameraSettings, Clock, Faults


def exposures(count: int, *, faults: Faults | None = None, seed: int = 0, **clock: float) -> list[Exposure]:
    """The first `count` exposures."""
    shutter = Shutter(CameraSettings(clock=Clock(**clock), faults=faults or Faults()), seed=seed)
    found = []
    for _ in range(count):
        found.append(shutter.next)
        shutter.advance()
    return found


def test_frames_come_at_the_rate_of_a_clock_that_drifts() -> None:
    """The stamps are 1/rate apart by the camera's own clock, which is too fast by its drift."""
    shots = exposures(1000, drift_ppm=500.0, origin_s=77.0)
    t, stamp = (np.array([getattr(shot, name) for shot in shots]) for name in ("t", "stamp"))
    slope, origin = np.polyfit(t, stamp, 1)
    assert slope - 1 == pytest.approx(500e-6, rel=1e-6) and origin == pytest.approx(77.0)
    assert (stamp[-1] - stamp[0]) / 999 == pytest.approx(1 / 30, rel=1e-4)
    assert [shot.number for shot in shots] == list(range(1000))


def test_the_stamp_tells_the_jitter() -> None:
    """Exposures stray by jitter_s from their schedule, never overtake each other, and the stamps say when they were."""
    shots = exposures(2000, jitter_s=0.002, drift_ppm=0.0, origin_s=0.0)
    t = np.array([shot.t for shot in shots])
    assert (t - np.arange(2000) / 30)[1:].std() == pytest.approx(0.002, rel=0.1)
    assert (np.diff(t) > 0).all()
    assert np.allclose(t, [shot.stamp for shot in shots])


def test_stamp_delay_shifts_the_stamps_alone() -> None:
    """A camera whose stamps are 50 ms late says so nowhere else."""
    plain, late = exposures(5), exposures(5, stamp_delay_s=0.05)
    assert [a.t for a in plain] == [b.t for b in late]
    assert np.array([b.stamp - a.stamp for a, b in zip(plain, late, strict=True)]) == pytest.approx(0.05, rel=1e-3)


def test_the_stated_share_is_lost() -> None:
    """One frame in ten never leaves the camera, the same ones for the same seed."""
    lost = [shot.lost for shot in exposures(3000, lost_share=0.1)]
    assert np.mean(lost) == pytest.approx(0.1, abs=0.02)
    assert lost == [shot.lost for shot in exposures(3000, lost_share=0.1)]
    assert lost != [shot.lost for shot in exposures(3000, lost_share=0.1, seed=1)]


def test_the_clock_jumps_once() -> None:
    """From its moment on every stamp is later by the jump."""
    shots = exposures(60, faults=Faults(clock_jump_at_s=0.99, clock_jump_s=5.0), jitter_s=0.0)
    steps = np.diff([shot.stamp for shot in shots])
    assert np.count_nonzero(steps > 1) == 1 and steps.max() == pytest.approx(5 + 1 / 30, abs=1e-3)
    assert shots[int(steps.argmax()) + 1].t == pytest.approx(1.0, abs=1e-3)


def test_faults_last_from_start_to_stop() -> None:
    """A fault without an end lasts for ever, one without a start never comes."""
    assert [within(t, 1.0, 2.0) for t in (0.9, 1.0, 1.9, 2.0)] == [False, True, True, False]
    assert within(1e9, 1.0, None) and not within(5.0, None, None)
