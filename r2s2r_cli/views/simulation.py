"""Picture of a simulated run: instants in three dimensions, path, cap heights, tensions, cable lengths and targets."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.estimate import centre_of_mass, draw_path
from r2s2r_cli.views.figure import CAP_STYLE, draw_bands, legend_below, legend_beside, new_figure, png_bytes, rod_color
from r2s2r_cli.views.simulation_scene import SLACK_N, draw_scene, instant, scene_reach, tension_color
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

INSTANTS = 5
_LENGTH, _COMMAND = "#0b5fa5", "#d4380d"
_SLACK = "#e9ecf0"
_TOP_SHARE = 99.5
"""Percentile of all tensions that has the strongest colour: single peaks of impacts would make the rest pale."""


def draw_simulation(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run of a simulation."""
    for run in data.runs():
        yield run, _picture(data, run, robot)


def strongest(frames: Group) -> float:
    """The tension that has the strongest colour [N]."""
    return max(float(np.percentile(frames["tension"], _TOP_SHARE)), 10 * SLACK_N)


def instants(data: ArtifactData, run: str) -> list[int]:
    """Frames worth a look: the first, the last, and ends of target intervals spread evenly between them."""
    frames, intervals = data.groups[f"runs/{run}/frames"], data.group(run, "intervals")
    last = len(frames["t"]) - 1
    keys = np.arange(last + 1) if intervals is None or not len(intervals["last"]) else intervals["last"]
    keys = np.unique(np.concatenate([[0], keys, [last]]))
    picked = keys[np.linspace(0, len(keys) - 1, min(INSTANTS, len(keys))).round().astype(int)]
    return [int(frame) for frame in np.unique(picked)]


def _picture(data: ArtifactData, run: str, robot: Robot) -> bytes:
    frames, intervals = data.groups[f"runs/{run}/frames"], data.group(run, "intervals")
    facts = data.groups[f"runs/{run}"].attributes
    figure = new_figure(15, 18)
    figure.suptitle(f"run {run}: simulated, {facts['control']}, policy {facts['policy']} ({facts['engine']})")
    strip, middle, bottom = np.asarray(figure.subfigures(3, 1, height_ratios=(0.9, 2, 2.1)))
    _strip(strip, data, run, robot)
    grid = middle.add_gridspec(2, 2, width_ratios=(1, 1.5))
    draw_path(middle.add_subplot(grid[:, 0]), frames, data, run, robot)
    heights, tensions = middle.add_subplot(grid[0, 1]), middle.add_subplot(grid[1, 1])
    draw_bands(heights, intervals)
    _heights(heights, frames, robot)
    _tensions(middle, tensions, frames, robot)
    _lengths(bottom, data, run, robot)
    return png_bytes(figure)


def _strip(figure: SubFigure, data: ArtifactData, run: str, robot: Robot) -> None:
    frames = data.groups[f"runs/{run}/frames"]
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    com = centre_of_mass(frames, robot)[:, :2]
    picked = instants(data, run)
    reach = scene_reach(frames["p_WE"][picked])
    for axes, frame in zip(np.atleast_1d(figure.subplots(1, len(picked))), picked, strict=True):
        draw_scene(
            axes, instant(frames, robot, frame), radius, top=strongest(frames), reach=reach, path=com[: frame + 1]
        )
        axes.set_title(f"{frames['t'][frame]:.2f} s", fontsize=10)
    figure.suptitle(
        "grid 0.1 m; cables: blue to red by tension, grey and hanging where slack; orange: caps that the ground pushes",
        fontsize=9,
    )


def _heights(axes: Axes, frames: Group, robot: Robot) -> None:
    t, z, contact = frames["t"], 1e3 * frames["p_WE"][:, :, 2], frames["contact"]
    top = float(np.max(z))
    step = 0.07 * top
    for cap in range(z.shape[1]):
        axes.plot(t, z[:, cap], CAP_STYLE[cap % 2], lw=1, color=rod_color(cap), label=f"cap {cap}")
        touching = t[contact[:, cap]]
        axes.plot(touching, np.full(len(touching), -step * (cap + 1)), "s", ms=3, color=rod_color(cap), mec="none")
    axes.plot([], [], "s", ms=3, color="gray", label="in contact")
    axes.axhline(1e3 * robot.rods[0].cap_radius_m, color="black", lw=0.8, ls=":", label="on the ground")
    axes.set(ylabel="height of cap centre [mm]\nbelow 0: contacts by cap", xlim=(t[0], t[-1]))
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= top])
    axes.set_ylim(-step * (z.shape[1] + 1), 1.08 * top)
    legend_beside(axes)


def _tensions(figure: SubFigure, axes: Axes, frames: Group, robot: Robot) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    t, tension, top = frames["t"], frames["tension"], strongest(frames)
    colors = ListedColormap([tension_color(share) for share in np.linspace(0, 1, 256)]).with_extremes(bad=_SLACK)
    scale = Normalize(0, top)
    shown = np.ma.masked_less(tension, SLACK_N)
    edges = np.concatenate([t[:1], (t[1:] + t[:-1]) / 2, t[-1:]])
    axes.pcolormesh(edges, np.arange(tension.shape[1] + 1) - 0.5, shown.T, cmap=colors, norm=scale)
    axes.set_yticks(
        range(tension.shape[1]),
        [f"cable {k}{'' if k in robot.actuated else ' (passive)'}" for k in range(tension.shape[1])],
        fontsize=8,
    )
    axes.invert_yaxis()
    axes.set(xlabel="time [s]", xlim=(t[0], t[-1]))
    bar = figure.colorbar(ScalarMappable(scale, colors), ax=axes, extend="max", pad=0.01)
    bar.set_label("tension [N], pale: slack")


def _lengths(figure: SubFigure, data: ArtifactData, run: str, robot: Robot) -> None:
    n = len(robot.cables)
    columns = math.ceil(math.sqrt(n))
    grid = figure.subplots(math.ceil(n / columns), columns, sharex=True, squeeze=False)
    order = [*robot.actuated, *(k for k in range(n) if k not in robot.actuated)]
    frames, commands = data.groups[f"runs/{run}/frames"], data.group(run, "commands")
    scale: dict[str, Axes] = {}
    panels: list[Axes] = []
    for place, (axes, cable) in enumerate(zip(grid.flat, order, strict=False)):
        first = scale.setdefault(robot.cables[cable].kind, axes)
        if first is not axes:
            axes.sharey(first)
        draw_bands(axes, data.group(run, "intervals"), numbers=False)
        axes.plot(frames["t"], 1e3 * frames["length"][:, cable], color=_LENGTH, lw=1.3, label="between cap centres")
        if cable in robot.actuated and commands is not None:
            _commanded(axes, commands, robot, robot.actuated.index(cable))
        a, b = robot.cables[cable].caps
        axes.set_title(f"cable {cable} (caps {a}-{b}{'' if cable in robot.actuated else ', passive'})", fontsize=9)
        if place % columns == 0:
            axes.set_ylabel("length [mm]")
        if place + columns >= n:
            axes.set_xlabel("time [s]")
            axes.tick_params(labelbottom=True)
        panels.append(axes)
    for axes in grid.flat[n:]:
        axes.set_axis_off()
    legend_below(figure, panels)


def _commanded(axes: Axes, commands: Group, robot: Robot, motor: int) -> None:
    """Target with tolerance where there is one, and the motor command along the lower edge."""
    t, pid = commands["t"], robot.pid
    target = 1e3 * (pid.min_length_m + pid.range_m * commands["target"][:, motor])
    reach = 1e3 * pid.range_m * pid.tolerance
    axes.fill_between(
        t, target - reach, target + reach, step="post", color="black", alpha=0.13, lw=0, label="tolerance"
    )
    axes.step(t, target, where="post", color="black", lw=1, label="target")
    if "control" in commands:
        control = np.nan_to_num(commands["control"][:, motor])
        low = axes.get_xaxis_transform()
        axes.fill_between(t, 0.1, 0.1 + 0.09 * control, step="post", transform=low, color=_COMMAND, alpha=0.55, lw=0,
                          label="motor command, up: reel in")  # fmt: skip
