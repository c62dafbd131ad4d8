"""`r2s2r doctor camera`: what a camera sees, and the colour ranges of the robot from a few clicks or boxes."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from r2s2r_cli.commands.typed import typed_words
from r2s2r_cli.console import Console
from r2s2r_cli.errors import InputError, R2S2RError, UsageError
from r2s2r_cli.options import JsonOption, ProjectOption, QuietOption

if TYPE_CHECKING:
    from r2s2r_cli.devices.camera import Camera, FeedStatistics, Frame
    from r2s2r_cli.stages.doctor.camera import Looked
    from r2s2r_cli.stages.doctor.colors import Box
    from schemas.results_camera import CameraGround
    from schemas.robot import Robot

PATIENCE_S = 10.0
"""How long frames are waited for, beyond the time that they should take."""
_CLICK = re.compile(r"([^:]+):(\d{1,5}),(\d{1,5})")
_BOX = re.compile(r"([^:]+):(\d{1,5}),(\d{1,5}),(\d{1,5}),(\d{1,5})")


def camera(
    source: Annotated[
        str,
        typer.Option(
            "--camera",
            metavar="CAMERA",
            help="rig://HOST:PORT, realsense[:SERIAL], open3d, replay:FOLDER, replay:FILE.h5[:RUN].",
        ),
    ] = "realsense",
    frames: Annotated[int, typer.Option("--frames", min=1, max=900, help="How many frames are looked at.")] = 30,
    preview: Annotated[
        Path | None,
        typer.Option(
            "--preview", metavar="FILE", help="What the camera sees: a .png, or a .html page to mark caps on."
        ),
    ] = None,
    click: Annotated[
        list[str] | None, typer.Option("--click", metavar="ROD:U,V", help="A pixel on a cap of this rod; repeatable.")
    ] = None,
    box: Annotated[
        list[str] | None,
        typer.Option("--box", metavar="ROD:U0,V0,U1,V1", help="A box around a cap of this rod; repeatable."),
    ] = None,
    save: Annotated[
        bool, typer.Option("--save", help="Write the colour ranges of the marked rods into robot.toml.")
    ] = False,
    project: ProjectOption = None,
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> None:
    """Look through a camera: geometry, pace, ground, and how the rods' colours are seen.

    Colour ranges are measured anew for rods whose caps are marked with --click or --box, at the coordinates that the
    preview shows; a preview that is a page takes the clicks. --save writes them into robot.toml.

    Example: r2s2r doctor camera --camera rig://127.0.0.1:9000 --preview see.png
    """
    from r2s2r_cli.commands.cameras import camera_of
    from r2s2r_cli.stages.doctor.camera import look

    console = Console(json=json, quiet=quiet)
    boxes = [*(_click(text) for text in click or []), *(_box(text) for text in box or [])]
    path, robot = _robot(project, needed=save)
    if save and not boxes:
        raise UsageError("there is nothing to save", where="--save", expected="--click or --box, on a cap of each rod",
                         received="neither", hint="r2s2r doctor camera --preview see.png")  # fmt: skip
    command = shlex.join(["r2s2r", "doctor", "camera", "--camera", source,
                          *(["--project", str(project)] if project else [])])  # fmt: skip
    device = camera_of(source)
    with device:
        taken, statistics = _take(device, frames, console)
        try:
            looked = look(
                taken, name=device.name, lens=device.intrinsics, depth_scale=device.depth_scale, rate_hz=device.rate_hz,
                robot=robot, statistics=statistics, boxes=boxes,
            )  # fmt: skip
        except InputError as error:  # a mark beside the caps: without the marks, which would be refused again
            error.hint = f"{command} --preview see.html   # what the camera sees; takes clicks on the caps"
            raise
    result = looked.result
    if preview is not None:
        _draw(looked, device, preview, command)
        result = result.model_copy(update={"preview": str(preview)})
    if save and path is not None:
        _save(path, looked, len(boxes))
        result = result.model_copy(update={"saved": str(path)})
    console.document(result)
    _show(looked, console)
    if preview is not None:
        console.data(f"preview: {preview}")
    if result.saved is not None:
        console.data(f"colour ranges written: {result.saved}")
    for remark in looked.remarks:
        console.warn(remark)
    if any(rod.measured for rod in result.rods) and not save and path is not None:
        console.hint(_typed("--save") + "   # writes the measured ranges into robot.toml")
    elif preview is None:
        console.hint(_typed("--preview", "see.html") + "   # what the camera sees; takes clicks on the caps")


def _typed(*more: str) -> str:
    """The command as typed, with more words."""
    return shlex.join(["r2s2r", "doctor", "camera", *typed_words("doctor")[2:], *more])


def _robot(project: Path | None, *, needed: bool) -> tuple[Path | None, Robot | None]:
    """The robot of the project; without a project none, unless it is needed."""
    from r2s2r_cli.store.project import Project

    try:
        here = Project.find(project)
    except R2S2RError:
        if needed or project is not None:
            raise
        return None, None
    return here.robot_path, here.robot()


def _take(device: Camera, count: int, console: Console) -> tuple[list[Frame], FeedStatistics]:
    """Up to `count` frames. Raises CameraError where none comes."""
    import time

    from r2s2r_cli.devices.camera import CameraEnded, CameraError
    from r2s2r_cli.hardware.camera.feed import Feed

    found: list[Frame] = []
    deadline = time.monotonic() + count / device.rate_hz + PATIENCE_S
    with Feed(device) as feed, console.progress("frames", count) as advance:
        while len(found) < count and time.monotonic() < deadline:
            try:
                more = feed.frames()[: count - len(found)]
            except CameraEnded:
                break
            found += more
            advance(len(more))
            time.sleep(0.01)
        statistics = feed.statistics
    if not found:
        raise CameraError(
            "the camera gives no frame", where=device.name, expected=f"{device.rate_hz:g} a second",
            received=f"none in {PATIENCE_S:g} s",
            hint="r2s2r doctor   # what can read a camera; look at its cable and at its own messages",
        )  # fmt: skip
    return found, statistics


def _draw(looked: Looked, device: Camera, target: Path, command: str) -> None:
    import numpy as np

    from r2s2r_cli.store.atomic import write_bytes
    from r2s2r_cli.views.camera_marks import marks_page
    from r2s2r_cli.views.camera_preview import draw_preview

    depth = looked.frame.depth
    z = np.where(depth > 0, depth * device.depth_scale, np.nan)
    title = f"{looked.result.name}, frame {looked.frame.number}"
    picture = draw_preview(looked.frame.color, z, looked.height, masks=looked.masks, title=title)
    if target.suffix.lower() in (".html", ".htm"):
        rods = [rod.rod for rod in looked.result.rods] or ["red", "green", "blue"]
        picture = marks_page(looked.frame.color, rods, command=command, preview=picture, title=title)
    write_bytes(target, picture)


def _save(path: Path, looked: Looked, marks: int) -> None:
    from r2s2r_cli.stages.calibrate.colors import with_colors
    from r2s2r_cli.store.atomic import write_text
    from r2s2r_cli.store.lock import writing_at
    from r2s2r_cli.store.toml import read_text

    ranges = [rod.range for rod in looked.result.rods if rod.measured and rod.range is not None]
    source = f"doctor camera, {looked.result.name}, {marks} marks"
    with writing_at(path, "doctor camera"):  # `calibrate` writes the same file
        write_text(path, with_colors(read_text(path), ranges, source=source))


def _show(looked: Looked, console: Console) -> None:
    said = looked.result
    size = f"{said.width} x {said.height} px"
    focal = f"fx {said.fx:.2f}, fy {said.fy:.2f}, cx {said.cx:.2f}, cy {said.cy:.2f} px (pixel centres at u + 0.5)"
    pace = f"{said.frames} at {said.rate_hz:.2f} a second ({said.rate_stated_hz:g} stated)"
    facts = [
        ("camera", said.name),
        ("picture", f"{size}, {focal}"),
        ("distortion", " ".join(f"{k:.4g}" for k in said.distortion) or "none: the pictures are rectified"),
        ("depth", f"{1000 * said.depth_scale_m:g} mm a count, {said.depth_unknown:.1%} of the pixels unknown"),
        ("frames", f"{pace}, {said.lost} lost, {said.repeated} repeated"),
        ("clock", f"{said.clock_offset_s:.3f} s from the host's, {1000 * said.clock_spread_s:.1f} ms of spread"),
        ("ground", _ground(said.ground)),
    ]
    console.table("", ["what", "found"], facts)
    rows = [
        [rod.rod, "-" if rod.range is None else f"{rod.range.hue[0]:g} .. {rod.range.hue[1]:g}",
         "-" if rod.range is None else f"{rod.range.saturation_min:g}",
         "-" if rod.range is None else f"{rod.range.value_min:g}", "measured" if rod.measured else "robot.toml",
         str(rod.pixels), str(rod.patches), f"{rod.with_depth:.0%}", str(rod.distractors)]
        for rod in said.rods
    ]  # fmt: skip
    if rows:
        console.table("", ["rod", "hue", "saturation", "value", "from", "pixels", "caps seen", "with depth",
                           "on the ground"], rows)  # fmt: skip


def _ground(ground: CameraGround | None) -> str:
    if ground is None:
        return "not found"
    place = f"{ground.distance_m:.3f} m away, tilted by {math.degrees(ground.tilt_rad):.2f} degrees"
    return f"{place}, {ground.inlier_share:.0%} of the depths on it, noise {1000 * ground.noise_sd_m:.1f} mm"


def _click(text: str) -> Box:
    from r2s2r_cli.stages.doctor.colors import Box

    match = _CLICK.fullmatch(text.strip())
    if match is None:
        raise UsageError("this marks no pixel", where="--click", expected="ROD:U,V", received=text,
                         hint="--click red:320,240")  # fmt: skip
    return Box.clicked(match[1], int(match[2]), int(match[3]))


def _box(text: str) -> Box:
    from r2s2r_cli.stages.doctor.colors import Box

    match = _BOX.fullmatch(text.strip())
    u0, v0, u1, v1 = (int(match[k]) for k in range(2, 6)) if match else (0, 0, 0, 0)
    if match is None or not (u0 < u1 and v0 < v1):
        raise UsageError("this is no box", where="--box", expected="ROD:U0,V0,U1,V1 with U0 < U1 and V0 < V1",
                         received=text, hint="--box red:310,230,330,250")  # fmt: skip
    return Box(match[1], u0, v0, u1, v1)
