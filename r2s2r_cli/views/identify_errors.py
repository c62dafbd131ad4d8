"""How wrong the simulation is: key-frame errors by segment beside baselines and floor, and white or not."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import legend_beside, new_figure, png_bytes
from r2s2r_cli.views.identify_data import ROLE_COLORS, ROLE_WORDS, segment_names, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WHITENESS = "correlation of neighbouring residuals; ! not white: something is not modelled, or the tracker drifts"
_TOO_FEW = "; grey: too few frames"
_REPEATING = "identified + what repeats"
_LETTERS = 110
"""So many fit below the axis side by side, with gaps between as many names."""
_DARK = 0.6
"""Correlations whose colour hides black signs."""
_SPREAD = 0.7
"""Of the distance between segments: marks stand side by side over it, so that none hides another."""
_FULL, _PALE = "#303842", "#8a929b"
_MARKS = ("_", "x", "+", "^", "v", "d", "s", "*")


def draw_errors(data: ArtifactData) -> bytes:
    """Key-frame error of each segment as a bar, baselines as marks, floor as a line; correlation per cap below."""
    segments, measures = data.groups["segments"], data.groups["measures"]
    figure = new_figure(15, 9)
    top, bottom = figure.subplots(2, 1, height_ratios=(1.5, 1))
    _bars(top, segments, measures, data.groups.get("repeating"))
    _whiteness(figure, bottom, segments)
    return png_bytes(figure)


def floor_of(measures: Group) -> float:
    """The floor of the key frames [m]; NaN where it is not known."""
    rows = [i for i, name in enumerate(words(measures, "metric")) if name == "keyframe_cap_rmse"]
    known = [float(measures["floor"][i]) for i in rows if math.isfinite(measures["floor"][i])]
    return known[-1] if known else math.nan


def errors_with_repeats(segments: Group, repeats: Group | None) -> np.ndarray | None:
    """Key-frame error with what repeats of every segment [m], NaN in training; None where it was not looked at."""
    if repeats is None:
        return None
    known = zip(words(repeats, "run"), repeats["interval"].tolist(), repeats["keyframe_cap_rmse"].tolist(), strict=True)
    errors = {(run, interval): error for run, interval, error in known}
    names = zip(words(segments, "run"), segments["interval"].tolist(), strict=True)
    return np.array([errors.get(name, math.nan) for name in names])


def _bars(axes: Axes, segments: Group, measures: Group, repeats: Group | None = None) -> None:
    from matplotlib.patheffects import withStroke

    x = np.arange(len(segments["interval"]))
    roles = segments["role"].tolist()
    # Some marks lie on bars, which are as dark.
    edge = [withStroke(linewidth=4, foreground="white")]
    axes.bar(x, 1e3 * segments["keyframe_cap_rmse"], color=[ROLE_COLORS[role] for role in roles], width=0.6)
    for role in sorted(set(roles)):
        axes.bar([0], [0], color=ROLE_COLORS[role], label=f"identified, {ROLE_WORDS[role]}")
    repeating = errors_with_repeats(segments, repeats)
    # The bars, and where it is drawn by itself what repeats: once each.
    drawn = ("identified",) if repeating is None else ("identified", _REPEATING)
    marked = [(k, name) for k, name in enumerate(words(measures, "baseline")) if name not in drawn]
    aside = _SPREAD * (np.arange(len(marked) + 1) - 0.5 * len(marked)) / max(len(marked), 1)
    for (k, name), beside in zip(marked, aside, strict=False):
        error, mark = 1e3 * segments["baseline_cap_rmse"][:, k], _MARKS[k % len(_MARKS)]
        color = _PALE if k % 2 else _FULL
        axes.plot(x + beside, error, mark, ms=9, mew=1.8, color=color, label=name, path_effects=edge)
    if repeating is not None:
        axes.plot(x + aside[-1], 1e3 * repeating, "P", ms=10, mec="black", color="#f5c518", label=_REPEATING)
    floor = floor_of(measures)
    if math.isfinite(floor):
        axes.axhline(1e3 * floor, color="black", lw=1, ls="--", label=f"floor {1e3 * floor:.1f} mm")
    _name_segments(axes, segments)
    axes.set_ylabel("end caps at the key frame, rms [mm]")
    axes.set_ylim(0, None)
    legend_beside(axes)


def _name_segments(axes: Axes, segments: Group) -> None:
    """The same axis in both panels, a segment below its bar; names upright where they do not fit side by side."""
    names = segment_names(segments)
    upright = sum(map(len, names)) > _LETTERS
    axes.set_xticks(range(len(names)), names, fontsize=8, rotation=90 if upright else 0)
    axes.set(xlabel="target interval", xlim=(-0.5, len(names) - 0.5))


def _whiteness(figure: Figure, axes: Axes, segments: Group) -> None:
    from matplotlib import colormaps

    lag1, white = segments["lag1"].T, segments["white"].T
    colors = colormaps["RdBu_r"].with_extremes(bad="#d5dae0")
    image: Any = axes.imshow(np.ma.masked_invalid(lag1), cmap=colors, vmin=-1, vmax=1, aspect="auto")
    for cap, segment in np.argwhere(~white & np.isfinite(lag1)).tolist():
        color = "white" if abs(lag1[cap, segment]) > _DARK else "black"
        axes.annotate("!", (segment, cap), ha="center", va="center", fontsize=13, weight="bold", color=color)
    axes.set_yticks(range(len(lag1)), [f"cap {cap}" for cap in range(len(lag1))], fontsize=8)
    _name_segments(axes, segments)
    axes.set_title(_WHITENESS + ("" if np.isfinite(lag1).all() else _TOO_FEW), fontsize=9)
    figure.colorbar(image, ax=axes, fraction=0.03, pad=0.01)
