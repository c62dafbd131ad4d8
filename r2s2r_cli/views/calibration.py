"""Pictures of a calibration: every fit with its residuals, the drift, the tendon curves, the rods with their masses."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.calibration_parts import draw_masses, draw_tendons
from r2s2r_cli.views.figure import (
    BLUE,
    GREEN,
    ORANGE,
    PALE,
    PURPLE,
    RED,
    as_typed,
    legend_columns,
    legend_entries,
    new_figure,
    png_bytes,
    texts,
)
from schemas.calibration import LINE_STATES
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SERIES = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (PURPLE, "D"))
_SWAP = 2
DAY_S = 86400.0


def draw_calibration(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, bytes]]:
    """(name, PNG) of everything that was measured: `sensors-<set>`, `drift`, `tendons`, `masses`."""
    groups = data.groups
    if "lines" in groups:
        names = texts(groups["lines"], "name")
        for number, (name, file_name) in enumerate(zip(names, _file_names(names), strict=True)):
            yield f"sensors-{file_name}", _sensors(groups["points"], groups["lines"], number, name)
    if "history" in groups:
        yield "drift", _drift(groups["history"], groups["drift"])
    if "tendons" in groups:
        yield "tendons", draw_tendons(groups["tendon_points"], groups["tendons"])
    if "masses" in groups:
        yield "masses", draw_masses(groups["mass_parts"], groups["masses"], robot)


def _sensors(points: Group, lines: Group, number: int, name: str) -> bytes:
    n = lines["slope"].shape[1]
    columns = min(3, n)
    rows = math.ceil(n / columns)
    figure = new_figure(4.2 * columns, 3.1 * rows + 0.6)
    mine = points["set"] == number
    both = np.concatenate([points[name][mine] for name in ("residual", "loo_residual")])
    reach = 1.15e3 * np.nanmax(np.abs(both), initial=5e-4)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=(3, 1.3) * rows)
    for sensor in range(n):
        row, column = divmod(sensor, columns)
        fit, below = figure.add_subplot(grid[2 * row, column]), figure.add_subplot(grid[2 * row + 1, column])
        _sensor(fit, below, points, lines, number, sensor)
        below.set_ylim(-reach, reach)
        if column == 0:
            fit.set_ylabel("capacitance [pF]")
            below.set_ylabel("residual\n[mm]")
        if sensor + columns >= n:
            below.set_xlabel("length [mm]")
    rms = 1e3 * float(lines["rms_set"][number])
    worth = f"rms {rms:.2f} mm over all points" if math.isfinite(rms) else "all sensors are dead"
    figure.suptitle(
        f"set {as_typed(name)}: line per sensor, {worth}\n"
        "residual: length read from the line minus measured length (ring: line fitted without that point)"
    )
    return png_bytes(figure)


def _sensor(fit: Axes, below: Axes, points: Group, lines: Group, number: int, sensor: int) -> None:
    rows = (points["set"] == number) & (points["sensor"] == sensor)
    length, capacitance = points["length"][rows], points["capacitance"][rows]
    slope, offset = lines["slope"][number, sensor], lines["offset"][number, sensor]
    state = int(lines["state"][number, sensor])
    color = BLUE if state == 0 else RED
    ends = np.array([length.min(), length.max()])
    fit.plot(1e3 * ends, 1e12 * (slope * ends + offset), "-", color=color, lw=1.2)
    fit.plot(1e3 * length, 1e12 * capacitance, "o", color="black", ms=4)
    if state == 1:
        fit.set_title(f"sensor {sensor}: dead", fontsize=9, color=RED)
        below.text(0.5, 0.5, "no length can be read", transform=below.transAxes, ha="center", va="center", color=RED)
    else:
        text = f"sensor {sensor}: {1e9 * slope:.4f} pF/mm, rms {1e3 * lines['rms'][number, sensor]:.2f} mm"
        fit.set_title(text if state == 0 else f"{text}\n{LINE_STATES[state].split(':')[0]}", fontsize=9, color=color)
        below.bar(1e3 * length, 1e3 * points["residual"][rows], width=4, color=color)
        below.plot(1e3 * length, 1e3 * points["loo_residual"][rows], "o", mfc="none", color="black", ms=4)
    below.axhline(0, color="black", lw=0.7)
    below.set_xlim(fit.get_xlim())
    fit.tick_params(labelbottom=False)


def _drift(history: Group, drift: Group) -> bytes:
    n = history["slope"].shape[1]
    columns = min(3, n)
    rows = math.ceil(n / columns)
    figure = new_figure(4.4 * columns, 2.3 * rows + 3.4)
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=(1,) * rows + (1.2,))
    files = list(dict.fromkeys(texts(history, "file")))
    ticks = sorted({round(t / DAY_S) for t in np.linspace(history["time"].min(), history["time"].max(), 4)})
    labels = [f"{datetime.fromtimestamp(DAY_S * day, UTC):%d %b\n%Y}" for day in ticks]
    first: Axes | None = None
    for sensor in range(n):
        row, column = divmod(sensor, columns)
        axes = figure.add_subplot(grid[row, column], sharex=first, sharey=first)
        first = first or axes
        _drift_panel(axes, history, drift, sensor, files)
        axes.set_xticks(ticks, labels)
        if column == 0:
            axes.set_ylabel("deviation [mm]")
    entries = legend_entries(figure.axes)  # of every sensor: the first one may have no usable line in a file
    columns = legend_columns(figure.get_figwidth(), list(entries))
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncol=columns, fontsize=8,
                  frameon=False)  # fmt: skip
    _drift_sizes(figure.add_subplot(grid[rows, :]), history, drift)
    figure.suptitle(
        "drift: length that one and the same capacitance means, calibration after calibration\n"
        "(capacitance: the file's median in the middle of the working range; deviation from that middle)"
    )
    return png_bytes(figure)


def _drift_panel(axes: Axes, history: Group, drift: Group, sensor: int, files: list[str]) -> None:
    file = np.array(texts(history, "file"))
    state, slope, offset = (history[key][:, sensor] for key in ("state", "slope", "offset"))
    middle = history["range"][sensor].mean()
    dates = history["time"] / DAY_S
    swapped = drift["after"][(drift["sensor"] == sensor) & (drift["state"] == _SWAP)]
    for i, name in enumerate(files):
        color, marker = _SERIES[i % len(_SERIES)]
        good = (file == name) & (state == 0)
        if good.any():
            typical = np.median(slope[good] * middle + offset[good])
            length = 1e3 * ((typical - offset[good]) / slope[good] - middle)
            label = as_typed(name) or "history"
            axes.plot(dates[good], length, "-", color=color, marker=marker, ms=4, lw=1, label=label)
            ringed = np.isin(np.flatnonzero(good), swapped)
            axes.plot(dates[good][ringed], length[ringed], "o", mfc="none", color=RED, ms=10, mew=1.5)
        failed = (file == name) & (state != 0)
        axes.plot(dates[failed], np.full(failed.sum(), 0.06), "x", color=RED, transform=axes.get_xaxis_transform())
    axes.set_title(f"sensor {sensor}", fontsize=9)
    axes.axhline(0, color="black", lw=0.7)
    axes.grid(color="#eeeeee")
    if sensor == 0:
        axes.plot([], [], "o", mfc="none", color=RED, ms=10, mew=1.5, label="swap")
        axes.plot([], [], "x", color=RED, label="failed or suspect fit (shown at the bottom)")


def _drift_sizes(axes: Axes, history: Group, drift: Group) -> None:
    n = history["slope"].shape[1]
    measured = drift["state"] != 1
    size = 1e3 * np.abs(drift["change"])
    spread = np.linspace(-0.18, 0.18, 7)
    for sensor in range(n):
        mine = measured & (drift["sensor"] == sensor)
        axes.plot(sensor + spread[np.arange(mine.sum()) % 7], size[mine], ".", color=PALE, ms=6,
                  label="one recalibration" if sensor == 0 else None)  # fmt: skip
    axes.plot(range(n), 1e3 * history["median_change"], "_", color=BLUE, ms=26, mew=2.5, label="median")
    axes.plot(range(n), 1e3 * history["p90_change"], "_", color=ORANGE, ms=26, mew=2.5, label="90th percentile")
    threshold = 1e3 * float(history.attributes["swap_threshold"])
    axes.axhline(threshold, color=RED, lw=0.8, ls="--", label=f"swap, above {threshold:g} mm")
    axes.set_xticks(range(n), [f"sensor {i}" for i in range(n)])
    axes.set_ylabel("change [mm]\nper recalibration")
    axes.legend(fontsize=8, ncol=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _file_names(names: list[str]) -> list[str]:
    """Names of sets as parts of file names, all different."""
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:80] for name in names]
    return [f"{name}-{i + 1}" if plain.count(name) > 1 else name for i, name in enumerate(plain)]
