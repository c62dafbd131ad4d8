"""Frame by frame: the real robot beside the simulated ones, at the ends of target intervals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.compare import REAL, model_color
from r2s2r_cli.views.figure import as_typed, new_figure, png_bytes, rod_color
from r2s2r_cli.views.simulation_scene import BOTTOM, TOP, depth, screen
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 7
"""Instants that are shown of a run."""
_GROUND, _LINE, _CABLE = "#f3f1ec", "#dcd8cf", "#8a94a3"
_GRID_M = 0.1


def draw_strips(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run: the real robot above, a row a simulator below it, the real one's rods behind in grey."""
    names = [as_typed(name.decode()) for name in data.groups["models"]["name"].tolist()]
    for run in data.runs():
        real, simulated = data.groups[f"runs/{run}/real"], data.groups[f"runs/{run}/simulated"]
        yield run, _strip(run, real, simulated, names, robot)


def picked(intervals: int) -> list[int]:
    """Intervals whose ends are shown: the last one always, spread evenly."""
    return np.unique(np.linspace(0, intervals - 1, min(COLUMNS, intervals)).round().astype(int)).tolist()


def _strip(run: str, real: Group, simulated: Group, names: list[str], robot: Robot) -> bytes:
    shown = picked(len(real["duration"]))
    seen = list(real["p_WE"][shown, -1])
    rows: list[tuple[str, str, list[np.ndarray | None]]] = [("real robot", REAL, list(seen))]
    for k, name in enumerate(names):
        count = int(simulated["compared"][k])
        rows.append((name, model_color(k), [simulated["p_WE"][k, i, -1] if i < count else None for i in shown]))
    pairs = [(p, p_real) for _, _, ps in rows for p, p_real in zip(ps, seen, strict=True)]
    reach = max(_reach(p - _middle(p_real)) for p, p_real in pairs if p is not None)
    figure = new_figure(2.3 * len(seen), 1.85 * len(rows) + 0.5)
    grid = figure.subplots(len(rows), len(seen), squeeze=False)
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    cables = np.array([cable.caps for cable in robot.cables])
    for line, (name, color, ps) in zip(grid, rows, strict=True):
        for axes, p, p_real in zip(line, ps, seen, strict=True):
            _scene(axes, p, p_real, None if color == REAL else p_real, radius, cables, reach)
        line[0].text(-0.02, 0.5, name, color=color, rotation=90, ha="right", va="center", weight="bold",
                     transform=line[0].transAxes)  # fmt: skip
    for axes, title in zip(grid[0], [f"end of interval {k + 1}" for k in shown], strict=True):
        axes.set_title(title, fontsize=10)
    words = "behind each simulated robot, grey, the real one; grid 0.1 m; a column is seen from one place"
    figure.suptitle(f"{run}: {words}", fontsize=10)
    return png_bytes(figure)


def _middle(p: np.ndarray) -> np.ndarray:
    return np.asarray(p.mean(axis=0) * [1, 1, 0])


def _reach(p: np.ndarray) -> float:
    """What must be shown around the origin so that no cap of (cap, 3) is cut off [m]."""
    x, y = screen(p).T
    return 1.15 * float(max(np.abs(x).max(), y.max() / TOP, -y.min() / BOTTOM))


def _scene(
    axes: Axes, p: np.ndarray | None, p_real: np.ndarray, ghost: np.ndarray | None, radius: np.ndarray,
    cables: np.ndarray, reach: float,
) -> None:  # fmt: skip
    """One robot as seen by somebody who looks at the real one; caps (cap, 3) [m]."""
    middle = _middle(p_real)
    _ground(axes, middle, 1.8 * reach)
    if p is not None:
        if ghost is not None:
            _rods(axes, ghost - middle, radius, ghost=True)
        for a, b in cables:
            axes.plot(*screen(p[[a, b]] - middle).T, color=_CABLE, lw=0.8, zorder=8)
        _rods(axes, p - middle, radius, ghost=False)
    axes.set(xlim=(-reach, reach), ylim=(-BOTTOM * reach, TOP * reach))
    axes.set_aspect("equal")
    axes.set_axis_off()


def _ground(axes: Axes, middle: np.ndarray, reach: float) -> None:
    corners = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    axes.fill(*screen(corners).T, color=_GROUND, zorder=0)
    for axis in (0, 1):
        for at in np.arange(np.ceil((middle[axis] - reach) / _GRID_M) * _GRID_M - middle[axis], reach, _GRID_M):
            line = np.zeros((2, 3))
            line[:, axis], line[:, 1 - axis] = at, (-reach, reach)
            axes.plot(*screen(line).T, color=_LINE, lw=0.6, zorder=1)


def _rods(axes: Axes, p: np.ndarray, radius: np.ndarray, *, ghost: bool) -> None:
    from matplotlib.patches import Circle

    for a in range(0, len(p), 2):
        ends = p[a : a + 2]
        order = 5.0 if ghost else 10 + float(depth(ends).mean())
        color = "#b9b4aa" if ghost else rod_color(a)
        axes.plot(*(screen(ends * [1, 1, 0])).T, color="#5a5348", alpha=0.08 if ghost else 0.16, lw=4, zorder=2)
        axes.plot(*screen(ends).T, color=color, lw=3, alpha=0.6 if ghost else 1, zorder=order)
        for k in (0, 1):
            at = screen(ends[k])
            patch = Circle((at[0], at[1]), float(radius[a + k]), facecolor=color, edgecolor="white", lw=0.5,
                           alpha=0.6 if ghost else 1, zorder=order + 0.1)  # fmt: skip
            axes.add_patch(patch)
