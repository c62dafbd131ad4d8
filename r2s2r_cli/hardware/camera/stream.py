"""The bytes of the rig's camera, on the host's side. Written from docs/reference/protocols.md, section camera."""

from __future__ import annotations

import json
import math
import struct
import zlib
from dataclasses import dataclass
from typing import Any

from r2s2r_cli.devices.camera import CameraError, Intrinsics

PROTOCOL, VERSION = "r2s2r-camera", 1
MAX_GREETING_BYTES = 4096
HEAD_BYTES = 32
FRAME, ALIVE = 1, 2
_SIDES = range(1, 8193)


@dataclass(frozen=True)
class Greeting:
    """What a camera states about itself when a host connects. depth_scale: [m] a count."""

    name: str
    intrinsics: Intrinsics
    depth_scale: float
    rate_hz: float


@dataclass(frozen=True)
class Head:
    """What stands before a frame: its number, the camera's clock [s], and the sizes of colour and depth [bytes]."""

    kind: int
    number: int
    t_device: float
    color_bytes: int
    depth_bytes: int


def parse_greeting(line: bytes, where: str) -> Greeting:
    """The greeting without its line end. Raises CameraError for another protocol, version, or values no camera has."""
    try:
        about = json.loads(line)
    except (ValueError, RecursionError):
        about = None
    if not isinstance(about, dict) or about.get("protocol") != PROTOCOL:
        raise CameraError(
            "this is no camera of the rig", where=where, expected=f"a greeting of {PROTOCOL}",
            received=repr(line[:60]), hint="take the camera's address as `r2s2r rig` prints it",
        )  # fmt: skip
    if about.get("version") != VERSION:
        raise CameraError(
            "the rig's camera speaks another version", where=where, expected=str(VERSION),
            received=str(about.get("version"))[:20], hint="start r2s2r rig of the same version",
        )  # fmt: skip
    try:
        width, height = (int(about[key]) for key in ("width", "height"))
        numbers = [float(about[key]) for key in ("fx", "fy", "cx", "cy", "depth_scale", "rate_hz")]
        distortion = tuple(float(x) for x in about["distortion"])
        name = f"{about['model']} {about['serial']}"
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise _broken(where, f"{type(error).__name__} {error}") from None
    if width not in _SIDES or height not in _SIDES or not all(math.isfinite(x) and x > 0 for x in numbers):
        raise _broken(where, f"{width} x {height} px, {numbers}")
    fx, fy, cx, cy, depth_scale, rate_hz = numbers
    lens = Intrinsics(width, height, fx, fy, cx, cy, distortion)
    return Greeting(name[:100], lens, depth_scale, rate_hz)


def parse_head(data: bytes, lens: Intrinsics, where: str) -> Head:
    """The 32 bytes before a payload. Raises CameraError where the stream is out of step or damaged."""
    fields: tuple[Any, ...] = struct.unpack("<4sHHIdIII", data)
    magic, kind, zero, number, stamp, color, depth, crc = fields
    pixels = lens.width * lens.height
    sizes = {FRAME: (3 * pixels, 2 * pixels), ALIVE: (0, 0)}
    wrong = (
        "no begin of a message" if magic != b"R2SF"
        else "a wrong checksum" if crc != zlib.crc32(data[:-4])
        else f"a message of kind {kind}" if kind not in sizes or zero
        else f"{color} + {depth} bytes" if (color, depth) != sizes[kind]
        else "a stamp that is no number" if not math.isfinite(stamp)
        else ""
    )  # fmt: skip
    if wrong:
        raise CameraError("the camera's stream is out of step", where=where, expected="a frame as its greeting says",
                          received=wrong, hint="start r2s2r rig and the host again, of the same version")  # fmt: skip
    return Head(kind, number, stamp, color, depth)


def _broken(where: str, what: str) -> CameraError:
    return CameraError("the camera's greeting cannot be used", where=where, expected="sizes, focal lengths, scales",
                       received=what[:120], hint="start r2s2r rig of the same version")  # fmt: skip
