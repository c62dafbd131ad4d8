"""How the numbers were found: loss on the way, paths of the parameters, profiles, online estimates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import ROD_COLORS, legend_beside, new_figure, png_bytes
from r2s2r_cli.views.identify_data import shown_in_log, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLUMNS = 4
_TWO_SIDED = 1.96
"""Standard deviations to the ends of a 95 % interval."""


def draw_search(data: ArtifactData) -> bytes:
    """Loss and parameter paths over iterations; a panel for each profile below."""
    trace, profiles = data.groups.get("trace"), data.groups.get("profiles")
    count = 0 if profiles is None else len(profiles["parameter"])
    rows = math.ceil(count / _COLUMNS)
    figure = new_figure(15, (4.2 if trace is not None else 0.4) + 3.2 * rows)
    parts = np.atleast_1d(np.asarray(figure.subfigures(2, 1, height_ratios=(4.2, max(3.2 * rows, 0.01)))
                                     if trace is not None and rows else figure.subfigures(1, 1)))  # fmt: skip
    if trace is not None:
        panels = parts[0].subplots(1, 2 if "value" in trace else 1, squeeze=False)[0]
        _loss(panels[0], trace)
        if "value" in trace:
            _paths(panels[1], trace, words(data.groups["parameters"], "name"))
    if profiles is not None and rows:
        grid = parts[-1].subplots(rows, min(count, _COLUMNS), squeeze=False)
        for place, axes in enumerate(grid.flat):
            if place < count:
                _profile(axes, profiles, place, data.groups["parameters"])
            else:
                axes.set_axis_off()
    return png_bytes(figure)


def draw_history(data: ArtifactData) -> bytes:
    """A panel a parameter: the estimate after each run, with its interval."""
    history, table = data.groups["history"], data.groups["parameters"]
    names, units = words(table, "name"), words(table, "unit")
    columns = min(len(names), _COLUMNS)
    figure = new_figure(15, 0.6 + 2.8 * math.ceil(len(names) / columns))
    panels = figure.subplots(math.ceil(len(names) / columns), columns, squeeze=False)
    steps, runs = np.arange(len(history["value"])), words(history, "run")
    for k, axes in enumerate(panels.flat):
        if k >= len(names):
            axes.set_axis_off()
            continue
        wide = _TWO_SIDED * np.nan_to_num(history["sd"][:, k])
        axes.errorbar(steps, history["value"][:, k], wide, fmt="o-", capsize=3)
        axes.set_xticks(steps, runs, rotation=45, fontsize=7)
        axes.set_title(f"{names[k]}{'' if units[k] == '1' else f' [{units[k]}]'}", fontsize=9)
    return png_bytes(figure)


def _loss(axes: Axes, trace: Group) -> None:
    """Every start one line; costs of different stages (horizons) have different residuals."""
    first = trace["start"] == trace["start"][0]
    for start in np.unique(trace["start"]).tolist():
        rows = trace["start"] == start
        color = ROD_COLORS[start % len(ROD_COLORS)]
        axes.plot(
            np.arange(rows.sum()),
            shown_in_log(trace["cost"][rows]),
            "o-",
            ms=3,
            lw=1.2,
            color=color,
            label=f"start {start}",
        )
    stages = np.array(words(trace, "stage"))[first]
    for step in [0, *(np.flatnonzero(stages[1:] != stages[:-1]) + 1)]:
        axes.axvline(step - 0.5, color="gray", lw=0.7, ls=":")
        axes.annotate(stages[step], (step - 0.5, 1.0), (2, 3), xycoords=("data", "axes fraction"), fontsize=7,
                      textcoords="offset points", rotation=30, va="bottom", ha="left")  # fmt: skip
    axes.set_xlim(-0.5, None)
    axes.set_yscale("log")
    axes.set(
        xlabel="accepted steps (dotted: a new stage of start 0; losses compare within a stage)",
        ylabel="loss",
    )
    legend_beside(axes)


def _paths(axes: Axes, trace: Group, names: list[str]) -> None:
    rows = trace["start"] == trace["start"][0]
    value = trace["value"][rows]
    for k, name in enumerate(names):
        last = value[-1, k]
        axes.plot(value[:, k] / last if last else value[:, k], lw=1.2, label=name)
    axes.set(xlabel="accepted steps of the first start", ylabel="value / value at the end")
    legend_beside(axes)


def _profile(axes: Axes, profiles: Group, row: int, table: Group) -> None:
    value, cost, rise = profiles["value"][row], profiles["cost"][row], float(profiles["threshold"][row])
    parameter = int(profiles["parameter"][row])
    keep = np.isfinite(value)
    axes.plot(value[keep], cost[keep], "o-", color="#0b5fa5", ms=4)
    axes.axhline(rise, color="black", lw=0.8, ls="--")
    axes.axvline(table["value"][parameter], color="gray", lw=0.8)
    sd = float(table["sd"][parameter])
    if math.isfinite(sd) and sd > 0 and keep.any():
        grid = np.linspace(value[keep].min(), value[keep].max(), 60)
        curve = rise * ((grid - table["value"][parameter]) / (_TWO_SIDED * sd)) ** 2
        axes.plot(grid, curve, color="#b8860b", lw=1, ls=":", label="what the reported sd would give")
        axes.legend(fontsize=6, frameon=False)
    for end in profiles["interval"][row]:
        if math.isfinite(end):
            axes.axvline(end, color="#0b5fa5", lw=0.8, ls="--")
    top = float(np.nanmax(cost[keep])) if keep.any() else rise
    axes.set_ylim(-0.05 * max(top, rise), 1.1 * max(min(top, 4 * rise), rise))
    unit = words(table, "unit")[parameter]
    axes.set_xlabel(f"{words(table, 'name')[parameter]}{'' if unit == '1' else f' [{unit}]'}", fontsize=8)
    axes.set_ylabel("rise of the loss", fontsize=8)
