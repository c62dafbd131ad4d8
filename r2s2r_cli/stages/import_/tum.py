"""TUM RGB-D: `rgb.txt depth.txt` (stamp file) and, where there is one, `groundtruth.txt` -> one run without a robot.

Format: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages import frames
from r2s2r_cli.stages.import_.camera_config import check_depth_scale
from r2s2r_cli.stages.import_.files import MAX_CSV_BYTES, decode, read_source, shown
from r2s2r_cli.stages.import_.images import check_images, frame_blobs
from r2s2r_cli.stages.import_.run import NO_NATURE, check_clock, dropped_frames, stream_sizes, time_facts
from r2s2r_cli.stages.import_.sidecar import check_sidecar, run_attributes
from schemas.results_import import ImportReport
from schemas.robot import Robot
from schemas.sidecar import Sidecar

RGB, DEPTH, POSES = "rgb.txt", "depth.txt", "groundtruth.txt"
DEPTH_SCALE_M = 1.0 / 5000.0
"""Fixed by the format."""
MAX_PAIR_S = 0.02
"""Colour and depth farther apart are no pair (the format's own tools)."""
_UNIT_TOLERANCE = 1e-2
"""The format prints quaternions with four decimals."""
_MAX_STAMP_S = 1e11


@dataclass(frozen=True)
class _Lines:
    """Lines of a list file: their stamps [s], and the words behind them."""

    stamp: np.ndarray
    words: list[list[str]]
    line: list[int]


def import_tum(
    folder: Path,
    name: str,
    *,
    robot: Robot,
    sidecar: Sidecar,
    depth_scale: float | None = None,
    known_robots: Sequence[str] = (),
) -> tuple[dict[str, Group], ImportReport]:
    """Groups of one run by stream (the run itself under ''), and the report.

    Colour and depth are paired by nearest stamp, one to one, at most 20 ms apart; both streams are stored whole.
    Stamps of the format are wall-clock time. depth_scale [m a count] replaces the format's 1/5000. The intrinsics
    are not part of the format, and are not guessed. Raises InputError.
    """
    check_sidecar(sidecar, robot, str(folder), known_robots)
    color, color_paths, left_color = _images(folder, RGB)
    depth, depth_paths, left_depth = _images(folder, DEPTH)
    size = check_images(color_paths, depth_paths)
    poses = _poses(folder)
    reason = frames.keep_frames(color)
    warnings = check_clock(color, reason, str(folder / RGB))
    start = float(min(color[0], depth[0]))
    pair = associate(color, depth, MAX_PAIR_S)
    attributes = run_attributes(sidecar, robot, "tum_rgbd") | {"start_unix": start}
    scale = DEPTH_SCALE_M if depth_scale is None else check_depth_scale(depth_scale, "--depth-scale")
    groups = {
        "": Group(attributes=attributes),
        "camera": Group(
            datasets={
                "t": color - start,
                "color": frame_blobs(color_paths, "the colour frame"),
                "t_depth": depth - start,
                "depth": frame_blobs(depth_paths, "the depth frame"),
                "pair": pair,
            },
            attributes={"width": size[0], "height": size[1], "depth_scale": scale},
        ),
    }
    if poses is not None:
        t, p_WC, q_WC = poses
        groups["camera_pose"] = Group(datasets={"t": t - start, "p_WC": p_WC, "q_WC": q_WC})
    kept = reason == frames.KEPT
    facts = time_facts(color[kept] - start)
    for file, count in ((RGB, left_color), (DEPTH, left_depth)):
        if count:
            warnings.append(f"{count} lines of {file} do not rise in time: left out")
    if sidecar.nature is None:
        warnings.append(NO_NATURE)
    unpaired = int((pair < 0).sum())
    report = ImportReport(
        run=name,
        format="tum_rgbd",
        robot=robot.name,
        nature=str(attributes["nature"]),
        source=sidecar.source,
        rows=len(color) + left_color,
        kept=int(kept.sum()),
        dropped=dropped_frames(reason),
        duration_s=facts.duration,
        frame_gap_median_s=facts.gap_median,
        stamp_jitter_s=facts.jitter,
        gaps=facts.gaps,
        intervals=0,
        intervals_complete=0,
        segments=0,
        streams=stream_sizes(groups),
        missing={"depth partner": unpaired} if unpaired else {},
        warnings=tuple(warnings),
    )
    return groups, report


def associate(t_color: np.ndarray, t_depth: np.ndarray, tolerance: float) -> np.ndarray:
    """Depth frame of each colour frame, -1 for none; int64, shape (colour frame,).

    Pairs are given away one to one in the order of their difference in time, at most `tolerance` [s]; equal
    differences go to the earlier colour frame. Both inputs rise strictly [s].
    """
    first = np.searchsorted(t_depth, t_color - tolerance, side="left")
    last = np.searchsorted(t_depth, t_color + tolerance, side="right")
    near = [(abs(t_depth[j] - t_color[i]), i, j) for i in range(len(t_color)) for j in range(first[i], last[i])]
    pair = np.full(len(t_color), -1, dtype=np.int64)
    taken: set[int] = set()
    for _, i, j in sorted(near):
        if pair[i] < 0 and j not in taken:
            pair[i] = j
            taken.add(j)
    return pair


def _images(folder: Path, list_name: str) -> tuple[np.ndarray, list[Path], int]:
    """Stamps and files of a list, strictly rising in time, and the number of lines left out for that."""
    lines = _read_list(folder / list_name, words=1)
    if not len(lines.stamp):
        raise InputError(
            f"{list_name} lists no image",
            where=str(folder / list_name),
            expected="lines: stamp filename",
            received="comments only",
            hint=f"cat {quoted(folder / list_name)}",
        )
    paths = []
    for line, (file,) in zip(lines.line, lines.words, strict=True):
        relative = PurePosixPath(file)
        if relative.is_absolute() or ".." in relative.parts or not file.isprintable():
            raise InputError(
                "a list names a file outside its folder, or with unprintable characters",
                where=f"{folder / list_name}:{line}",
                expected="a plain path below the folder",
                received=shown(file),
                hint="copy the images into the folder, and correct the list",
            )
        paths.append(folder / relative)
    highest = np.maximum.accumulate(np.concatenate([[-np.inf], lines.stamp[:-1]]))
    rising = lines.stamp > highest
    return lines.stamp[rising], [path for path, good in zip(paths, rising, strict=True) if good], int((~rising).sum())


def _poses(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Stamps [s], positions [m] and unit quaternions xyzw of groundtruth.txt; None where it is absent."""
    path = folder / POSES
    if not path.exists() and not path.is_symlink():
        return None
    lines = _read_list(path, words=7)
    table = np.array(
        [
            [_finite(word, f"{path}:{line}") for word in words]
            for line, words in zip(lines.line, lines.words, strict=True)
        ]
    ).reshape(-1, 7)
    norm = np.linalg.norm(table[:, 3:], axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > _UNIT_TOLERANCE)
    if len(bad):
        raise InputError(
            "a quaternion has not the length 1",
            where=f"{path}:{lines.line[bad[0]]}",
            expected="stamp tx ty tz qx qy qz qw",
            received=f"length {norm[bad[0]]:.3g}",
            hint=f"sed -n {lines.line[bad[0]]}p {quoted(path)}",
        )
    falling = np.flatnonzero(np.diff(lines.stamp) <= 0)
    if len(falling):
        raise InputError(
            "the poses are not in the order of time",
            where=f"{path}:{lines.line[falling[0] + 1]}",
            expected="stamps that rise",
            received=f"{lines.stamp[falling[0] + 1]:.6f} after {lines.stamp[falling[0]]:.6f}",
            hint=f"grep -v '^#' {quoted(path)} | sort -n -u > sorted.txt",
        )
    return lines.stamp, table[:, :3], table[:, 3:] / norm[:, None]


def _read_list(path: Path, *, words: int) -> _Lines:
    """Stamp and words of each line; `#` begins a comment line."""
    text = decode(read_source(path, path.name, limit=MAX_CSV_BYTES), path.name, str(path))
    stamps, rest, numbers = [], [], []
    for number, line in enumerate(text.splitlines(), start=1):
        parts = line.replace(",", " ").split()
        if not parts or parts[0].startswith("#"):
            continue
        if len(parts) != words + 1:
            raise InputError(
                f"a line of {path.name} has not {words + 1} words",
                where=f"{path}:{number}",
                expected="stamp filename" if words == 1 else "stamp tx ty tz qx qy qz qw",
                received=shown(line.strip()),
                hint=f"sed -n {number}p {quoted(path)}",
            )
        stamps.append(_finite(parts[0], f"{path}:{number}"))
        rest.append(parts[1:])
        numbers.append(number)
    return _Lines(stamp=np.array(stamps, dtype=np.float64), words=rest, line=numbers)


def _finite(word: str, where: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not abs(value) <= _MAX_STAMP_S or "_" in word:
        raise InputError(
            "a value is not a number",
            where=where,
            expected="a finite decimal number",
            received=shown(word),
            hint="correct the line, or take it out",
        )
    return value
