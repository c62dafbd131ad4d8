"""Colour and depth frames by their headers alone: kind, size, bit depth, and whether the file is whole."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from r2s2r_cli.artifact import Blobs
from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.import_.files import FileBytes, read_ends

_PNG = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
_JPEG = b"\xff\xd8\xff"
_JPEG_END = b"\xff\xd9"
_COLORS = {2: "RGB", 3: "palette", 6: "RGBA"}
_HEAD = 65536
"""A JPEG's size stands behind its metadata; a thumbnail of 64 KiB before it is the most that EXIF allows."""
MAX_SIDE = 16384
_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}


@dataclass(frozen=True)
class ImageHeader:
    """What the first bytes of an image say."""

    kind: str
    """PNG or JPEG."""
    width: int
    """[px]"""
    height: int
    """[px]"""
    bits: int
    """Of one channel."""
    colour: bool
    """Three channels, or a palette of them."""


def read_header(path: Path, what: str) -> ImageHeader:
    """Header of one image file. Raises InputError where it is no PNG or JPEG, or cut off."""
    head, tail = read_ends(path, what, head=_HEAD, tail=16)
    if head.startswith(_PNG):
        if not tail.endswith(_PNG_END):
            raise _cut_off(path, what, "PNG")
        return _png(head, path, what)
    if head.startswith(_JPEG):
        if not tail.rstrip(b"\0").endswith(_JPEG_END):
            raise _cut_off(path, what, "JPEG")
        return _jpeg(head, path, what)
    raise InputError(
        f"{what} is neither PNG nor JPEG",
        where=str(path),
        expected="a PNG or JPEG signature",
        received=f"first bytes {head[:8].hex(' ') or 'none: the file is empty'}",
        hint=f"file {quoted(path)}",
    )


def check_images(color: Sequence[Path], depth: Sequence[Path]) -> tuple[int, int]:
    """Width and height [px] that all frames share; no image is decoded.

    Colour must be 8-bit PNG or JPEG in colour, depth 16-bit grey PNG, registered to colour (same size). Raises
    InputError, naming the first file that differs, and saying so where the two are swapped.
    """
    size: tuple[int, int] | None = None
    first: Path | None = None
    for paths, what, other in ((color, "colour frame", "depth"), (depth, "depth frame", "colour")):
        for path in paths:
            header = read_header(path, f"the {what}")
            is_depth = header.kind == "PNG" and header.bits == 16 and not header.colour
            if is_depth != (other == "colour") or (other == "depth" and not header.colour):
                raise _wrong_kind(path, what, header, swapped=is_depth if other == "depth" else header.colour)
            if size is None:
                size, first = (header.width, header.height), path
            elif size != (header.width, header.height):
                raise InputError(
                    "the frames differ in size",
                    where=str(path),
                    expected=f"{size[0]} x {size[1]} px, as {first}; depth registered to colour",
                    received=f"{header.width} x {header.height} px",
                    hint="align depth to colour when recording, and import each resolution as a run of its own",
                )
    if size is None:
        raise InputError(
            "there is no image", expected="colour or depth frames", hint="see docs/guides/import.md for the layout"
        )
    return size


def frame_blobs(paths: Sequence[Path], what: str) -> Blobs:
    """Encoded frames as they lie on disk, read only when the artifact is written."""
    return Blobs(items=FileBytes(tuple(paths), what), count=len(paths))


def _png(head: bytes, path: Path, what: str) -> ImageHeader:
    if len(head) < 33 or head[12:16] != b"IHDR":
        raise _cut_off(path, what, "PNG")
    width, height, bits, colour_type = struct.unpack(">IIBB", head[16:26])
    return _checked(ImageHeader("PNG", width, height, bits, colour_type in _COLORS), path, what)


def _jpeg(head: bytes, path: Path, what: str) -> ImageHeader:
    """Walk from segment to segment up to the frame header (SOF), which holds the size."""
    position = 2
    while position + 9 < len(head) and head[position] == 0xFF:
        marker = head[position + 1]
        if marker == 0xFF:
            position += 1
            continue
        if marker in _FRAME_MARKERS:
            bits, height, width, channels = struct.unpack(">BHHB", head[position + 4 : position + 10])
            return _checked(ImageHeader("JPEG", width, height, bits, channels >= 3), path, what)
        position += 2 + int(struct.unpack(">H", head[position + 2 : position + 4])[0])
    raise _cut_off(path, what, "JPEG")


def _checked(header: ImageHeader, path: Path, what: str) -> ImageHeader:
    if not (0 < header.width <= MAX_SIDE and 0 < header.height <= MAX_SIDE):
        raise InputError(
            f"{what} has an impossible size",
            where=str(path),
            expected=f"1 .. {MAX_SIDE} px",
            received=f"{header.width} x {header.height} px",
            hint=f"file {quoted(path)}",
        )
    return header


def _cut_off(path: Path, what: str, kind: str) -> InputError:
    return InputError(
        f"{what} is damaged or cut off",
        where=str(path),
        expected=f"a whole {kind} file",
        received=f"a {kind} signature without its end or its header",
        hint=f"take this frame out, with its depth and data: ls -l {quoted(path)}",
    )


def _wrong_kind(path: Path, what: str, header: ImageHeader, *, swapped: bool) -> InputError:
    wanted = "8-bit colour PNG or JPEG" if what.startswith("colour") else "16-bit grey PNG"
    return InputError(
        "colour and depth are swapped" if swapped else f"a {what} has the wrong kind of pixel",
        where=str(path),
        expected=wanted,
        received=f"{header.bits}-bit {'colour' if header.colour else 'grey'} {header.kind}",
        hint="swap the two folders (or list files)" if swapped else f"file {quoted(path)}",
    )
