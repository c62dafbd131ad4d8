"""What a camera sees, with pixel coordinates to point at: colour with the caps found, and depth with the ground."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from r2s2r_cli.views.figure import ROD_COLORS, as_typed, new_figure, png_bytes

_GRID_PX = 80
_UNKNOWN = "#c8c8c8"
_RANGE_PERCENT = (0.2, 99.8)


def draw_preview(
    color: np.ndarray, z: np.ndarray, height: np.ndarray | None, *, masks: Mapping[str, np.ndarray], title: str
) -> bytes:
    """PNG. color: RGB (v, u, 3); z: depth [m] (v, u), NaN unknown; height: over the ground [m], if there is one.

    masks: pixels of each rod's caps.
    """
    rows, columns = z.shape
    figure = new_figure(14.4, 6.4 * rows / columns + 1.1)
    figure.suptitle(as_typed(title), fontsize=10)
    left, right = figure.subplots(1, 2)
    left.imshow(color, extent=(0, columns, rows, 0), interpolation="nearest")
    u, v = np.arange(columns) + 0.5, np.arange(rows) + 0.5
    for rod, (name, mask) in enumerate(masks.items()):
        shade = ROD_COLORS[rod % len(ROD_COLORS)]
        for line, width in (("white", 2.2), (shade, 1.0)) if mask.any() else ():
            left.contour(u, v, mask.astype(float), [0.5], colors=line, linewidths=width)
        left.plot([], [], color=shade, label=f"rod {as_typed(name)}: {int(mask.sum())} px")
    _pixels(left, columns, rows, "colour; outlined: what is taken for a cap")
    if masks:
        left.legend(loc="upper left", fontsize=7, framealpha=0.85)
    if height is None:
        _map(figure, right, z, "z [m]")
    else:
        _map(figure, right, 1000 * height, "height over the ground [mm]")
    _pixels(right, columns, rows, "depth; grey: unknown")
    return png_bytes(figure, 110)


def _map(figure: Any, axes: Any, values: np.ndarray, label: str) -> None:
    from matplotlib import colormaps

    known = values[np.isfinite(values)]
    low, high = np.percentile(known, _RANGE_PERCENT) if known.size else (0.0, 1.0)
    shades = colormaps["viridis"].with_extremes(bad=_UNKNOWN)
    box = (0, values.shape[1], values.shape[0], 0)
    drawn = axes.imshow(values, extent=box, cmap=shades, vmin=low, vmax=high, interpolation="nearest")
    figure.colorbar(drawn, ax=axes, label=label, shrink=0.8)


def _pixels(axes: Any, columns: int, rows: int, title: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.set(xlim=(0, columns), ylim=(rows, 0), xlabel="u [px]", ylabel="v [px]")
    axes.set_xticks(np.arange(0, columns + 1, _GRID_PX))
    axes.set_yticks(np.arange(0, rows + 1, _GRID_PX))
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.25, lw=0.5)
