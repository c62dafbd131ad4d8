"""The adapters of real cameras against stand-ins of their libraries: what they ask for, what they make of answers."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from r2s2r_cli.devices.camera import CameraError, Intrinsics
from r2s2r_cli.hardware.camera.realsense import RealSenseCamera
from r2s2r_cli.hardware.camera.realsense_open3d import Open3DCamera
from r2s2r_cli.hardware.camera.rectify import Rectifier

COLOR = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3)
DEPTH = np.arange(24, dtype=np.uint16).reshape(4, 6)


class FakeRealSense:
    """As much of pyrealsense2 as the adapter uses. errors: what wait_for_frames raises, in turn; None: a frame."""

    def __init__(self, errors: tuple[str | None, ...] = (), *, start: str | None = None, there: bool = True) -> None:
        self.errors, self.refuses, self.there = list(errors), start, there
        self.asked: list[Any] = []
        self.stopped = 0
        self.stream = SimpleNamespace(color="color", depth="depth")
        self.format = SimpleNamespace(rgb8="rgb8", z16="z16")
        self.camera_info = SimpleNamespace(name="name", serial_number="serial")

    def device(self) -> Any:
        info = {"name": "Intel D435", "serial": "0815"}
        sensor = SimpleNamespace(get_depth_scale=lambda: 0.001)
        return SimpleNamespace(get_info=info.__getitem__, first_depth_sensor=lambda: sensor)

    def pipeline(self) -> Any:
        lens = SimpleNamespace(width=6, height=4, fx=5.0, fy=5.1, ppx=2.5, ppy=1.5, coeffs=[0.0] * 5)
        profile = SimpleNamespace(
            get_device=self.device,
            get_stream=lambda kind: SimpleNamespace(
                as_video_stream_profile=lambda: SimpleNamespace(get_intrinsics=lambda: lens)
            ),
        )

        def start(config: Any) -> Any:
            if self.refuses:
                raise RuntimeError(self.refuses)
            return profile

        return SimpleNamespace(start=start, wait_for_frames=self.wait, stop=self.stop)

    def config(self) -> Any:
        return SimpleNamespace(enable_device=self.asked.append, enable_stream=lambda *what: self.asked.append(what))

    def align(self, stream: str) -> Any:
        self.asked.append(("align", stream))
        return SimpleNamespace(process=lambda pair: pair)

    def context(self) -> Any:
        return SimpleNamespace(query_devices=lambda: [self.device()] if self.there else [])

    def wait(self, milliseconds: int) -> Any:
        self.asked.append(milliseconds)
        error = self.errors.pop(0) if self.errors else None
        if error is not None:
            raise RuntimeError(error)
        picture = SimpleNamespace(get_data=lambda: COLOR, get_timestamp=lambda: 2500.0, get_frame_number=lambda: 17)
        return SimpleNamespace(
            get_color_frame=lambda: picture, get_depth_frame=lambda: SimpleNamespace(get_data=lambda: DEPTH)
        )

    def stop(self) -> None:
        self.stopped += 1


def test_realsense_gives_aligned_frames() -> None:
    """Depth is aligned to colour; pixel centres, stamp, number and scale are converted."""
    fake = FakeRealSense()
    with RealSenseCamera("0815", width=6, height=4, now=lambda: 9.0, library=fake) as camera:
        frame = camera.read(0.5)
        assert frame is not None
        assert np.array_equal(frame.color, COLOR) and np.array_equal(frame.depth, DEPTH)
        assert (frame.t_device, frame.t_host, frame.number) == (2.5, 9.0, 17)
        lens = camera.intrinsics
        assert (lens.fx, lens.fy, lens.cx, lens.cy, lens.distortion) == (5.0, 5.1, 3.0, 2.0, ())
        assert camera.depth_scale == 0.001 and camera.name == "Intel D435 0815"
    assert fake.asked == ["0815", ("color", 6, 4, "rgb8", 30), ("depth", 6, 4, "z16", 30), ("align", "color"), 500]
    assert fake.stopped == 1


def test_a_late_frame_is_none_and_a_lost_device_an_error() -> None:
    """A time-out with the device still there is nothing; without it, or any other failure, the camera is gone."""
    late = "Frame didn't arrive within 5000"
    with RealSenseCamera(library=FakeRealSense((late,))) as camera:
        assert camera.read(0.1) is None
        assert camera.read(0.1) is not None
    for fake in (FakeRealSense((late,), there=False), FakeRealSense(("device disconnected",))):
        with RealSenseCamera(library=fake) as camera, pytest.raises(CameraError, match="gone"):
            camera.read(0.1)
        assert fake.stopped == 1


def test_a_device_that_goes_while_it_is_looked_for_is_gone() -> None:
    """The library cannot even list its devices: the camera's own error, which the reader's thread knows."""

    class Going(FakeRealSense):
        def context(self) -> Any:
            raise RuntimeError("failed to set power state")

    with (
        RealSenseCamera(library=Going(("Frame didn't arrive within 5000",))) as camera,
        pytest.raises(CameraError, match="gone"),
    ):
        camera.read(0.1)


def test_no_device_is_a_clear_error() -> None:
    """What librealsense says is passed on, with what to do."""
    with pytest.raises(CameraError) as caught, RealSenseCamera(library=FakeRealSense(start="No device connected")):
        pass
    assert caught.value.received == "No device connected" and caught.value.exit_code == 5


def test_a_missing_library_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pyrealsense2 the error says how to install it."""
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    with pytest.raises(CameraError) as caught, RealSenseCamera():
        pass
    assert caught.value.hint == "pip install pyrealsense2"


class FakeOpen3D:
    """As much of open3d as the adapter uses."""

    def __init__(self, *, started: bool = True, frames: int = 1) -> None:
        self.settings: dict[str, str] = {}
        self.stopped = 0
        left = [SimpleNamespace(color=COLOR, depth=DEPTH[..., None])] * frames
        lens = SimpleNamespace(intrinsic_matrix=np.array([[5.0, 0, 2.5], [0, 5.1, 1.5], [0, 0, 1]]))
        about = SimpleNamespace(
            intrinsics=lens, depth_scale=1000.0, width=6, height=4, device_name="Intel D435", serial_number="0815"
        )

        def capture(wait: bool, align: bool) -> Any:
            assert wait and align
            if not left:
                raise RuntimeError("disconnected")
            return left.pop()

        sensor = SimpleNamespace(
            init_sensor=lambda config, index: started, start_capture=lambda: started, get_metadata=lambda: about,
            capture_frame=capture, get_timestamp=lambda: 2_500_000, stop_capture=self.stop,
        )  # fmt: skip
        io = SimpleNamespace(RealSenseSensor=lambda: sensor, RealSenseSensorConfig=self.settings.update)
        self.t = SimpleNamespace(io=io)

    def stop(self) -> None:
        self.stopped += 1


def test_open3d_gives_aligned_frames_until_the_device_is_gone() -> None:
    """Frames, geometry and scale are converted; then one clear error."""
    fake = FakeOpen3D()
    with Open3DCamera("0815", width=6, height=4, now=lambda: 9.0, library=fake) as camera:
        frame = camera.read()
        assert frame is not None and frame.depth.shape == (4, 6)
        assert np.array_equal(frame.color, COLOR) and (frame.t_device, frame.t_host, frame.number) == (2.5, 9.0, 0)
        assert (camera.intrinsics.cx, camera.intrinsics.cy, camera.depth_scale) == (3.0, 2.0, 0.001)
        with pytest.raises(CameraError, match="gone"):
            camera.read()
    assert fake.stopped == 1 and fake.settings["serial"] == "0815"


def test_open3d_without_a_device_is_a_clear_error() -> None:
    """init_sensor that fails names the camera."""
    with pytest.raises(CameraError, match="does not start"), Open3DCamera(library=FakeOpen3D(started=False)):
        pass


def test_pictures_of_a_distorted_lens_are_straightened() -> None:
    """Points seen through barrel distortion come out where a pinhole has them, in colour and in depth."""
    lens = Intrinsics(320, 240, 250.0, 250.0, 160.5, 120.5, (-0.15, 0.02, 0.001, -0.001, 0.0))
    K = np.array([[250.0, 0, 160.0], [0, 250.0, 120.0], [0, 0, 1]])
    points = np.array([[x, y, 1.0] for x in (-0.5, -0.2, 0.3) for y in (-0.35, 0.1, 0.33)])
    distorted, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(lens.distortion))
    color, depth = np.zeros((240, 320, 3), np.uint8), np.full((240, 320), 500, np.uint16)
    for k, (u, v) in enumerate(distorted[:, 0]):
        cv2.circle(color, (round(u), round(v)), 4, (255, 255, 255), -1)
        cv2.circle(depth, (round(u), round(v)), 4, 1000 + k, -1)
    rectifier = Rectifier(lens)
    straight, far = rectifier(color, depth)
    assert rectifier.intrinsics == Intrinsics(320, 240, 250.0, 250.0, 160.5, 120.5)
    for k, (x, y, _) in enumerate(points):
        rows, columns = np.nonzero(far == 1000 + k)
        seen = np.array([columns.mean(), rows.mean()]) + 0.5
        assert seen == pytest.approx([160.5 + 250 * x, 120.5 + 250 * y], abs=1.0)
        assert straight[round(rows.mean()), round(columns.mean())].min() > 200
    moved = np.abs(distorted[:, 0] + 0.5 - [[160.5 + 250 * x, 120.5 + 250 * y] for x, y, _ in points]).max()
    assert moved > 3  # the distortion was there
