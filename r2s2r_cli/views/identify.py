"""Pictures of an identification: the parameters with their intervals here, the others in the files beside this one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.figure import legend_beside, new_figure, png_bytes
from r2s2r_cli.views.identify_data import TRUST_COLORS, TRUST_WORDS, near_zero, words
from r2s2r_cli.views.identify_errors import draw_errors
from r2s2r_cli.views.identify_fits import draw_fit, draw_free_run
from r2s2r_cli.views.identify_information import draw_information
from r2s2r_cli.views.identify_search import draw_history, draw_search

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ZERO = 1e-12


def draw_identification(data: ArtifactData) -> Iterator[tuple[str, str, bytes]]:
    """(name, title, PNG) of every picture for which the artifact has the numbers, in the order of reading."""
    yield (
        "parameters",
        "Parameters: start, value, 95 % interval, range over starts and re-drawn noise",
        _parameters(data),
    )
    if "identifiability" in data.groups:
        yield "information", "What the runs can tell, before any fit, and what they confuse", draw_information(data)
    if "segments" in data.groups:
        yield (
            "errors",
            "Errors by segment beside baselines and floor, and what is left in the residuals",
            draw_errors(data),
        )
    for run in data.runs():
        if f"runs/{run}/fit" in data.groups:
            yield f"fit-{run}", f"Run {run}: every segment simulated from its own start", draw_fit(data, run)
        if f"runs/{run}/free_run" in data.groups:
            yield f"free-{run}", f"Run {run}: free run over the test segments", draw_free_run(data, run)
    if "trace" in data.groups or "profiles" in data.groups:
        parts = {"trace": "loss on the way of the fit", "profiles": "profile likelihood of the weakest"}
        title = ", and ".join(words for name, words in parts.items() if name in data.groups)
        yield "search", f"{title[:1].upper()}{title[1:]}", draw_search(data)
    if "history" in data.groups:
        yield "history", "Estimates as runs arrived, with 95 % intervals", draw_history(data)


def _parameters(data: ArtifactData) -> bytes:
    return png_bytes(parameters_figure(data))


def parameters_figure(data: ArtifactData) -> Figure:
    """A row a parameter, in shares of its start (of its unit where that is 0): comparable whatever the unit."""
    table = data.groups["parameters"]
    names, units = words(table, "name"), words(table, "unit")
    figure = new_figure(13, 1.8 + 0.45 * len(names))
    axes = figure.subplots()
    scale = np.where(np.abs(table["start"]) > _ZERO, np.abs(table["start"]), 1.0)
    shares = {name: table[name] / scale for name in ("value", "start", "lower", "upper")}
    ranges = table["range"] / scale[:, None]
    left, right = _limits([*shares.values(), ranges])
    axes.set_xlim(left, right)
    for row, code in enumerate(table["trust"].tolist()):
        color = TRUST_COLORS[code]
        axes.plot([shares["start"][row]] * 2, [row - 0.3, row + 0.3], color="black", lw=1.2)
        axes.plot(ranges[row], [row, row], color=color, lw=8, alpha=0.3, solid_capstyle="butt")
        ends = (shares["lower"][row], shares["upper"][row])
        axes.plot(np.clip(ends, left, right), [row, row], color=color, lw=1.6)
        for end, mark in zip(ends, "<>", strict=True):
            if not left <= end <= right:  # NaN too, where nothing is drawn
                axes.plot(np.clip(end, left, right), row, mark, color=color, ms=8, clip_on=False)
        _mark(axes, float(shares["value"][row]), row, color)
    for code, word in TRUST_WORDS.items():
        if code in table["trust"]:
            axes.plot([], [], "o", color=TRUST_COLORS[code], label=word)
    axes.plot([], [], "|", color="black", ms=14, label="start")
    axes.plot([], [], "-", color="gray", lw=8, alpha=0.3, label="range over starts\nand re-drawn noise")
    axes.plot([], [], "-", color="gray", lw=1.6, label="95 % interval, with < or >\nwhere it goes on")
    if any(not left <= share <= right for share in shares["value"].tolist()):
        axes.plot(
            [], [], "o", color="gray", mfc="white", ms=9, mew=1.8, label="beyond the axis,\nat the number beside it"
        )
    pairs = zip(table["value"].tolist(), table["bounds"].tolist(), strict=True)
    values = zip(names, (near_zero(value, *bounds) for value, bounds in pairs), units, strict=True)
    labels = [f"{name}\n{value:.4g}{'' if unit == '1' else ' ' + unit}" for name, value, unit in values]
    axes.set_yticks(range(len(names)), labels, fontsize=8)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="x", lw=0.4)
    axes.set_xlabel("value / start (where the start is 0: value)")
    legend_beside(axes)
    return figure


def _mark(axes: Axes, share: float, row: int, color: str) -> None:
    """The value: a dot; at the edge of the axis an empty one with its number, where it lies beyond. NaN: nothing."""
    left, right = axes.get_xlim()
    if left <= share <= right or not np.isfinite(share):
        axes.plot(share, row, "o", color=color, ms=7)
        return
    edge, side, away = (left, "left", 10) if share < left else (right, "right", -10)
    axes.plot(edge, row, "o", color=color, mfc="white", ms=9, mew=1.8, clip_on=False, zorder=3)
    axes.annotate(f"{share:.3g}", (edge, row), (away, 7), textcoords="offset points", ha=side, fontsize=8, color=color)


def _limits(shown: list[np.ndarray]) -> tuple[float, float]:
    """Around everything between -1 and 3: an interval without end must not hide the others."""
    values = np.concatenate([one.ravel() for one in shown])
    values = np.clip(values[np.isfinite(values)], -1.0, 3.0)
    low, high = float(values.min()), float(values.max())
    margin = 0.05 * max(high - low, 0.1)
    return low - margin, high + margin
