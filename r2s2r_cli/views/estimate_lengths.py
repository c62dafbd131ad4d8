"""Cable lengths of an estimate over time, with targets and their tolerance, and what the sensors gave."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.figure import draw_bands, legend_below
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_LENGTH, _SENSOR = "#0b5fa5", "#b8860b"


def draw_lengths(figure: SubFigure, data: ArtifactData, run: str, robot: Robot) -> None:
    """One panel a cable, passive ones last; actuated and passive cables have a length scale each."""
    n = len(robot.cables)
    columns = math.ceil(math.sqrt(n))
    grid = figure.subplots(math.ceil(n / columns), columns, sharex=True, squeeze=False)
    order = [*robot.actuated, *(i for i in range(n) if i not in robot.actuated)]
    panels: list[Axes] = []
    scale: dict[str, Axes] = {}
    for place, (axes, cable) in enumerate(zip(grid.flat, order, strict=False)):
        first = scale.setdefault(robot.cables[cable].kind, axes)
        if first is not axes:
            axes.sharey(first)
        draw_bands(axes, data.group(run, "intervals"), numbers=False)
        _length(axes, data, run, cable)
        if cable in robot.actuated:
            _target(axes, data, run, robot, robot.actuated.index(cable))
        a, b = robot.cables[cable].caps
        kind = "" if cable in robot.actuated else ", passive"
        axes.set_title(f"cable {cable} (caps {a}-{b}{kind})", fontsize=9)
        if place % columns == 0:
            axes.set_ylabel("length [mm]")
        if place + columns >= n:
            axes.set_xlabel("time [s]")
            axes.tick_params(labelbottom=True)
        panels.append(axes)
    for axes in grid.flat[n:]:
        axes.set_axis_off()
    legend_below(figure, panels)


def _length(axes: Axes, data: ArtifactData, run: str, cable: int) -> None:
    frames = data.groups[f"runs/{run}/frames"]
    t, length, sd = frames["t"], 1e3 * frames["length"][:, cable], 1e3 * frames["length_sd"][:, cable]
    axes.fill_between(t, length - 2 * sd, length + 2 * sd, color=_LENGTH, alpha=0.25, lw=0, label="2 sd")
    axes.plot(t, length, color=_LENGTH, lw=1.2, label="between cap centres")
    if "sensor_length" in frames:
        for column in np.flatnonzero(frames["sensor_cable"] == cable):
            axes.plot(t, 1e3 * frames["sensor_length"][:, column], ".", ms=2.5, color=_SENSOR, label="sensor")


def _target(axes: Axes, data: ArtifactData, run: str, robot: Robot, motor: int) -> None:
    commands = data.group(run, "commands")
    if commands is None:
        return
    facts = data.groups[f"runs/{run}"].attributes
    low = float(facts.get("pid_min_length", robot.pid.min_length_m))
    span = float(facts.get("pid_range", robot.pid.range_m))
    reach = 1e3 * span * float(facts.get("pid_tolerance", robot.pid.tolerance))
    target = 1e3 * (low + span * commands["target"][:, motor])
    axes.fill_between(commands["t"], target - reach, target + reach, step="post", color="black", alpha=0.13, lw=0,
                      label="tolerance")  # fmt: skip
    axes.step(commands["t"], target, where="post", color="black", lw=1, label="target")
