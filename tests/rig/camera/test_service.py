"""The rig's camera service with the host's camera at the other end of a real socket."""

from __future__ import annotations

import itertools
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from r2s2r_cli.devices.camera import CameraError, Frame
from r2s2r_cli.errors import HardwareError
from r2s2r_cli.hardware.camera.feed import Feed
from r2s2r_cli.hardware.camera.rig import RigCamera
from r2s2r_cli.rig.camera.service import CameraService
from r2s2r_cli.rig.camera.settings import CameraSettings, Clock, Faults
from tests.support.rig_robots import known

THREE = known()
CAPS = np.array(THREE.rest_caps_m)
SMALL = {"width": 80, "height": 60, "fx": 75.0, "fy": 75.0, "cx": 40.0, "cy": 30.0}


def small(*, clock: dict[str, float] | None = None, **faults: float) -> CameraSettings:
    """A small camera that loses nothing."""
    return CameraSettings.model_validate(
        {**SMALL, "clock": Clock(**{"lost_share": 0.0, **(clock or {})}), "faults": Faults(**faults)}
    )


@contextmanager
def running(service: CameraService, speed: float = 1.0) -> Iterator[None]:
    """The rig's main loop, `speed` times as fast as the wall's clock."""
    stop = threading.Event()
    begin = time.monotonic()

    def loop() -> None:
        while not stop.wait(0.002):
            service.observe(speed * (time.monotonic() - begin), CAPS)

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


def take(camera: RigCamera, count: int) -> list[Frame]:
    """The next `count` frames."""
    frames = [camera.read(2.0) for _ in range(count)]
    assert all(frame is not None for frame in frames)
    return [frame for frame in frames if frame is not None]


def test_frames_arrive_as_they_were_drawn() -> None:
    """Intrinsics, sizes, numbers, stamps and pixels are those of the rig's camera."""
    settings = small()
    with CameraService(THREE, settings, seed=4) as service, RigCamera(*service.address) as camera, running(service):
        frames = take(camera, 4)
        lens = camera.intrinsics
        assert (lens.width, lens.height, lens.fx, lens.cy) == (80, 60, 75.0, 30.0)
        assert camera.depth_scale == settings.depth_scale and camera.rate_hz == 30.0 and "rig-4" in camera.name
    from r2s2r_cli.rig.camera.camera import RigCamera as Drawn

    drawn = Drawn(THREE, settings, seed=4)
    for frame in frames:
        picture = drawn.capture(frame.number, (frame.t_device - 5000.0) / (1 + 40e-6), CAPS, np.zeros((6, 3)))
        assert np.array_equal(picture.depth, frame.depth)
        assert np.array_equal(picture.color, frame.color)
    assert frame.depth.dtype == np.uint16 and frame.color.dtype == np.uint8
    assert [b.number - a.number for a, b in itertools.pairwise(frames)] == [1, 1, 1]


def test_latency_holds_frames_back() -> None:
    """A frame leaves the camera `latency_s` of the rig's time after its exposure, and not before."""
    settings = small(clock={"latency_s": 0.5, "origin_s": 0.0, "drift_ppm": 0.0})
    with CameraService(THREE, settings, lossless=True) as service, RigCamera(*service.address) as camera:
        _watched(service)
        service.observe(0.0, CAPS)
        service.observe(0.49, CAPS)
        assert camera.read(0.05) is None
        service.observe(0.51, CAPS)
        assert take(camera, 1)[0].t_device == pytest.approx(0.0, abs=1e-3)


def test_moving_robot_is_seen_where_it_was_at_the_exposure() -> None:
    """Between two observations the caps are put where they were in the middle of the exposure."""
    lens = {"width": 320, "height": 240, "fx": 300.0, "fy": 300.0, "cx": 160.0, "cy": 120.0}
    settings = CameraSettings.model_validate(lens).ideal()
    with CameraService(THREE, settings, lossless=True) as service, RigCamera(*service.address) as camera:
        _watched(service)
        for k in range(4):  # 0.05 s between looks, 1/30 s between frames, 1 m/s along x
            service.observe(0.05 * k, CAPS + np.array([0.05 * k, 0.0, 0.0]))
        frames = take(camera, 4)
    middles = [np.nonzero(f.depth * settings.depth_scale < 1.42)[1].mean() for f in frames]
    assert np.diff(middles) == pytest.approx([300.0 / 1.35 / 30] * 3, abs=0.5)


def _watched(service: CameraService) -> None:
    deadline = time.monotonic() + 30.0
    while not service.watched and time.monotonic() < deadline:
        time.sleep(0.002)
    assert service.watched


def stream(seed: int) -> list[tuple[int, float, bytes]]:
    """Number, stamp and depth of the frames of one lock-step second."""
    with (
        CameraService(THREE, small(clock={"lost_share": 0.2}), seed=seed, lossless=True) as service,
        RigCamera(*service.address) as camera,
        Feed(camera) as feed,
    ):
        _watched(service)
        for k in range(101):
            service.observe(0.01 * k, CAPS)
        wanted, frames = service.drawn, []
        while len(frames) < wanted:
            frames += feed.frames()
            time.sleep(0.005)
    return [(frame.number, frame.t_device, frame.depth.tobytes()) for frame in frames]


def test_lock_step_is_the_same_each_time() -> None:
    """Two runs of one seed give the same frames to the last bit, however fast the host reads; another seed does not."""
    first = stream(1)
    assert 15 < len(first) < 29
    assert first == stream(1)
    assert first != stream(2)


def test_lock_step_waits_for_its_host() -> None:
    """A host that reads only afterwards still gets every frame."""
    with CameraService(THREE, small(), lossless=True) as service, RigCamera(*service.address) as camera:
        _watched(service)
        thread = threading.Thread(target=lambda: [service.observe(0.02 * k, CAPS) for k in range(60)])
        thread.start()
        frames = take(camera, 30)
        thread.join()
    assert [frame.number for frame in frames] == list(range(30))


def test_a_slow_host_loses_frames_and_sees_so() -> None:
    """In real time the rig goes on when nobody reads; what comes later has a gap in its numbers."""
    settings = CameraSettings(clock=Clock(lost_share=0.0, rate_hz=60.0))
    with CameraService(THREE, settings) as service, RigCamera(*service.address) as camera, running(service):
        first = take(camera, 1)[0]
        drawn = service.drawn
        while service.drawn < drawn + 25:  # 1.5 MB each: more than the sockets hold
            time.sleep(0.02)
        numbers = [frame.number for frame in take(camera, 20)]
    assert max(np.diff([first.number, *numbers])) > 1


def test_nobody_watches_nothing_is_drawn() -> None:
    """Without a host the camera costs nothing, and its frames are counted all the same."""
    with CameraService(THREE, small(), lossless=True) as service:
        for k in range(100):
            service.observe(0.02 * k, CAPS)
        assert service.drawn == 0
        with RigCamera(*service.address) as camera:
            _watched(service)
            service.observe(2.1, CAPS)
            assert take(camera, 1)[0].number >= 59


def test_lost_frames_show_in_the_numbers() -> None:
    """The feed counts the frames that the camera dropped."""
    with (
        CameraService(THREE, small(clock={"lost_share": 0.3}), lossless=True) as service,
        RigCamera(*service.address) as camera,
        Feed(camera) as feed,
    ):
        _watched(service)
        for k in range(200):
            service.observe(0.02 * k, CAPS)
        while feed.statistics.received < service.drawn:
            time.sleep(0.01)
        frames, statistics = feed.frames(), feed.statistics
    assert statistics.received == len(frames) == service.drawn
    assert statistics.lost == frames[-1].number - frames[0].number + 1 - len(frames) > 20


def test_unplugged_camera_is_one_clear_error() -> None:
    """When the camera goes, the host gets what had come, then CameraError with exit code 5, and no new connection."""
    with CameraService(THREE, small(gone_at_s=1.0)) as service, running(service):
        with RigCamera(*service.address) as camera, Feed(camera) as feed:
            frames: list[Frame] = []
            deadline = time.monotonic() + 30.0
            with pytest.raises(CameraError) as caught:
                while time.monotonic() < deadline:
                    frames += feed.frames()
                    time.sleep(0.01)
        assert frames
        assert caught.value.exit_code == 5 and "rig://" in caught.value.where
        with pytest.raises(CameraError), RigCamera(*service.address):
            pass


def test_frozen_camera_repeats_one_picture() -> None:
    """Stamps and numbers go on, the picture does not; the feed counts the repetitions."""
    with (
        CameraService(THREE, small(frozen_from_s=1.0, frozen_until_s=2.0), lossless=True) as service,
        RigCamera(*service.address) as camera,
        Feed(camera) as feed,
    ):
        _watched(service)
        for k in range(150):
            service.observe(0.02 * k, CAPS)
        while feed.statistics.received < 85:
            time.sleep(0.01)
        frames, statistics = feed.frames(), feed.statistics
    assert 28 <= statistics.repeated <= 31
    stuck = [f for f in frames if 1.05 < f.t_device - 5000 < 1.95]
    assert all(np.array_equal(f.depth, stuck[0].depth) for f in stuck)
    assert (np.diff([f.t_device for f in stuck]) > 0.03).all()


def test_stalled_camera_is_taken_for_dead(monkeypatch: pytest.MonkeyPatch) -> None:
    """A camera that says nothing at all is given up after SILENCE_S; one that only has no frames is not."""
    monkeypatch.setattr("r2s2r_cli.hardware.camera.rig.SILENCE_S", 1.2)
    with CameraService(THREE, small(stalled_from_s=0.2)) as service, RigCamera(*service.address) as camera:
        assert camera.read(1.5) is None  # the rig's time stands still: nothing but signs of life
        with running(service), pytest.raises(CameraError, match="gone"):
            for _ in range(80):
                camera.read(0.1)


def test_port_in_use_is_a_clear_error() -> None:
    """Two cameras cannot have one port."""
    with CameraService(THREE, small()) as service, pytest.raises(HardwareError) as caught:
        CameraService(THREE, small(), port=service.address[1])
    assert "--camera-port" in caught.value.hint


def test_a_host_that_leaves_stops_nothing() -> None:
    """The service goes on for the next host when one hangs up in the middle of a frame."""
    with CameraService(THREE, CameraSettings()) as service, running(service):
        for _ in range(3):
            with socket.create_connection(service.address) as rude:
                rude.recv(100)
        with RigCamera(*service.address) as camera:
            assert len(take(camera, 2)) == 2
