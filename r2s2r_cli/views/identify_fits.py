"""Observed and simulated end caps over each other: every segment from above, heights over time, and the free run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import legend_below, legend_beside, new_figure, png_bytes, rod_color
from r2s2r_cli.views.identify_data import ROLE_COLORS, ROLE_WORDS, intervals_by_role

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = 4
_CLOSED = "#6b3fa0"
_REPEATS = "#c0392b"


def draw_fit(data: ArtifactData, run: str) -> bytes:
    """A panel a segment from above, its key frame marked; heights of all caps over the run below."""
    fit, roles = data.groups[f"runs/{run}/fit"], intervals_by_role(data, run)
    numbers = np.unique(fit["interval"]).tolist()
    rows = math.ceil(len(numbers) / _COLUMNS)
    figure = new_figure(16, 3.8 * rows + 4.2)
    top, bottom = np.asarray(figure.subfigures(2, 1, height_ratios=(3.8 * rows, 4.2)))
    panels = top.subplots(rows, min(_COLUMNS, len(numbers)), squeeze=False)
    for place, axes in enumerate(panels.flat):
        if place < len(numbers):
            _from_above(axes, fit, numbers[place], roles.get(numbers[place], 0))
        else:
            axes.set_axis_off()
    top.suptitle(
        "from above [m]: dots observed, lines simulated; rings: observed at the key frame, crosses: simulated",
        fontsize=9,
    )
    _heights(bottom.subplots(), fit, roles)
    return png_bytes(figure)


def draw_free_run(data: ArtifactData, run: str) -> bytes:
    """From above and over time: caps, middle of the caps, and how far the caps are off."""
    free = data.groups[f"runs/{run}/free_run"]
    figure = new_figure(16, 7.5)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.2))
    for cap in range(free["observed"].shape[1]):
        color = rod_color(cap)
        left.plot(free["observed"][:, cap, 0], free["observed"][:, cap, 1], ".", ms=3, color=color, alpha=0.5)
        left.plot(free["simulated"][:, cap, 0], free["simulated"][:, cap, 1], "-", lw=1.2, color=color)
    for name, style, color in (("observed", "--", "black"), ("simulated", "-", "black"), ("closed_loop", "-", _CLOSED)):
        if name in free:
            middle = free[name].mean(axis=1)
            left.plot(
                middle[:, 0], middle[:, 1], style, lw=2.2, color=color, label=f"middle of the caps, {_WORDS[name]}"
            )
    left.set_aspect("equal", adjustable="datalim")
    left.set(xlabel="x [m]", ylabel="y [m]", title="from above: dots observed, lines simulated")
    for name, color in (("simulated", "black"), ("predicted", _REPEATS), ("closed_loop", _CLOSED)):
        if name in free:
            error = cap_rmse(free[name] - free["observed"])
            right.plot(
                free["t"],
                1e3 * error,
                color=color,
                lw=1.5,
                label=f"{_WORDS[name]}, mean {1e3 * np.nanmean(error):.1f} mm",
            )
    right.set(xlabel="time [s]", ylabel="end caps, rms of the frame [mm]", ylim=(0, None))
    right.set_title(f"run {run}: one start at the first test frame, no other", fontsize=10)
    legend_below(figure, [left, right], columns=3)
    return png_bytes(figure)


_WORDS = {"observed": "observed", "simulated": "command replay", "closed_loop": "controller in the loop",
          "predicted": "and what repeats"}  # fmt: skip


def cap_rmse(error: np.ndarray) -> np.ndarray:
    """Root mean square over caps of the distance, (frame,), of error (frame, cap, 3); unseen caps do not count."""
    square = np.sum(error**2, axis=-1)
    seen = np.isfinite(square)
    count = seen.sum(axis=1)
    return np.asarray(np.sqrt(np.where(count > 0, np.nansum(square, axis=1) / np.maximum(count, 1), np.nan)))


def _from_above(axes: Axes, fit: Group, interval: int, role: int) -> None:
    rows = np.flatnonzero(fit["interval"] == interval)
    observed, simulated = fit["observed"][rows], fit["simulated"][rows]
    for cap in range(observed.shape[1]):
        color = rod_color(cap)
        axes.plot(observed[:, cap, 0], observed[:, cap, 1], ".", ms=4, color=color, alpha=0.6)
        axes.plot(simulated[:, cap, 0], simulated[:, cap, 1], "-", lw=1.4, color=color)
        axes.plot(*observed[-1, cap, :2], "o", ms=9, mfc="none", color=color)
        axes.plot(*simulated[-1, cap, :2], "x", ms=7, mew=1.8, color=color)
    error = 1e3 * float(cap_rmse((simulated - observed)[-1:])[0])
    axes.set_title(f"interval {interval}, {ROLE_WORDS[role]}: {error:.1f} mm", fontsize=9, color=ROLE_COLORS[role])
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(labelsize=7)


def _heights(axes: Axes, fit: Group, roles: dict[int, int]) -> None:
    for interval in np.unique(fit["interval"]).tolist():
        rows = fit["interval"] == interval
        t = fit["t"][rows]
        axes.axvspan(t[0], t[-1], color=ROLE_COLORS[roles.get(interval, 0)], alpha=0.07, lw=0)
        axes.annotate(str(interval), ((t[0] + t[-1]) / 2, 1.0), xycoords=("data", "axes fraction"), ha="center",
                      va="bottom", fontsize=7)  # fmt: skip
        for cap in range(fit["observed"].shape[1]):
            axes.plot(t, 1e3 * fit["observed"][rows][:, cap, 2], ".", ms=3, color=rod_color(cap), alpha=0.6)
            axes.plot(
                t, 1e3 * fit["simulated"][rows][:, cap, 2], "-" if cap % 2 == 0 else "--", lw=1.1, color=rod_color(cap)
            )
    for cap in range(fit["observed"].shape[1]):
        axes.plot([], [], "-" if cap % 2 == 0 else "--", color=rod_color(cap), label=f"cap {cap}")
    axes.set(xlabel="time [s]", ylabel="height of cap centre [mm]: dots observed, lines simulated")
    legend_beside(axes)
