"""Intel RealSense cameras through Open3D, whose wheels bring librealsense: nothing else to install."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from r2s2r_cli.devices.camera import CameraError, Frame, Intrinsics
from r2s2r_cli.hardware.camera.closing import Closing

_HALF_PIXEL = 0.5


class Open3DCamera(Closing):
    """Open3D's `t.io.RealSenseSensor`. It waits for a frame as long as that takes: `read` may be late."""

    def __init__(
        self, serial: str = "", *, width: int = 640, height: int = 480, rate_hz: int = 30,
        now: Callable[[], float] = time.monotonic, library: Any = None,
    ) -> None:  # fmt: skip
        """serial: of the device, empty: the first. library: in place of open3d."""
        self._serial, self._size, self._rate, self._now, self._o3d = serial, (width, height), rate_hz, now, library
        self._sensor: Any = None
        self._number = 0
        self.name = f"RealSense {serial} (Open3D)".replace("  ", " ")
        self.rate_hz = float(rate_hz)
        self.depth_scale = 0.0
        self.intrinsics = Intrinsics(width, height, 1.0, 1.0, width / 2, height / 2)

    def open(self) -> None:
        """Start the streams. Raises CameraError."""
        self.close()
        if self._o3d is None:
            try:
                import open3d
            except (ImportError, OSError) as error:
                raise self._wrong("open3d cannot be loaded", str(error)[:120], "r2s2r doctor") from error
            self._o3d = open3d
        width, height = self._size
        settings = {"serial": self._serial, "color_format": "RS2_FORMAT_RGB8", "depth_format": "RS2_FORMAT_Z16",
                    "color_resolution": f"{width},{height}", "depth_resolution": f"{width},{height}",
                    "fps": str(self._rate)}  # fmt: skip
        try:
            sensor = self._o3d.t.io.RealSenseSensor()
            config = self._o3d.t.io.RealSenseSensorConfig(settings)
            started = sensor.init_sensor(config, 0) and sensor.start_capture()
        except (RuntimeError, AttributeError) as error:
            raise self._wrong("the RealSense does not start", str(error)[:120], "r2s2r doctor") from error
        if not started:
            raise self._wrong("the RealSense does not start", "no device", "look at its cable (USB 3)")
        self._sensor, self._number = sensor, 0
        about = sensor.get_metadata()
        K = np.asarray(about.intrinsics.intrinsic_matrix)
        self.depth_scale = 1.0 / float(about.depth_scale)
        self.intrinsics = Intrinsics(int(about.width), int(about.height), float(K[0, 0]), float(K[1, 1]),
                                     float(K[0, 2]) + _HALF_PIXEL, float(K[1, 2]) + _HALF_PIXEL)  # fmt: skip
        self.name = f"{about.device_name} {about.serial_number} (Open3D)"

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next pair. Raises CameraError where the device is gone."""
        del timeout_s
        if self._sensor is None:
            raise self._wrong("the camera is not open", "none", "open it first")
        try:
            pair = self._sensor.capture_frame(True, True)
            stamp = float(self._sensor.get_timestamp()) * 1e-6
        except RuntimeError as error:
            self.close()
            raise self._wrong("the camera is gone", str(error)[:120], "look at its cable (USB 3)") from error
        color, depth = np.asarray(pair.color), np.asarray(pair.depth)
        if not color.size or not depth.size:
            return None
        self._number += 1
        depth = depth.reshape(depth.shape[:2]).astype(np.uint16)
        return Frame(color.astype(np.uint8), depth, stamp, self._now(), self._number - 1)

    def close(self) -> None:
        """Stop the streams."""
        sensor, self._sensor = self._sensor, None
        if sensor is not None:
            with contextlib.suppress(RuntimeError):
                sensor.stop_capture()

    def _wrong(self, what: str, received: str, hint: str) -> CameraError:
        return CameraError(
            what, where=self.name, expected="a RealSense that gives frames", received=received, hint=hint
        )
