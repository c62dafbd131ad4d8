"""One imported run as values, and what every format has in common."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
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


def run_name(source: Path) -> tuple[str, list[str]]:
    """Name of the run: stem of a file, name of a folder, as far as it can name a group; and a warning where it is
    another for that. The file keeps its own, and its sidecar lies beside it."""
    absolute = source.absolute()
    stem = absolute.stem if absolute.is_file() else absolute.name
    if re.fullmatch(RUN_NAME, stem):
        return stem, []
    name = re.sub(r"[^\w.+-]+", "-", stem).strip("_.+-") or "run"
    name = name if re.fullmatch(RUN_NAME, name) else f"run-{name}"
    return name, [f"called {name}, since {shown(stem)} cannot name a run: only letters, digits, '.', '+', '-', '_' can"]


def renamed(run: ImportedRun) -> str:
    """The command that gives a source of a run another free name of the same beginning, and its sidecar with it."""
    source = run.files[0] if run.files[0].name else run.files[0].absolute()
    ending = source.suffix if source.is_file() else ""
    for number in count(2):
        name = f"{run.name}-{number}"
        ways = [(source, source.with_name(name + ending))]
        ways += [(sidecar, sidecar.with_name(f"{name}.toml")) for sidecar in run.files[1:]]
        if not any(target.exists() for _, target in ways):
            break
    moves = " && ".join(f"mv -- {quoted(one)} {quoted(target)}" for one, target in ways)
    return f"{moves}   # then import {quoted(ways[0][1])}"


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
