"""One imported run as values, and what every format has in common."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import Blobs, Group, Scalar
from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.frames import BACKWARDS, DUPLICATE, KEPT, NOT_FINITE, holes, noise_sd, stamp_jitter
from r2s2r_cli.stages.import_.files import shown
from schemas.results_import import CapNoise, DroppedFrames, ImportReport, TimeGap

RUN_NAME = r"[A-Za-z0-9][\w.+-]*"
"""As in `schemas.base`: a run is a group of the artifact."""
MAX_GAPS = 10
MAX_BACKWARDS = 0.5
"""Share of frames behind the clock beyond which the stamps are not the stamps of one run."""
NO_NATURE = 'the sidecar does not state the nature of the data: add nature = "measured" or "simulated"'
HELD = 0.2
"""A coordinate quieter than this share of the median noise was held by the source, not measured."""


@dataclass(frozen=True)
class ImportedRun:
    """One run of a recording: groups by stream (`caps`, `commands`; the run itself under ''), and the report."""

    name: str
    groups: Mapping[str, Group]
    report: ImportReport
    files: tuple[Path, ...]
    """What was read: the log or folder, and its sidecar where there is one."""


def run_name(source: Path) -> str:
    """Name of the run: stem of a file, name of a folder. Raises InputError where it cannot name a group."""
    absolute = source.absolute()
    name = absolute.stem if absolute.is_file() else absolute.name
    if re.fullmatch(RUN_NAME, name) is None:
        simple = re.sub(r"[^\w.+-]+", "-", name).lstrip("_.+-") or "run"
        simple += source.suffix if absolute.is_file() else ""
        raise InputError(
            f"the name {shown(name)} cannot name a run",
            where=str(source),
            expected="a letter or digit, then letters, digits, '.', '+', '-', '_'",
            received=shown(name),
            hint=f"mv {quoted(source)} {quoted(source.parent / simple)}",
        )
    return name


def dropped_frames(reason: np.ndarray) -> DroppedFrames:
    """Counts of a drop_reason array."""
    return DroppedFrames(
        duplicate=int((reason == DUPLICATE).sum()),
        backwards=int((reason == BACKWARDS).sum()),
        not_observed=int((reason == NOT_FINITE).sum()),
    )


def check_clock(t: np.ndarray, reason: np.ndarray, where: str) -> list[str]:
    """Warnings about stamps that run backwards; InputError where most of them do, or where nothing is left."""
    backwards = np.flatnonzero(reason == BACKWARDS)
    if not (reason == KEPT).any():
        raise InputError(
            "no frame is left",
            where=where,
            expected="at least one frame with a stamp and all end caps",
            received=f"{len(reason)} frames, none of them observed",
            hint="look at the cells that say nan: a frame counts only with all its caps",
        )
    if len(backwards) > MAX_BACKWARDS * len(reason):
        raise InputError(
            "time runs backwards in most frames",
            where=f"{where}, frame {backwards[0] + 1}",
            expected="stamps in the order of time",
            received=f"{len(backwards)} of {len(reason)} frames, the first at {t[backwards[0]]:g} s",
            hint="sort the rows by time, or split the file where a new run begins",
        )
    if len(backwards):
        first = int(backwards[0])
        return [f"{len(backwards)} frames run backwards in time, the first at {t[first]:.3f} s: left out"]
    return []


@dataclass(frozen=True)
class TimeFacts:
    """What ImportReport says about the stamps of the kept frames [s]."""

    duration: float
    gap_median: float | None
    jitter: float | None
    gaps: tuple[TimeGap, ...]


def time_facts(t_kept: np.ndarray) -> TimeFacts:
    """Duration, typical gap, jitter and holes of kept stamps [s]."""
    jitter = stamp_jitter(t_kept)
    return TimeFacts(
        duration=float(t_kept[-1] - t_kept[0]),
        gap_median=float(np.median(np.diff(t_kept))) if len(t_kept) > 1 else None,
        jitter=jitter if np.isfinite(jitter) else None,
        gaps=tuple(TimeGap(after_s=after, length_s=length) for after, length in holes(t_kept)[:MAX_GAPS]),
    )


def cap_noise(t: np.ndarray, p_WE: np.ndarray) -> tuple[np.ndarray, CapNoise | None]:
    """Noise per cap and axis [m] of kept frames, and its summary (None with too few frames)."""
    sd = noise_sd(t, p_WE)
    if not np.isfinite(sd).all():
        return sd, None
    quiet = sd < HELD * np.median(sd)
    measured = sd[~quiet]
    names = tuple(f"cap{cap} {'xyz'[axis]}" for cap, axis in np.argwhere(quiet))
    rows = tuple((float(x), float(y), float(z)) for x, y, z in sd)
    return sd, CapNoise(
        sd_m=rows,
        low_m=float(measured.min()),
        median_m=float(np.median(measured)),
        high_m=float(measured.max()),
        held=names,
    )


def finite_attributes(**values: float | None) -> dict[str, Scalar]:
    """Those attributes that are known and finite."""
    return {name: value for name, value in values.items() if value is not None and np.isfinite(value)}


def stream_sizes(groups: Mapping[str, Group]) -> dict[str, int]:
    """Samples a stream, by the length of its time axis; images by their number."""
    sizes: dict[str, int] = {}
    for stream, group in groups.items():
        if not stream or stream in ("intervals", "segments"):
            continue
        for name, value in group.datasets.items():
            if isinstance(value, Blobs):
                sizes[f"{stream}/{name}"] = value.count
            elif name == "t" and stream != "camera":
                sizes[stream] = len(group[name])
    return sizes
