"""One instant of a simulated robot in three dimensions: rods, cables coloured by tension, ground and shadows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.views.figure import rod_color
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AZIMUTH, ELEVATION = np.deg2rad(-64.0), np.deg2rad(24.0)
"""Where the viewer stands, seen from the robot: the three support caps of the resting 3-bar robot are in view."""
TOP, BOTTOM = 1.15, 0.42
"""What is shown above and below the robot's middle on the ground, over what is shown beside it."""
SLACK_N = 1e-3
"""Below this tension a cable is drawn slack: a thousandth of a newton moves nothing."""
_SLACK, _GROUND, _LINE, _SHADOW = "#9aa4b1", "#f3f1ec", "#dcd8cf", "#5a5348"
_CONTACT = "#e08a00"
_GRID_M = 0.1
_PIECES = 8
"""Parts of a rod or cable that are sorted by depth one by one."""


@dataclass(frozen=True)
class Instant:
    """What is drawn of one frame. p_WE: caps [m], (cap, 3); p_WS: cable ends [m], (cable, 2, 3); tension [N], (cable,);
    rest: lengths without tension [m], (cable,); contact: (cap,), bool."""

    p_WE: np.ndarray
    p_WS: np.ndarray
    tension: np.ndarray
    rest: np.ndarray
    contact: np.ndarray


def instant(frames: Group, robot: Robot, frame: int) -> Instant:
    """The instant at `frame` of a run's frames."""
    ends = np.array([cable.caps for cable in robot.cables]) // 2
    sites = np.array([cable.sites_m for cable in robot.cables])
    p_WR, q_WR = frames["p_WR"][frame][ends], frames["q_WR"][frame][ends]
    return Instant(
        frames["p_WE"][frame], p_WR + rotated(q_WR, sites), frames["tension"][frame], frames["rest_length"][frame],
        frames["contact"][frame],
    )  # fmt: skip


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) turned by unit quaternions xyzw (..., 4)."""
    axis, w = q[..., :3], q[..., 3:]
    twice = 2 * np.cross(axis, v)
    return np.asarray(v + w * twice + np.cross(axis, twice))


def tension_color(share: float) -> tuple[float, float, float]:
    """Colour of a taut cable at this share, 0..1, of the largest tension shown: from steel blue to red."""
    stops = np.array([[0.16, 0.31, 0.48], [0.42, 0.36, 0.62], [0.80, 0.30, 0.42], [0.86, 0.13, 0.10]])
    at = float(np.clip(share, 0, 1)) * (len(stops) - 1)
    low = min(int(at), len(stops) - 2)
    r, g, b = stops[low] + (at - low) * (stops[low + 1] - stops[low])
    return float(r), float(g), float(b)


def draw_scene(
    axes: Axes, now: Instant, radius: np.ndarray, *, top: float, reach: float, path: np.ndarray | None = None
) -> None:
    """Draw into empty axes, which show `reach` [m] to each side of the robot's middle.

    radius: of every cap [m], (cap,). top: tension [N] of the strongest colour. path: ground points (n, 2) [m] that the
    centre of mass has come along.
    """
    middle = now.p_WE.mean(axis=0) * [1, 1, 0]
    _ground(axes, middle, 1.8 * reach)
    if path is not None and len(path) > 1:
        way = screen(np.column_stack([path, np.zeros(len(path))]) - middle)
        axes.plot(*way.T, color="#7a6f5d", lw=1, zorder=1.5)
    _shadows(axes, now, middle)
    _contacts(axes, now, radius, middle)
    _cables(axes, now, middle, top)
    _rods(axes, now, radius, middle)
    axes.set(xlim=(-reach, reach), ylim=(-BOTTOM * reach, TOP * reach))
    axes.set_aspect("equal")
    axes.set_axis_off()


def scene_reach(p_WE: np.ndarray) -> float:
    """What `draw_scene` must show so that no cap of these frames (frame, cap, 3) [m] is cut off [m]."""
    middle = p_WE.mean(axis=1, keepdims=True) * [1, 1, 0]
    seen = screen(p_WE - middle)
    return 1.15 * float(max(np.abs(seen[..., 0]).max(), seen[..., 1].max() / TOP, -seen[..., 1].min() / BOTTOM))


def screen(p: np.ndarray) -> np.ndarray:
    """Points (..., 3) on the picture plane (..., 2), parallel projection."""
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    up = np.array([-np.cos(AZIMUTH) * np.sin(ELEVATION), -np.sin(AZIMUTH) * np.sin(ELEVATION), np.cos(ELEVATION)])
    return np.asarray(np.stack([p @ right, p @ up], axis=-1))


def depth(p: np.ndarray) -> np.ndarray:
    """Nearness of points (..., 3) to the viewer [m]."""
    towards = [np.cos(AZIMUTH) * np.cos(ELEVATION), np.sin(AZIMUTH) * np.cos(ELEVATION), np.sin(ELEVATION)]
    return np.asarray(p @ np.array(towards))


def _order(p: np.ndarray) -> float:
    """Drawing order of a small part: nearer ones cover farther ones."""
    return 10 + float(depth(p).mean())


def _ground(axes: Axes, middle: np.ndarray, reach: float) -> None:
    corners = reach * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    axes.fill(*screen(corners).T, color=_GROUND, zorder=0)
    for axis in (0, 1):
        first = np.ceil((middle[axis] - reach) / _GRID_M) * _GRID_M - middle[axis]
        for at in np.arange(first, reach, _GRID_M):
            line = np.zeros((2, 3))
            line[:, axis], line[:, 1 - axis] = at, (-reach, reach)
            axes.plot(*screen(line).T, color=_LINE, lw=0.6, zorder=1)


def _shadows(axes: Axes, now: Instant, middle: np.ndarray) -> None:
    for rod in range(len(now.p_WE) // 2):
        ends = (now.p_WE[2 * rod : 2 * rod + 2] - middle) * [1, 1, 0]
        axes.plot(*screen(ends).T, color=_SHADOW, alpha=0.16, lw=5, solid_capstyle="round", zorder=2)


def _contacts(axes: Axes, now: Instant, radius: np.ndarray, middle: np.ndarray) -> None:
    angle = np.linspace(0, 2 * np.pi, 25)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    for cap in np.flatnonzero(now.contact):
        ring = (now.p_WE[cap] - middle) * [1, 1, 0] + 1.7 * radius[cap] * circle
        axes.plot(*screen(ring).T, color=_CONTACT, lw=1.4, zorder=3)


def _cables(axes: Axes, now: Instant, middle: np.ndarray, top: float) -> None:
    for ends, tension, rest in zip(now.p_WS - middle, now.tension, now.rest, strict=True):
        taut = tension > SLACK_N
        share = min(1.0, float(tension) / top) if top > 0 else 0.0
        line = cable_line(ends, 0.0 if taut else float(rest))
        for i in range(len(line) - 1):
            part = line[i : i + 2]
            color, width = (tension_color(share), 1 + 1.6 * share) if taut else (_SLACK, 0.9)
            axes.plot(*screen(part).T, color=color, lw=width, zorder=_order(part), solid_capstyle="round")


def cable_line(ends: np.ndarray, rest: float) -> np.ndarray:
    """Points (n, 3) [m] along a cable between its ends (2, 3); with more length than needed it hangs as a parabola.

    A parabola of sag s over a span d is longer than d by about 8 s^2 / 3 d; that it hangs at all is what is shown, so
    it never hangs lower than half its span.
    """
    at = np.linspace(0, 1, _PIECES + 1)[:, None]
    line = ends[0] + at * (ends[1] - ends[0])
    span = float(np.linalg.norm(ends[1] - ends[0]))
    sag = min(np.sqrt(0.375 * span * max(0.0, rest - span)), 0.5 * span)
    line[:, 2] = np.maximum(line[:, 2] - 4 * sag * (at * (1 - at))[:, 0], 0.0)
    return np.asarray(line)


def _rods(axes: Axes, now: Instant, radius: np.ndarray, middle: np.ndarray) -> None:
    from matplotlib.patches import Circle

    for rod in range(len(now.p_WE) // 2):
        ends = now.p_WE[2 * rod : 2 * rod + 2] - middle
        color = rod_color(2 * rod)
        points = ends[0] + np.linspace(0, 1, _PIECES + 1)[:, None] * (ends[1] - ends[0])
        for i in range(_PIECES):
            axes.plot(*screen(points[i : i + 2]).T, color=color, lw=3.4, zorder=_order(points[i : i + 2]))
        for k in (0, 1):
            cap, at, order = 2 * rod + k, screen(ends[k]), _order(ends[k])
            r = float(radius[cap])
            axes.add_patch(Circle((at[0], at[1]), r, facecolor=color, edgecolor="white", lw=0.8, zorder=order))
            axes.add_patch(Circle((at[0] - 0.3 * r, at[1] + 0.35 * r), 0.3 * r, color="white", alpha=0.45, lw=0,
                                  zorder=order))  # fmt: skip
            axes.text(at[0], at[1], str(cap), color="white", fontsize=5.5, ha="center", va="center", weight="bold",
                      zorder=20)  # fmt: skip
