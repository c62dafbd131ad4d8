"""The camera's stream, byte by byte: the examples of the specification, and everything that is none."""

from __future__ import annotations

import json
import socket
import struct
import threading
import zlib

import numpy as np
import pytest

from r2s2r_cli.devices.camera import CameraError, Intrinsics
from r2s2r_cli.hardware.camera.rig import RigCamera
from r2s2r_cli.hardware.camera.stream import parse_greeting, parse_head

LENS = Intrinsics(4, 3, 5.0, 5.0, 2.0, 1.5)
ABOUT = {
    "protocol": "r2s2r-camera", "version": 1, "model": "m", "serial": "1", "width": 4, "height": 3, "fx": 5.0,
    "fy": 5.0, "cx": 2.0, "cy": 1.5, "distortion": [], "depth_scale": 0.001, "rate_hz": 30,
}  # fmt: skip


def head(
    kind: int = 1, number: int = 7, stamp: float = 1.5, color: int = 36, depth: int = 24, magic: bytes = b"R2SF"
) -> bytes:
    """The head of a message as the page says, packed by hand."""
    data = magic + struct.pack("<H", kind) + bytes(2) + struct.pack("<I", number) + struct.pack("<d", stamp)
    data += struct.pack("<I", color) + struct.pack("<I", depth)
    return data + struct.pack("<I", zlib.crc32(data))


def test_a_head_by_hand_is_understood() -> None:
    """Number, clock and sizes are where the page says."""
    found = parse_head(head(), LENS, "x")
    assert (found.kind, found.number, found.t_device, found.color_bytes, found.depth_bytes) == (1, 7, 1.5, 36, 24)


@pytest.mark.parametrize(
    "wrong",
    [{"kind": 3}, {"color": 35}, {"depth": 0}, {"magic": b"R2SX"}, {"stamp": float("nan")}, {"kind": 2}],
    ids=str,
)
def test_a_head_that_breaks_the_rules_is_refused(wrong: dict[str, object]) -> None:
    """Other kinds, sizes and stamps mean that the stream is out of step."""
    with pytest.raises(CameraError, match="out of step"):
        parse_head(head(**wrong), LENS, "x")  # type: ignore[arg-type]


def test_every_flipped_bit_of_a_head_is_caught() -> None:
    """The checksum catches each of the 256 single bit errors."""
    good = head()
    for bit in range(8 * len(good)):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        with pytest.raises(CameraError):
            parse_head(bytes(bad), LENS, "x")


def test_the_greeting_of_the_page_is_understood() -> None:
    """Geometry, scale and rate come from the greeting."""
    found = parse_greeting(json.dumps(ABOUT).encode(), "x")
    assert found.intrinsics == LENS
    assert (found.depth_scale, found.rate_hz, found.name) == (0.001, 30.0, "m 1")


@pytest.mark.parametrize(
    "change",
    [{"protocol": "http"}, {"version": 2}, {"width": 0}, {"fx": -1}, {"fx": "inf"}, {"depth_scale": None},
     {"rate_hz": 0}, {"height": 10**9}, {"distortion": 3}],
    ids=str,
)  # fmt: skip
def test_a_greeting_of_another_camera_is_refused(change: dict[str, object]) -> None:
    """Another protocol, version, or values that no camera has end in one clear error with exit code 5."""
    with pytest.raises(CameraError) as caught:
        parse_greeting(json.dumps({**ABOUT, **change}).encode(), "rig://h:1")
    assert caught.value.exit_code == 5 and caught.value.where == "rig://h:1"


def test_ten_thousand_damaged_greetings_and_heads() -> None:
    """Whatever comes is understood or refused: nothing else is ever raised."""
    rng = np.random.default_rng(5)
    line, good = json.dumps(ABOUT).encode(), head()
    for _ in range(5000):
        for data in (line, good):
            bad = bytearray(data)
            for place in rng.integers(0, len(bad), size=rng.integers(1, 4)):
                bad[place] = rng.integers(0, 256)
            try:
                if data is line:
                    parse_greeting(bytes(bad[: rng.integers(0, len(bad) + 1)]), "x")
                else:
                    parse_head(bytes(bad), LENS, "x")
            except CameraError:
                pass


def served(*pieces: bytes, hold: bool = False) -> tuple[tuple[str, int], threading.Event]:
    """A device that sends these pieces, each by itself, then hangs up (`hold`: when the event is set)."""
    listener, done = socket.create_server(("127.0.0.1", 0)), threading.Event()

    def serve() -> None:
        with listener, listener.accept()[0] as connection:
            for piece in pieces:
                connection.sendall(piece)
                done.wait(0.01)
            if hold:
                done.wait(10.0)

    threading.Thread(target=serve, daemon=True).start()
    return listener.getsockname(), done


GREETING = json.dumps(ABOUT).encode() + b"\n"


def test_a_frame_cut_into_pieces_is_put_together() -> None:
    """Split anywhere, even in the head, over read time-outs and after a sign of life, the frame is the same."""
    color, depth = bytes(range(36)), struct.pack("<12H", *range(100, 112))
    data = head(kind=2, color=0, depth=0) + head() + color + depth
    address, done = served(GREETING[:10], GREETING[10:], *(data[i : i + 7] for i in range(0, len(data), 7)), hold=True)
    with RigCamera(*address, now=lambda: 42.0) as camera:
        frame = None
        for _ in range(400):
            frame = camera.read(0.003)
            if frame is not None:
                break
        assert frame is not None
        done.set()
    assert frame.color.tobytes() == color and frame.color.shape == (3, 4, 3)
    assert frame.depth.tolist() == np.arange(100, 112).reshape(3, 4).tolist()
    assert (frame.number, frame.t_device, frame.t_host) == (7, 1.5, 42.0)


@pytest.mark.parametrize(
    "data", [head() + bytes(20), b"GET / HTTP/1.1\r\n\r\n" + bytes(40), b""], ids=["cut", "other", "nothing"]
)
def test_a_stream_that_ends_or_goes_wrong_is_one_error(data: bytes) -> None:
    """A frame cut off, foreign bytes, or nothing at all: CameraError that names the camera, and nothing hangs."""
    address, _ = served(GREETING, data)
    with pytest.raises(CameraError) as caught, RigCamera(*address) as camera:
        for _ in range(20):
            camera.read(0.5)
    assert caught.value.where == f"rig://127.0.0.1:{address[1]}"


@pytest.mark.parametrize(
    "greeting", [b"", b"x" * 5000, b"SSH-2.0\r\n", b"[" * 4000 + b"\n"], ids=["silence", "endless", "ssh", "deep"]
)
def test_who_is_no_camera_is_told_apart(greeting: bytes) -> None:
    """A server that is no camera is refused when the camera is opened."""
    address, _ = served(greeting)
    with pytest.raises(CameraError), RigCamera(*address):
        pass


def test_nobody_listens() -> None:
    """A port without a camera is a clear error."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = free.getsockname()
    with pytest.raises(CameraError, match="does not answer") as caught:
        RigCamera(*address).open()
    assert "r2s2r rig" in caught.value.hint


def test_a_name_that_no_host_can_have() -> None:
    """The same error: its characters are not at fault."""
    with pytest.raises(CameraError, match="does not answer"):
        RigCamera("a..b", 9000).open()
