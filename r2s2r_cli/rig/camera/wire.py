"""The bytes of the camera's stream, on the rig's side. Written from docs/reference/protocols.md, section camera."""

from __future__ import annotations

import json
import struct
import zlib

from r2s2r_cli.rig.camera.camera import Picture
from r2s2r_cli.rig.camera.clock import Exposure
from r2s2r_cli.rig.camera.settings import CameraSettings

PROTOCOL, VERSION = "r2s2r-camera", 1
MODEL = "r2s2r rig"
MAGIC = b"R2SF"
FRAME, ALIVE = 1, 2
_HEAD = struct.Struct("<4sHHIdII")
"""magic, kind, 0, number, stamp [s], bytes of colour, bytes of depth; the CRC-32 of these 28 bytes follows."""


def greeting(settings: CameraSettings, serial: str) -> bytes:
    """The line that a host gets first: what the camera states about itself."""
    about = {
        "protocol": PROTOCOL, "version": VERSION, "model": MODEL, "serial": serial,
        "width": settings.width, "height": settings.height, "fx": settings.fx, "fy": settings.fy,
        "cx": settings.cx, "cy": settings.cy, "distortion": [], "depth_scale": settings.depth_scale,
        "rate_hz": settings.clock.rate_hz,
    }  # fmt: skip
    return json.dumps(about).encode() + b"\n"


def frame(exposure: Exposure, picture: Picture) -> list[bytes | memoryview]:
    """A frame, in pieces that need not be copied."""
    color, depth = picture.color, picture.depth.astype("<u2", copy=False)
    head = _head(FRAME, exposure.number, exposure.stamp, color.nbytes, depth.nbytes)
    return [head, color.data.cast("B"), depth.data.cast("B")]


def alive(number: int, stamp: float) -> bytes:
    """Nothing to see, and the camera is there; number: of the frame that comes next."""
    return _head(ALIVE, number, stamp, 0, 0)


def _head(kind: int, number: int, stamp: float, color: int, depth: int) -> bytes:
    head = _HEAD.pack(MAGIC, kind, 0, number, stamp, color, depth)
    return head + struct.pack("<I", zlib.crc32(head))
