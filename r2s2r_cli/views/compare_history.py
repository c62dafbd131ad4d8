"""How errors of the simulators went over the iterations, beside their floor: a picture and a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.views.compare import MODELS
from r2s2r_cli.views.compare_tables import MEASURES, TRAINED
from r2s2r_cli.views.figure import as_typed, new_figure, png_bytes
from r2s2r_cli.views.page import PageTable
from schemas.results_compare import CompareHistory, CompareReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHOWN = ("com_end_m", "heading_end_rad", "keyframe_cap_m", "segment_s")
"""What the paper's loop is judged by, and key frames, which identification fits."""
_NUDGE = 0.07
"""Sets of runs stand this far beside each other, so that their intervals can be told apart."""


def history_table(report: CompareReport) -> PageTable | None:
    """A row a simulator: the root mean square errors of each iteration's runs. None where there is one simulator."""
    models = list(dict.fromkeys(one.model for one in report.history))
    numbers = sorted({one.iteration for one in report.history})
    if len(models) < 2:
        return None
    by = {(one.iteration, one.model): one for one in report.history}
    columns = ["simulator"]
    rows = [[model] for model in models]
    floors = ["floor"]
    for number in numbers:
        for name in SHOWN:
            words, scale = MEASURES[name]
            known = [one.runs[name] for one in report.history if one.iteration == number and name in one.runs]
            if not known:
                continue
            columns.append(f"{words.split(',')[0].split(' [')[0]} [{words.split('[')[1]}, runs of {number}")
            floors.append("-" if known[0].floor is None else f"{scale * known[0].floor:.3g}")
            for row, model in zip(rows, models, strict=True):
                row.append(_cell(by.get((number, model)), name, scale))
    return PageTable(
        f"errors over the iterations, the floor below them ({TRAINED} learned from these runs)",
        columns,
        [*rows, floors],
    )


def draw_history(report: CompareReport) -> bytes | None:
    """PNG: the errors of each iteration's runs under every simulator, in their order, with intervals and floor. None
    where there is one simulator."""
    models = list(dict.fromkeys(one.model for one in report.history))
    if len(models) < 2:
        return None
    shown = [name for name in SHOWN if any(name in one.runs for one in report.history)]
    figure = new_figure(3.4 * max(len(shown), 2), 4.2)
    axes = figure.subplots(1, len(shown), squeeze=False)[0]
    for panel, name in zip(axes, shown, strict=True):
        _panel(panel, report, name, models)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=9)
    figure.suptitle("Errors over the iterations, beside their floor: the same real runs under every simulator")
    return png_bytes(figure)


def _panel(axes: Axes, report: CompareReport, name: str, models: list[str]) -> None:
    words, scale = MEASURES[name]
    numbers = sorted({one.iteration for one in report.history})
    for k, number in enumerate(numbers):
        color = MODELS[(k + 1) % len(MODELS)]
        mine = [one for one in report.history if one.iteration == number and name in one.runs]
        x = [models.index(one.model) + _NUDGE * (k - 0.5 * (len(numbers) - 1)) for one in mine]
        y = [scale * one.runs[name].rms for one in mine]
        axes.plot(x, y, color=color, lw=1.5)
        for at, value, one in zip(x, y, mine, strict=True):
            measure = one.runs[name]
            if measure.lower is not None and measure.upper is not None:
                axes.plot([at, at], [scale * measure.lower, scale * measure.upper], color=color, lw=3, alpha=0.25)
            axes.plot(at, value, "o", color=color, ms=7, mfc="white" if one.trained_on else color, mew=1.6)
        axes.plot([], [], "o-", color=color, label=f"runs of iteration {number}")
        floor = next((one.runs[name].floor for one in mine), None)
        if floor is not None:
            axes.axhline(scale * floor, color=color, lw=1.2, ls=":")
    axes.plot([], [], "o", color="gray", mfc="white", mew=1.6, label="the simulator learned from them")
    axes.plot([], [], ":", color="gray", label="floor")
    axes.set_xticks(range(len(models)), [as_typed(model) for model in models], rotation=20, ha="right")
    axes.set_xlim(-0.4, len(models) - 0.6)
    axes.set_ylim(0, 1.1 * axes.get_ylim()[1])
    axes.set_title(words.replace(", command replay", "").replace(" [", "\n["), fontsize=10)
    axes.grid(axis="y", alpha=0.3)


def _cell(one: CompareHistory | None, name: str, scale: float) -> str:
    if one is None or name not in one.runs:
        return "-"
    return f"{scale * one.runs[name].rms:.3g}{f' {TRAINED}' if one.trained_on else ''}"
