"""The folder of the paper's authors: `color/0000.png depth/0000.png data/0000.json config.json` -> one run.

The JSON of a frame carries the stamp of the control message; colour and depth were joined to it within 100 ms
(ApproximateTime of the recorder), so the stamps of the images are uncertain by that much.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import Group, Value
from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages import frames
from r2s2r_cli.stages.import_.authors_json import parse_frame
from r2s2r_cli.stages.import_.authors_streams import build_streams
from r2s2r_cli.stages.import_.camera_config import camera_attributes
from r2s2r_cli.stages.import_.files import MAX_TEXT_BYTES, list_folder, read_source
from r2s2r_cli.stages.import_.images import check_images, frame_blobs
from r2s2r_cli.stages.import_.run import NO_NATURE, check_clock, dropped_frames, stream_sizes, time_facts
from r2s2r_cli.stages.import_.sidecar import check_sidecar, run_attributes
from r2s2r_cli.stages.segments import Intervals, Segments, segments, target_intervals
from schemas.results_import import ImportReport
from schemas.robot import Robot
from schemas.sidecar import Sidecar

CONFIG = "config.json"
SUFFIXES = {"data": (".json",), "color": (".png", ".jpg", ".jpeg"), "depth": (".png",)}
"""Folders of the layout, and what a frame's file may end in."""
UNIX_SINCE = 1e9
"""A ROS stamp above this is wall-clock time (2001); below it is a simulated clock."""


def import_authors_folder(
    folder: Path,
    name: str,
    *,
    robot: Robot,
    sidecar: Sidecar,
    depth_scale: float | None = None,
    known_robots: Sequence[str] = (),
) -> tuple[dict[str, Group], ImportReport]:
    """Groups of one run by stream (the run itself under ''), and the report.

    Images are checked by their headers and read from disk when the artifact is written. depth_scale: [m] a depth
    count, needed where config.json does not give it. The folder has no end caps in the world frame (`estimate`
    finds them in the images), so intervals count the kept frames of `commands`. Raises InputError.
    """
    check_sidecar(sidecar, robot, str(folder), known_robots)
    data, color, depth = (_numbered(folder / part, suffixes) for part, suffixes in SUFFIXES.items())
    if not data:
        raise InputError(
            "the folder has no frame",
            where=str(folder / "data"),
            expected="data/0000.json, data/0001.json, ...",
            received="no such file",
            hint=f"ls {quoted(folder / 'data')}",
        )
    everything = set(data) | set(color) | set(depth)
    missing = {part: len(everything - set(found)) for part, found in zip(SUFFIXES, (data, color, depth), strict=True)}
    numbers = np.array(sorted(data))
    records = [
        parse_frame(read_source(data[i], "the frame's JSON", limit=MAX_TEXT_BYTES), str(data[i]))
        for i in numbers.tolist()
    ]
    stamps = np.array([record.t for record in records])
    all_reasons = frames.keep_frames(stamps)
    warnings = check_clock(stamps, all_reasons, str(folder / "data"))
    rows = np.flatnonzero(frames.in_order(stamps, all_reasons))
    kept = all_reasons[rows] == frames.KEPT
    t = stamps[rows] - stamps[rows[0]]

    streams = build_streams([records[i] for i in rows.tolist()], t, robot, str(folder / "data"))
    # What the user writes into the sidecar wins over what the recorder wrote.
    attributes = streams.attributes | run_attributes(sidecar, robot, "authors_folder")
    if stamps[rows[0]] > UNIX_SINCE:
        attributes["start_unix"] = float(stamps[rows[0]])
    groups = {"": Group(attributes=attributes), **streams.groups}
    if any(number in color or number in depth for number in numbers[rows].tolist()):
        groups["camera"] = _camera(folder, numbers[rows].tolist(), t, color, depth, depth_scale)
    found = _intervals(groups, t, kept, float(attributes.get("pid_tolerance", 0.0)))
    if found is not None:
        groups |= {"intervals": found[0].to_group(), "segments": found[1].to_group()}
    facts = time_facts(t[kept])
    warnings += streams.warnings + ([NO_NATURE] if sidecar.nature is None else [])
    report = ImportReport(
        run=name,
        format="authors_folder",
        robot=robot.name,
        nature=str(attributes["nature"]),
        source=sidecar.source,
        rows=len(data),
        kept=int(kept.sum()),
        dropped=dropped_frames(all_reasons),
        duration_s=facts.duration,
        frame_gap_median_s=facts.gap_median,
        stamp_jitter_s=facts.jitter,
        gaps=facts.gaps,
        intervals=len(found[0]) if found else 0,
        intervals_complete=int(found[0].complete.sum()) if found else 0,
        segments=len(found[1]) if found else 0,
        noise_sd_stated_m=sidecar.noise_sd_m,
        rod_length_robot_m=tuple(rod.length_m for rod in robot.rods),
        streams=stream_sizes(groups),
        missing={what: count for what, count in (missing | streams.missing).items() if count},
        warnings=tuple(warnings),
    )
    return groups, report


def _numbered(folder: Path, suffixes: tuple[str, ...]) -> dict[int, Path]:
    """Files of a folder by their number; an absent folder is empty, two files of one number an error."""
    if not folder.exists() and not folder.is_symlink():
        return {}
    found: dict[int, Path] = {}
    for name in list_folder(folder, f"the folder {folder.name}"):
        match = re.fullmatch(r"(\d{1,9})(\.\w+)", name, re.ASCII)
        if match is None or match[2].lower() not in suffixes:
            continue
        number = int(match[1])
        if number in found:
            raise InputError(
                f"frame {number} stands twice",
                where=str(folder / name),
                expected="one file a number",
                received=f"also {found[number].name}",
                hint=f"take one away: ls {quoted(folder)}",
            )
        found[number] = folder / name
    return dict(sorted(found.items()))


def _camera(
    folder: Path,
    numbers: list[int],
    t: np.ndarray,
    color: dict[int, Path],
    depth: dict[int, Path],
    depth_scale: float | None,
) -> Group:
    """The group `camera`. An image without its JSON has no time, and is left out (counted as missing data)."""
    with_color = [row for row, number in enumerate(numbers) if number in color]
    with_depth = [row for row, number in enumerate(numbers) if number in depth]
    color_files = [color[numbers[row]] for row in with_color]
    depth_files = [depth[numbers[row]] for row in with_depth]
    size = check_images(color_files, depth_files)
    path = folder / CONFIG
    present = path.exists() or path.is_symlink()
    config = read_source(path, "the camera configuration", limit=MAX_TEXT_BYTES) if present else None
    attributes, X_WC = camera_attributes(
        config, str(path), size=size, depth_scale=depth_scale, has_depth=bool(depth_files)
    )
    partner = {row: i for i, row in enumerate(with_depth)}
    datasets: dict[str, Value] = {}
    if with_color:
        datasets |= {
            "t": t[with_color],
            "color": frame_blobs(color_files, "the colour frame"),
            "source_frame": np.array([numbers[row] for row in with_color], dtype=np.int64),
            "pair": np.array([partner.get(row, -1) for row in with_color], dtype=np.int64),
        }
    if with_depth:
        datasets |= {"t_depth": t[with_depth], "depth": frame_blobs(depth_files, "the depth frame")}
    if X_WC is not None:
        datasets["X_WC"] = X_WC
    return Group(datasets=datasets, attributes=attributes)


def _intervals(
    groups: dict[str, Group], t: np.ndarray, kept: np.ndarray, tolerance: float
) -> tuple[Intervals, Segments] | None:
    """Target intervals and segments over the kept frames of `commands`; None where there are no commands."""
    if "commands" not in groups:
        return None
    commands, motors = groups["commands"], groups["motors"]
    control = commands["control"][kept] if "control" in commands else None
    intervals = target_intervals(
        t[kept],
        commands["target"][kept],
        control=control,
        position=motors["position"][kept],
        tolerance=tolerance,
    )
    return intervals, segments(intervals, t[kept], control)
