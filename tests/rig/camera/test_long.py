"""Three minutes of camera: nothing grows, nothing drifts but the clock that is told to."""

from __future__ import annotations

import resource
import threading

import numpy as np
import pytest

from r2s2r_cli.hardware.camera.feed import Feed
from r2s2r_cli.hardware.camera.rig import RigCamera
from r2s2r_cli.rig.camera.service import CameraService
from r2s2r_cli.rig.camera.settings import CameraSettings, Clock
from tests.support.rig_robots import known


def resident_bytes() -> int:
    """Memory of this process now."""
    with open("/proc/self/statm") as file:  # noqa: PTH123 - no file of a project
        return int(file.read().split()[1]) * resource.getpagesize()


@pytest.mark.slow
def test_three_minutes_leave_memory_and_clocks_as_they_are() -> None:
    """5400 frames of lock-step: every one arrives, memory stays, stamps keep to the stated drift to 1e-9."""
    robot = known()
    caps = np.array(robot.rest_caps_m)
    lens = {"width": 160, "height": 120, "fx": 150.0, "fy": 150.0, "cx": 80.0, "cy": 60.0}
    settings = CameraSettings.model_validate(
        {**lens, "clock": Clock(lost_share=0.0, drift_ppm=80.0, latency_s=0.0, jitter_s=0.0)}
    )
    with (
        CameraService(robot, settings, lossless=True) as service,
        RigCamera(*service.address) as camera,
        Feed(camera) as feed,
    ):
        while not service.watched:
            pass
        stamps: list[tuple[int, float]] = []
        memory: list[int] = []
        for k in range(9000):
            service.observe(0.02 * k, caps + 0.05 * np.sin(0.01 * k))
            stamps += [(frame.number, frame.t_device) for frame in feed.frames()]
            if k in (2000, 8999):
                memory.append(resident_bytes())
        while len(stamps) < service.drawn:
            stamps += [(frame.number, frame.t_device) for frame in feed.frames()]
        statistics = feed.statistics
    number, t = np.array(stamps).T
    assert len(number) == service.drawn >= 5399 and (np.diff(number) == 1).all()
    assert statistics.lost == statistics.overrun == statistics.repeated == 0
    # 1/30 s apart by the camera's own clock, however fast that runs.
    assert np.polyfit(number, t, 1)[0] * 30 == pytest.approx(1.0, abs=1e-9)
    assert memory[1] - memory[0] < 8 << 20
    assert threading.active_count() < 8
