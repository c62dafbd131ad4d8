"""Intel RealSense cameras through pyrealsense2, which is optional: `pip install pyrealsense2`.

The L515 needs pyrealsense2 2.54.2.5684 or older, of which there are wheels up to Python 3.11.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from r2s2r_cli.devices.camera import CameraError, Frame, Intrinsics
from r2s2r_cli.hardware.camera.closing import Closing
from r2s2r_cli.hardware.camera.rectify import Rectifier

_HALF_PIXEL = 0.5
"""Librealsense puts the centre of the first pixel at 0, this project at 0.5."""
_LATE = ("didn't arrive", "did not arrive", "timeout")
"""Words of the errors that mean nothing but: not yet."""


class RealSenseCamera(Closing):
    """Colour and depth of one device, depth aligned to colour by librealsense, both rectified here.

    A lens of librealsense's model `inverse_brown_conrady` is taken for OpenCV's, from which it differs in second order;
    such devices have small coefficients or none.
    """

    def __init__(
        self, serial: str = "", *, width: int = 640, height: int = 480, rate_hz: int = 30,
        now: Callable[[], float] = time.monotonic, library: Any = None,
    ) -> None:  # fmt: skip
        """serial: of the device, empty: the first. library: in place of pyrealsense2."""
        self._serial, self._size, self._rate, self._now, self._rs = serial, (width, height), rate_hz, now, library
        self._pipeline: Any = None
        self._align: Any = None
        self.name = f"RealSense {serial}".strip()
        self.rate_hz = float(rate_hz)
        self.depth_scale = 0.0
        self.intrinsics = Intrinsics(width, height, 1.0, 1.0, width / 2, height / 2)
        self._rectify = Rectifier(self.intrinsics)

    def open(self) -> None:
        """Start the streams. Raises CameraError: no library, no device, a mode that it does not have."""
        self.close()
        rs = self._library()
        try:
            pipeline, config = rs.pipeline(), rs.config()
            if self._serial:
                config.enable_device(self._serial)
            config.enable_stream(rs.stream.color, *self._size, rs.format.rgb8, self._rate)
            config.enable_stream(rs.stream.depth, *self._size, rs.format.z16, self._rate)
            profile = pipeline.start(config)
        except RuntimeError as error:
            raise CameraError(
                "the RealSense does not start", where=self.name,
                expected=f"{self._size[0]} x {self._size[1]} px, {self._rate} a second, on a USB 3 port",
                received=str(error)[:120], hint="rs-enumerate-devices, or unplug it and plug it in again",
            ) from error  # fmt: skip
        device = profile.get_device()
        self._pipeline, self._align = pipeline, rs.align(rs.stream.color)
        self.depth_scale = float(device.first_depth_sensor().get_depth_scale())
        k = profile.get_stream(rs.stream.color).as_video_stream_profile().get_intrinsics()
        lens = Intrinsics(int(k.width), int(k.height), float(k.fx), float(k.fy), float(k.ppx) + _HALF_PIXEL,
                          float(k.ppy) + _HALF_PIXEL, _distortion(k))  # fmt: skip
        self._rectify = Rectifier(lens)
        self.intrinsics = self._rectify.intrinsics
        about = rs.camera_info
        self.name = f"{device.get_info(about.name)} {device.get_info(about.serial_number)}"

    def read(self, timeout_s: float = 1.0) -> Frame | None:
        """The next pair, None where none came in time. Raises CameraError where the device is gone."""
        if self._pipeline is None:
            raise self._gone("it is not open")
        try:
            pair = self._pipeline.wait_for_frames(max(int(1000 * timeout_s), 1))
            pair = self._align.process(pair)
        except RuntimeError as error:
            if any(word in str(error).lower() for word in _LATE) and self._there():
                return None
            raise self._gone(str(error)[:120]) from error
        color, depth = pair.get_color_frame(), pair.get_depth_frame()
        if not color or not depth:
            return None
        arrived, stamp = self._now(), float(color.get_timestamp()) / 1000.0
        straight = self._rectify(
            np.array(color.get_data(), dtype=np.uint8), np.array(depth.get_data(), dtype=np.uint16)
        )
        return Frame(*straight, stamp, arrived, int(color.get_frame_number()))

    def close(self) -> None:
        """Stop the streams."""
        pipeline, self._pipeline = self._pipeline, None
        if pipeline is not None:
            with contextlib.suppress(RuntimeError):
                pipeline.stop()

    def _there(self) -> bool:
        """Whether the device is still plugged in; the pipeline itself only says that nothing came."""
        try:
            serials = [d.get_info(self._rs.camera_info.serial_number) for d in self._rs.context().query_devices()]
        except RuntimeError:  # unplugged at this very moment
            return False
        return self.name.rpartition(" ")[2] in serials

    def _gone(self, what: str) -> CameraError:
        name = self.name
        self.close()
        return CameraError("the camera is gone", where=name, expected="frames", received=what,
                           hint="look at its cable (USB 3), then: r2s2r doctor camera --camera realsense")  # fmt: skip

    def _library(self) -> Any:
        if self._rs is None:
            try:
                import pyrealsense2  # type: ignore[import-not-found, import-untyped, unused-ignore]
            except ImportError as error:
                missing = "libusb" in str(error)
                raise CameraError(
                    "pyrealsense2 cannot be loaded", where=self.name, expected="pyrealsense2",
                    received=str(error)[:120],
                    hint="apt-get install libusb-1.0-0" if missing else "pip install pyrealsense2",
                ) from error  # fmt: skip
            self._rs = pyrealsense2
        return self._rs


def _distortion(k: Any) -> tuple[float, ...]:
    """Librealsense's coefficients in OpenCV's order; empty where they are all 0, as on most devices."""
    values = tuple(float(x) for x in k.coeffs)
    return values if any(values) else ()
