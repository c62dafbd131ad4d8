"""What all pictures share: rod colours, bands of the target intervals, legends beside the data, PNG bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import Group

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

ROD_COLORS = ("#c1272d", "#2a7f3e", "#0b5fa5", "#b8860b", "#6b3fa0", "#3b8ea5")
"""Rods in their order; the first three are the robot's own red, green and blue."""
CAP_STYLE = ("-", "--")
"""Even caps are drawn solid, odd ones dashed."""
BLUE, ORANGE, GREEN, PURPLE, RED = "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00"
"""Of the palette of Okabe and Ito, which colour-blind people can tell apart."""
GREY, PALE = "#555555", "#bbbbbb"
_BAND = ("#eef2f7", "#dbe3ee")
_NUMBER = "#5a6675"
_KEY_IN, _LETTER_IN = 0.55, 0.068
"""A legend's mark with the gaps around it, and one of its letters at 8 pt [inches]."""
_MIN_BAND_SHARE = 0.02
"""A band narrower than this share of the axis has no room for its number."""


def new_figure(width: float, height: float) -> Figure:
    """An empty figure [inches] that is drawn without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def png_bytes(figure: Figure, dpi: int = 100) -> bytes:
    """The figure as PNG; equal figures give equal bytes."""
    buffer = io.BytesIO()
    layout = figure.get_layout_engine()
    if layout is not None and figure.dpi == dpi:  # or all would be drawn once more, for nothing but the layout
        layout.execute(figure)
        figure.set_layout_engine(None)
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    figure.set_layout_engine(layout)
    return buffer.getvalue()


def texts(group: Group, name: str) -> list[str]:
    """A dataset of texts."""
    return [bytes(value).decode() for value in group[name]]


def as_typed(name: str) -> str:
    """A name that somebody chose, for a picture: between two `$` matplotlib would read formulas, or refuse them."""
    return name.replace("$", r"\$")


def rod_color(cap: int) -> str:
    """Colour of the rod that `cap` belongs to."""
    return ROD_COLORS[cap // 2 % len(ROD_COLORS)]


def draw_bands(axes: Axes, intervals: Group | None, *, numbers: bool = True) -> None:
    """Target intervals as pale bands, numbered from 1 where there is room for a number."""
    if intervals is None or not len(intervals["t_first"]):
        return
    whole = float(intervals["t_last"][-1] - intervals["t_first"][0])
    for i, (start, stop) in enumerate(zip(intervals["t_first"], intervals["t_last"], strict=True)):
        axes.axvspan(start, stop, color=_BAND[i % 2], lw=0)
        if numbers and stop - start >= _MIN_BAND_SHARE * whole:
            axes.annotate(str(i + 1), ((start + stop) / 2, 1.0), xycoords=("data", "axes fraction"), ha="center",
                          va="bottom", fontsize=7, color=_NUMBER)  # fmt: skip


def draw_rods(axes: Axes, p_WE: np.ndarray) -> None:
    """First frame pale and last frame full, from above, the caps of the last one numbered. p_WE (frame, cap, 3) [m]."""
    for frame, alpha in ((0, 0.35), (-1, 1.0)):
        for cap in range(0, p_WE.shape[1], 2):
            ends = p_WE[frame, cap : cap + 2]
            axes.plot(ends[:, 0], ends[:, 1], "o-", color=rod_color(cap), lw=3, ms=10, alpha=alpha)
    for cap in range(p_WE.shape[1]):
        x, y = p_WE[-1, cap, :2]
        axes.annotate(str(cap), (x, y), ha="center", va="center", fontsize=7, color="white", weight="bold")


def spread_out(points: np.ndarray, distance: float) -> list[int]:
    """Indices of points (n, 2) taken in their order, none nearer than `distance` to one taken before."""
    taken: list[int] = []
    for i, point in enumerate(points):
        if all(np.hypot(*(point - points[j])) >= distance for j in taken):
            taken.append(i)
    return taken


def legend_columns(width: float, labels: Sequence[str]) -> int:
    """Most columns of a legend of small letters that is not cut off by a figure so wide [inches]. Columns share the
    labels evenly, each is as wide as its longest one."""
    for columns in range(len(labels), 1, -1):
        longest = [max(map(len, part)) for part in np.array_split(np.array(labels, dtype=object), columns)]
        if _KEY_IN * columns + _LETTER_IN * sum(longest) <= width:
            return columns
    return 1


def legend_beside(axes: Axes, **options: Any) -> None:
    """A legend to the right of the axes: it covers no data."""
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False, **options)


def legend_entries(axes: Sequence[Axes]) -> dict[str, Any]:
    """What a legend of several panels has, handles by label, each label once."""
    entries: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    return entries


def legend_below(figure: Figure | SubFigure, axes: Sequence[Axes], columns: int = 6) -> None:
    """One legend under all panels, each label once."""
    entries = legend_entries(axes)
    if entries:
        figure.legend(
            list(entries.values()),
            list(entries),
            loc="outside lower center",
            ncol=min(columns, len(entries)),
            fontsize=8,
            frameon=False,
        )
