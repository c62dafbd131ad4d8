"""Pictures of a plan: every behaviour's best gait from above, the long policies, and what the gaits are worth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.estimate import centre_of_mass
from r2s2r_cli.views.figure import draw_rods, legend_below, new_figure, png_bytes, rod_color
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PATH, _AXIS, _BAR, _NOMINAL = "#1c2430", "#d48806", "#3b6ea5", "#d4380d"
_UNITS = {"forward": ("mm", 1e3), "backward": ("mm", 1e3), "clockwise": ("deg", 180 / math.pi),
          "counterclockwise": ("deg", 180 / math.pi)}  # fmt: skip
"""How rewards of the four behaviours are told to people."""


def draw_plan(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, str, bytes]]:
    """(name, title, PNG): the best gaits, the long policies where there are any, the scores."""
    table = data.groups["primitives"]
    names, behaviours = words(table["name"]), words(table["behaviour"])
    best = list({behaviour: names[k] for k, behaviour in reversed(list(enumerate(behaviours)))}.values())[::-1]
    yield "gaits", "the best gait of every behaviour, from above", _above(data, best, robot, steps=True)
    if "long" in data.groups:
        long = words(data.groups["long"]["name"])
        yield "policies", "long policies, from above", _above(data, long, robot, steps=False)
    yield "scores", "what the gaits are worth", _scores(table)


def words(column: np.ndarray) -> list[str]:
    """Text of a dataset."""
    return [value.decode() for value in column.tolist()]


def told(behaviour: str, value: float) -> str:
    """A reward with its unit; of a user's behaviour the bare number."""
    unit, factor = _UNITS.get(behaviour, ("", 1.0))
    return f"{factor * value:z.0f} {unit}" if unit else f"{value:.3g}"


def signed(value: float, digits: int = 0) -> str:
    """With its sign, but for what rounds to nothing: no robot turns by `-0`."""
    text = f"{value:+z.{digits}f}"
    return text.removeprefix("+") if not text.strip("+0.") else text


def _above(data: ArtifactData, names: list[str], robot: Robot, *, steps: bool) -> bytes:
    shown = [name for name in names if f"runs/{name}/frames" in data.groups]
    columns = max(1, min(3 if not steps else 4, len(shown)))
    rows = max(1, math.ceil(len(shown) / columns))
    figure = new_figure(5.2 * columns, 5.4 * rows + 0.6)
    figure.suptitle(
        "from above: start pale, end full; black: way of the centre of mass, a dot at the end of every target;\n"
        "arrows: principal axis at start and end", fontsize=10,
    )  # fmt: skip
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes, name in zip(grid.flat, shown, strict=False):
        _path(axes, data, name, robot)
    for axes in grid.flat[len(shown) :]:
        axes.set_axis_off()
    return png_bytes(figure)


def _path(axes: Axes, data: ArtifactData, name: str, robot: Robot) -> None:
    frames, intervals = data.groups[f"runs/{name}/frames"], data.group(name, "intervals")
    p_WE, com = frames["p_WE"], centre_of_mass(frames, robot)
    for cap in range(p_WE.shape[1]):
        axes.plot(p_WE[:, cap, 0], p_WE[:, cap, 1], color=rod_color(cap), lw=0.5, alpha=0.35)
    draw_rods(axes, p_WE)
    axes.plot(com[:, 0], com[:, 1], color=_PATH, lw=2.2)
    if intervals is not None:
        ends = intervals["last"]
        axes.plot(com[ends, 0], com[ends, 1], "o", color=_PATH, ms=4)
    for frame, alpha in ((0, 0.5), (-1, 1.0)):
        axis = (p_WE[frame, 1::2] - p_WE[frame, 0::2]).mean(axis=0)[:2]
        axis = 0.12 * axis / max(float(np.linalg.norm(axis)), 1e-9)
        start = com[frame, :2]
        axes.annotate("", tuple(start + axis), tuple(start), arrowprops={"arrowstyle": "-|>", "color": _AXIS, "lw": 2.2,
                                                           "alpha": alpha})  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.grid(alpha=0.3)
    axes.set_title(f"{name}: {_summary(data, name)}", fontsize=10)


def _summary(data: ArtifactData, name: str) -> str:
    if "long" in data.groups and name in (names := words(data.groups["long"]["name"])):
        row = names.index(name)
        x, y, turn = data.groups["long"]["mean"][row]
        return f"{math.hypot(x, y):.2f} m, {math.degrees(turn):+.0f} deg, {data.groups['long']['duration'][row]:.0f} s"
    table = data.groups["primitives"]
    row = words(table["name"]).index(name)
    shapes = " ".join("".join(f"{value:.0f}" for value in shape) for shape in data.groups[f"policies/{name}"]["target"])
    moved = 1e3 * float(np.linalg.norm(table["shift"][row]))
    return f"{moved:.0f} mm, {math.degrees(table['turn'][row]):+.0f} deg\n{shapes}"


def _scores(table: Group) -> bytes:
    behaviours = words(table["behaviour"])
    kinds = list(dict.fromkeys(behaviours))
    figure = new_figure(3.6 * len(kinds) + 0.6, 4.2)
    figure.suptitle(
        "reward over drawn numbers and start poses: mean and standard deviation; the score ranks", fontsize=10
    )
    panels = np.atleast_1d(figure.subplots(1, len(kinds)))
    for axes, kind in zip(panels, kinds, strict=True):
        rows = [k for k, one in enumerate(behaviours) if one == kind]
        unit, factor = _UNITS.get(kind, ("its own unit", 1.0))
        at = np.arange(len(rows)) + 1
        axes.bar(
            at, factor * table["mean"][rows], yerr=factor * table["sd"][rows], color=_BAR, capsize=3, label="mean, sd"
        )
        axes.plot(at, factor * table["nominal"][rows], "D", ms=5, color=_NOMINAL, label="best numbers, rest pose")
        axes.plot(at, factor * table["score"][rows], "_", ms=14, mew=2, color="black", label="score")
        axes.set(title=kind, xlabel="gait", ylabel=f"reward [{unit}]", xticks=at)
    legend_below(figure, list(panels))
    return png_bytes(figure)
