"""The floor from above: where the robot was, how far off the simulation was there, and what contacts say of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.diagnose_words import MARKED, accused
from r2s2r_cli.views.figure import legend_below, new_figure, png_bytes, rod_color

if TYPE_CHECKING:
    from schemas.results_diagnose import DiagnoseReport

ARROW = 5.0
"""Times that errors are drawn larger than they are."""
NO_ARROW = "\nno arrows: an interval at whose end a cap was more than 25 cm off"


def floor_picture(data: ArtifactData, report: DiagnoseReport) -> bytes:
    """Errors at the ends of all fitted intervals as arrows at the caps; the map of the contact probe."""
    rows = data.groups["segments"]
    figure = new_figure(7.5, 6.2)
    axes = figure.subplots()
    if "place" in data.groups:
        place = data.groups["place"]
        seen = np.where(place["weight"] > 0, place["value"], np.nan)
        if np.isfinite(seen).any():
            limit = max(float(np.nanmax(np.abs(seen))), 1e-6)
            shown = axes.pcolormesh(
                place["x"], place["y"], seen, cmap="RdBu", vmin=-limit, vmax=limit, alpha=0.6, shading="nearest"
            )
            figure.colorbar(
                shown, ax=axes, label="change of friction that contacts ask for [1]\nred: less, blue: more", shrink=0.8
            )
    xy, error = rows["xy"], rows["error"]
    tips = xy - ARROW * error[..., :2]
    known = np.isfinite(tips).all(axis=-1)
    lost = np.isfinite(xy).all(axis=-1) & ~known
    for row, cap in np.argwhere(known).tolist():
        axes.annotate("", xy=tips[row, cap], xytext=xy[row, cap],
                      arrowprops={"arrowstyle": "->", "color": rod_color(cap), "lw": 0.9})  # fmt: skip
    if known.any():
        # Arrows stretch no axes by themselves, and one that ends outside of them is not drawn: the largest errors.
        axes.update_datalim(tips[known])
    for cap in range(xy.shape[1]):
        axes.plot(xy[:, cap, 0], xy[:, cap, 1], ".", ms=4, color=rod_color(cap))
    for rod in range(xy.shape[1] // 2):
        axes.plot([], [], ".-", color=rod_color(2 * rod), label=f"rod {rod}, caps {2 * rod} and {2 * rod + 1}")
    element = accused(report)
    if element is not None and element.xy_m is not None:
        axes.plot(*element.xy_m, "x", ms=16, mew=3, color=MARKED)
        axes.annotate("named place", element.xy_m, xytext=(10, 10), textcoords="offset points", color=MARKED,
                      bbox={"boxstyle": "round", "fc": "white", "ec": "none", "alpha": 0.8}, zorder=6)  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    title = (
        "dots: caps at the ends of intervals; arrows: how much farther\n"
        f"the robot went than the refit model, {ARROW:g} times enlarged"
    )
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title + (NO_ARROW if lost.any() else ""))
    axes.margins(0.1)
    legend_below(figure, [axes])
    return png_bytes(figure)
