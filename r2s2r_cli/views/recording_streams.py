"""Sensors, motors, inertial units and the path of a camera over time, each where the run has it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import BLUE, GREEN, ORANGE, PURPLE, RED, draw_bands, legend_beside

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_PANEL_HEIGHT = 1.8
"""[inches]"""
_COLORS = (BLUE, RED, GREEN, PURPLE, "#000000", ORANGE, "#56b4e9", "#7f7f7f", "#7a4b12")
"""The first seven are Okabe and Ito's, which colour-blind people can tell apart."""
_SOLID = 6
"""From the seventh line on dashed."""
_GAP_S = 0.5
_FEW = 60
"""Lines of more points have no dots: they would fill the gaps of the dashes."""


@dataclass(frozen=True)
class Panel:
    """One diagram over time: lines with their names."""

    title: str
    t: Sequence[np.ndarray]
    """Times of each line [s]."""
    lines: Sequence[np.ndarray]
    names: Sequence[str]


def panels(data: ArtifactData, run: str) -> list[Panel]:
    """What can be drawn of a run beside its end caps, commands and images."""
    return list(_panels(data, run))


def streams_height(drawn: Sequence[Panel]) -> float:
    """[inches]"""
    return _PANEL_HEIGHT * len(drawn) + 0.3


def draw_streams(
    figure: SubFigure, drawn: Sequence[Panel], intervals: Group | None, *,
    above: Callable[[Axes], None] | None = None, above_height: float = _PANEL_HEIGHT,
) -> None:  # fmt: skip
    """Draws the panels into `figure`, one above the other, with one axis of time. above: draws another diagram over
    time, of that height [inches], over them."""
    heights = [*([above_height] if above is not None else []), *[_PANEL_HEIGHT] * len(drawn)]
    every = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    if above is not None:
        above(every[0])
    for axes, panel in zip(every[len(heights) - len(drawn) :], drawn, strict=True):
        draw_bands(axes, intervals)
        for i, (t, line, name) in enumerate(zip(*received(panel), panel.names, strict=True)):
            style, marker = ("-", "--", ":")[i // _SOLID % 3], "." if len(t) <= _FEW else ""
            axes.plot(t, line, style, marker=marker, ms=3, lw=1, color=_COLORS[i % len(_COLORS)], label=name)
        axes.set_ylabel(panel.title, fontsize=9)
        legend_beside(axes, ncol=1 + (len(panel.lines) > 9))
    axes.set_xlabel("time [s]")


def received(panel: Panel) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Times and values of each line without the rows in which others alone were received; cut in two where nothing was
    for longer than _GAP_S, and than three samples usually take."""
    times, lines = list[np.ndarray](), list[np.ndarray]()
    for t, line in zip(panel.t, panel.lines, strict=True):
        there = np.isfinite(line)
        step = np.diff(t[there])
        cuts = np.flatnonzero(step > max(_GAP_S, 3.0 * float(np.median(step)) if len(step) else 0.0)) + 1
        times.append(np.insert(t[there].astype(float), cuts, np.nan))
        lines.append(np.insert(line[there].astype(float), cuts, np.nan))
    return times, lines


def _panels(data: ArtifactData, run: str) -> Iterator[Panel]:
    motors, commands = data.group(run, "motors"), data.group(run, "commands")
    drawn_already = {"speed"} if commands is not None and "control" in commands else set()
    if motors is not None:
        for name, title, scale in (
            ("position", "cable position\nseen by the controller", 1.0),
            ("speed", "speed command,\n+1 reels in", 1.0),
            ("encoder_length", "encoder length [mm]", 1e3),
        ):
            if name in motors and name not in drawn_already:
                yield from _columns(motors["t"], scale * motors[name], title, "motor")
        if "voltage" in motors:
            yield from _columns(motors["t"], motors["voltage"][:, None], "battery [V]", "battery")
    sensors = data.group(run, "sensors")
    if sensors is not None:
        for name, title, scale in (
            ("length", "sensor length [mm]\n(source's calibration)", 1e3), ("capacitance", "capacitance [pF]", 1e12),
        ):  # fmt: skip
            if name in sensors:
                yield from _columns(sensors["t"], scale * sensors[name], title, "sensor")
    imu = data.group(run, "imu")
    if imu is not None:
        boards = sorted(set(imu["board"].tolist()))
        rows = [imu["board"] == board for board in boards]
        size = np.linalg.norm(imu["a_B"], axis=1)
        names = [f"board {board}" for board in boards]
        yield Panel("specific force [m/s²]", [imu["t"][r] for r in rows], [size[r] for r in rows], names)
    link = data.group(run, "link")
    if link is not None:
        names = ["lost", "repeated", "corrupt", "late"]
        if any(link[name].any() for name in names):
            yield Panel("link, counts\nsince the start", [link["t"]] * 4, [link[name] for name in names], names)
    mocap = data.group(run, "mocap")
    if mocap is not None:
        yield from _columns(mocap["t"], 1e3 * mocap["p_ME"][:, :, 2], "motion capture,\nheight [mm]", "cap")
    pose = data.group(run, "camera_pose")
    if pose is not None:
        yield Panel("camera position [m]", [pose["t"]] * 3, list(pose["p_WC"].T), ["x", "y", "z"])


def _columns(t: np.ndarray, values: np.ndarray, title: str, what: str) -> Iterator[Panel]:
    """One panel of the columns of `values` (row, column); none where nothing was received."""
    if np.isfinite(values).any():
        yield Panel(title, [t] * values.shape[1], list(values.T), [f"{what} {i}" for i in range(values.shape[1])])
