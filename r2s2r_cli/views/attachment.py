"""A picture of the attachment sites in the rest state: the paper's points A..H, and the rod-end mode beside it."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

_ROD_COLORS = ("#c0392b", "#1e8449", "#2457a6", "#8e5ea2", "#b9770e", "#5d6d7e")
"""Rods 0..2 in the colours of the real caps; further rods in colours of their own."""
_ACTUATED, _PASSIVE, _GROUND = "#222222", "#d08700", "#e8e6e1"
_ELEVATION, _AZIMUTH = np.deg2rad(28.0), np.deg2rad(-122.0)
"""Direction of the viewer, seen from the robot: none of A..H hides another on the 3-bar robot."""
_DPI = 110
_LABEL_DISTANCE = 0.011
"""How far outside its site a label stands on the picture [m]."""
_NUMBER_INSET = 0.035
"""How far from its end the number of a cap stands on the rod [m]: clear of the cap's circle."""


def attachment_png(
    p_WE: np.ndarray,
    cables: Sequence[tuple[int, int]],
    n_actuated: int,
    cap_radius: float,
    panels: Mapping[str, np.ndarray],
    labels: Mapping[str, tuple[int, int]],
) -> bytes:
    """PNG with one panel a mode.

    p_WE: caps at rest [m], shape (cap, 3), frame W. cables: pairs of caps, the first n_actuated winched.
    panels: title -> attachment points p_WS [m], shape (cable, 2, 3), frame W. labels: name -> (cable, end), written
    into the first panel.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.4 * len(panels), 4.5), dpi=_DPI)
    FigureCanvasAgg(figure)
    for number, (title, p_WS) in enumerate(panels.items()):
        axes: Any = figure.add_axes((number / len(panels), 0.07, 1 / len(panels), 0.86))
        _draw(axes, np.asarray(p_WE), cap_radius, np.asarray(p_WS), n_actuated)
        if number == 0:
            _label(axes, np.asarray(p_WE), cables, np.asarray(p_WS), labels)
        axes.set_title(title, fontsize=11)
        axes.set_aspect("equal")
        axes.margins(0.05)
        axes.set_axis_off()
    figure.text(0.5, 0.02, "black: actuated cables, orange: passive tendons, dots: attachment points, "
                "grey: support triangle; numbers: end caps", ha="center", fontsize=9)  # fmt: skip
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw(axes: Any, p_WE: np.ndarray, cap_radius: float, p_WS: np.ndarray, n_actuated: int) -> None:
    lowest = p_WE[:, 2] < p_WE[:, 2].min() + 1e-6
    ground = _screen(p_WE[lowest] * [1, 1, 0])
    axes.fill(ground[:, 0], ground[:, 1], facecolor=_GROUND, edgecolor="#b9b5ab", linewidth=0.8, zorder=0)
    far, near = _depth(p_WE).min(), _depth(p_WE).max()

    def order(p: np.ndarray) -> float:
        return 1 + 8 * float((_depth(p).mean() - far) / (near - far))

    for k, pair in enumerate(p_WS):
        color = _ACTUATED if k < n_actuated else _PASSIVE
        axes.plot(*_screen(pair).T, color=color, linewidth=1.2, zorder=order(pair))
    for rod in range(len(p_WE) // 2):
        ends = p_WE[2 * rod : 2 * rod + 2]
        axis = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        color = _ROD_COLORS[rod % len(_ROD_COLORS)]
        axes.plot(*_screen(ends).T, color=color, linewidth=3.2, zorder=order(ends), solid_capstyle="round")
        for cap, inward in ((0, axis), (1, -axis)):
            circle = _screen(_circle(ends[cap], axis, cap_radius))
            axes.fill(*circle.T, facecolor=color, alpha=0.25, edgecolor="none", zorder=order(ends[cap : cap + 1]))
            axes.plot(*circle.T, color=color, linewidth=1.1, zorder=order(ends[cap : cap + 1]))
            x, y = _screen(ends[cap] + _NUMBER_INSET * inward)
            axes.text(x, y, f"{2 * rod + cap}", color="white", fontsize=8, ha="center", va="center", zorder=30,
                      bbox={"boxstyle": "circle,pad=0.18", "facecolor": color, "linewidth": 0})  # fmt: skip
    axes.plot(*_screen(p_WS.reshape(-1, 3)).T, "o", color="#111111", markersize=3.4, zorder=20)


def _label(
    axes: Any,
    p_WE: np.ndarray,
    cables: Sequence[tuple[int, int]],
    p_WS: np.ndarray,
    labels: Mapping[str, tuple[int, int]],
) -> None:
    for name, (cable, end) in labels.items():
        site, cap = _screen(p_WS[cable, end]), _screen(p_WE[cables[cable][end]])
        outward = (site - cap) / np.linalg.norm(site - cap)
        axes.text(*(site + _LABEL_DISTANCE * outward), name, fontsize=12, fontweight="bold", ha="center",
                  va="center", zorder=40)  # fmt: skip


def _screen(p: np.ndarray) -> np.ndarray:
    """Orthographic picture coordinates (right, up) [m], shape (..., 2)."""
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    return p @ np.stack([right, np.cross(_toward(), right)], axis=-1)


def _depth(p: np.ndarray) -> np.ndarray:
    return p @ _toward()


def _toward() -> np.ndarray:
    return np.array([np.cos(_ELEVATION) * np.cos(_AZIMUTH), np.cos(_ELEVATION) * np.sin(_AZIMUTH), np.sin(_ELEVATION)])


def _circle(p: np.ndarray, axis: np.ndarray, radius: float) -> np.ndarray:
    """A circle around `axis`, shape (49, 3)."""
    x = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    angle = np.linspace(0.0, 2 * np.pi, 49)
    return p + radius * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), np.cross(axis, x)))
