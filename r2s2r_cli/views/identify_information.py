"""What the runs can tell: spectrum and directions of the scaled normal matrix, and the correlations after the fit."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import GREEN, RED, new_figure, png_bytes
from r2s2r_cli.views.identify_data import shown_in_log, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WEAK, _STRONG = RED, GREEN
_WRAP = 58
"""Characters of a line of words."""
_LINE_IN = 0.135
"""Height of such a line [inches]."""
_NUMBERS_UP_TO = 16
"""A larger matrix has no room for its numbers."""


def draw_information(data: ArtifactData) -> bytes:
    """Spectrum with words, directions as a heat map, and the correlations where there was a covariance."""
    return png_bytes(information_figure(data))


def information_figure(data: ArtifactData) -> Figure:
    """The same, not yet drawn; its rows are as high as the longest words need."""
    info, names = data.groups["identifiability"], words(data.groups["parameters"], "name")
    covariance = data.groups.get("covariance")
    labels = [textwrap.wrap(text, _WRAP) or [""] for text in words(info, "words")]
    row = max(0.42, _LINE_IN * max((len(lines) for lines in labels), default=1) + 0.08)
    figure = new_figure(19, 2.4 + row * max(len(names), len(labels)))
    columns = figure.subplots(1, 2 if covariance is None else 3, squeeze=False)[0]
    _spectrum(columns[0], info, ["\n".join(lines) for lines in labels])
    _matrix(figure, columns[1], info["eigenvector"], "directions (rows as left), share of each parameter")
    columns[1].set_xticks(range(len(names)), names, rotation=90, fontsize=8)
    columns[1].set_yticks([])
    if covariance is not None:
        _matrix(figure, columns[2], covariance["correlation"], "correlation of the estimates (grey: nothing is known)")
        columns[2].set_xticks(range(len(names)), names, rotation=90, fontsize=8)
        columns[2].set_yticks(range(len(names)), names, fontsize=8)
    return figure


def _spectrum(axes: Axes, info: Group, labels: list[str]) -> None:
    value, weak = info["eigenvalue"], info["weak"]
    threshold = float(info.attributes["threshold"])
    seen = shown_in_log(value)
    floor = min(float(np.nanmin(seen)) if np.isfinite(seen).any() else threshold, threshold) / 30
    rows = np.arange(len(value))
    width = np.where(np.isfinite(seen), seen, floor)
    axes.barh(rows, width, color=[_WEAK if one else _STRONG for one in weak.tolist()], height=0.6)
    axes.set_xscale("log")
    axes.set_xlim(floor, 3 * max(float(np.max(width)), threshold))
    axes.axvline(threshold, color="black", lw=1, ls="--")
    axes.annotate("left: prior or range\nsays more than the runs", (threshold, 1.0), (-3, 2), ha="right", va="bottom",
                  xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=7)  # fmt: skip
    axes.set_yticks(rows, labels, fontsize=7)
    axes.set_ylim(len(value) - 0.5, -0.5)
    axes.set_title("spectrum of the scaled normal matrix", fontsize=9, loc="right")
    axes.set_xlabel("information (eigenvalue), red: weak")


def _matrix(figure: Figure, axes: Axes, values: np.ndarray, title: str) -> None:
    from matplotlib import colormaps

    colors = colormaps["RdBu_r"].with_extremes(bad="#d5dae0")
    image: Any = axes.imshow(np.ma.masked_invalid(values), cmap=colors, vmin=-1, vmax=1, aspect="auto")
    if max(values.shape) <= _NUMBERS_UP_TO:
        for (i, j), value in np.ndenumerate(values):
            if np.isfinite(value) and abs(value) >= 0.05:
                axes.annotate(f"{value:.2f}", (j, i), ha="center", va="center", fontsize=6,
                              color="white" if abs(value) > 0.6 else "black")  # fmt: skip
    axes.set_title(title, fontsize=9)
    figure.colorbar(image, ax=axes, fraction=0.04, pad=0.02)
