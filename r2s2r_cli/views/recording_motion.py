"""End caps and commands of a run as recorded: heights, targets and controls, gaps between stamps, the top view."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import CAP_STYLE, draw_bands, draw_rods, legend_beside, rod_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

MOTION_HEIGHT = 7.5
"""[inches]"""
COMMANDS_HEIGHT = 3.4
"""Of targets and controls alone [inches]."""
_DROPPED = "#888888"
_SPAN = 0.8
"""Share of a cable's row that positions 0 to 1 take."""


def draw_motion(figure: SubFigure, data: ArtifactData, run: str, radius: float) -> None:
    """Draws a run with end caps into `figure`. radius: height of a resting cap centre [m]."""
    caps, intervals = data.groups[f"runs/{run}/caps"], data.group(run, "intervals")
    grid = figure.add_gridspec(3, 2, width_ratios=(2, 1.2))
    heights, targets, gaps = (figure.add_subplot(grid[i, 0]) for i in range(3))
    for axes in (heights, gaps):
        draw_bands(axes, intervals)
    _heights(heights, caps, radius)
    draw_commands(targets, data, run)
    _gaps(gaps, caps)
    gaps.set_xlabel("time [s]")
    _top_view(figure.add_subplot(grid[:, 1]), caps)


def draw_commands(axes: Axes, data: ArtifactData, run: str) -> None:
    """Targets and controls of a run over time, where it has any."""
    commands, tolerance = data.group(run, "commands"), data.groups[f"runs/{run}"].attributes.get("pid_tolerance")
    draw_bands(axes, data.group(run, "intervals"))
    if commands is not None:
        _targets(axes, commands, None if tolerance is None else float(tolerance))


def _heights(axes: Axes, caps: Group, radius: float) -> None:
    kept = caps["drop_reason"] == 0
    for i in range(caps["p_WE"].shape[1]):
        axes.plot(caps["t"][kept], 1e3 * caps["p_WE"][kept, i, 2], CAP_STYLE[i % 2], lw=1, color=rod_color(i),
                  label=f"cap {i}")  # fmt: skip
    axes.axhline(1e3 * radius, color="black", lw=0.8, ls=":", label="resting\non z = 0")
    axes.set_ylabel("cap height [mm]")
    legend_beside(axes)


def _targets(axes: Axes, commands: Group, tolerance: float | None) -> None:
    t, target = commands["t"], commands["target"]
    for i in range(target.shape[1]):
        first = i == 0
        line = target[:, i] * _SPAN + i
        if tolerance is not None:
            reach = tolerance * _SPAN
            axes.fill_between(t, line - reach, line + reach, step="post", color="black", alpha=0.15, lw=0,
                              label=f"tolerance\n± {tolerance:g}" if first else None)  # fmt: skip
        axes.step(t, line, where="post", color="black", lw=1, label="target,\n0 to 1" if first else None)
        if "control" in commands:
            axes.fill_between(t, i, i + 0.4 * np.nan_to_num(commands["control"][:, i]), step="post", color="#0b5fa5",
                              alpha=0.4, lw=0, label="control,\nup: reel in" if first else None)  # fmt: skip
    axes.set_yticks(range(target.shape[1]), [f"cable {i}" for i in range(target.shape[1])])
    axes.set_ylabel("targets and controls")
    legend_beside(axes)


def _gaps(axes: Axes, caps: Group) -> None:
    t, kept = caps["t"], caps["drop_reason"] == 0
    if len(t) < 2:
        return
    step = 1e3 * np.diff(t)
    axes.plot(t[1:][kept[1:]], step[kept[1:]], ".", ms=4, color="black", label="kept")
    axes.plot(t[1:][~kept[1:]], step[~kept[1:]], "x", ms=4, color=_DROPPED, label="dropped")
    axes.set_ylabel("gap to the row before [ms]")
    legend_beside(axes)


def _top_view(axes: Axes, caps: Group) -> None:
    p_WE = caps["p_WE"][caps["drop_reason"] == 0]
    if not len(p_WE):
        return
    path = p_WE.mean(axis=1)
    draw_rods(axes, p_WE)
    axes.plot(path[:, 0], path[:, 1], color="black", lw=1.2)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(
        "from above: first kept frame pale, last one full,\nblack: path of the mean of the caps", fontsize=10
    )
