"""Picture of a camera run: how sure each cap is, what was seen of it, residuals, cable sensors against the camera."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import CAP_STYLE, draw_bands, legend_below, legend_beside, new_figure, png_bytes, rod_color
from schemas.estimate import MODE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_SENSOR, _BAND = "#b8860b", "#e6cf94"
_SHADES = ("#2c7a4b", "#9ccc65", "#b0b0b0", "#3c3c3c", "#d4380d", "#000000")
"""Of the codes of a sighting: seen, colour only, out of the picture, hidden, doubtful, no picture."""
_CODES = ("seen", "colour only", "out of view", "hidden", "doubtful", "no picture")
_RESIDUAL = 5.0


def draw_camera_run(data: ArtifactData, run: str) -> bytes:
    """PNG."""
    frames, sightings = data.groups[f"runs/{run}/frames"], data.groups[f"runs/{run}/sightings"]
    # Sensors that speak too rarely for lengths between their readings have a bias, but nothing to draw beside it.
    fit = data.group(run, "sensor_fit") if "sensor_cable" in frames else None
    figure = new_figure(15, 14 if fit is not None else 8)
    figure.suptitle(f"run {run}: what the camera saw, and how sure the estimate is")
    heights = (1.1,) if fit is None else (1.1, 1.0)
    parts = np.atleast_1d(np.asarray(figure.subfigures(len(heights), 1, height_ratios=heights)))
    grid = parts[0].subplots(4, 1, sharex=True, height_ratios=(2, 1.2, 2, 0.8))
    for axes in grid:
        draw_bands(axes, data.group(run, "intervals"), numbers=axes is grid[0])
    _sureness(grid[0], frames)
    _seen(grid[1], frames, sightings)
    _residuals(grid[2], frames, sightings)
    _modes(grid[3], frames)
    grid[3].set_xlabel("time [s]")
    if fit is not None:
        _sensors(parts[1], frames, fit)
    return png_bytes(figure)


def _sureness(axes: Axes, frames: Group) -> None:
    sd = 1e3 * np.sqrt(np.linalg.eigvalsh(frames["cov_p_WE"])[..., -1])
    for cap in range(sd.shape[1]):
        axes.semilogy(frames["t"], sd[:, cap], CAP_STYLE[cap % 2], lw=1, color=rod_color(cap), label=f"cap {cap}")
    axes.set_ylabel("sd of cap, worst\ndirection [mm]")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.tick_params(axis="y", which="minor", labelsize=6)
    legend_beside(axes)


def _seen(axes: Axes, frames: Group, sightings: Group) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    code, t = sightings["code"], frames["t"]
    caps = code.shape[1]
    axes.pcolormesh(_edges(t), np.arange(caps + 1) - 0.5, code.T, cmap=ListedColormap(_SHADES),
                    norm=BoundaryNorm(np.arange(len(_SHADES) + 1) - 0.5, len(_SHADES)))  # fmt: skip
    axes.set_yticks(range(caps), [f"cap {cap}" for cap in range(caps)], fontsize=7)
    axes.invert_yaxis()
    handles = [Patch(color=_SHADES[i], label=_CODES[i]) for i in np.unique(code).tolist()]
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)


def _residuals(axes: Axes, frames: Group, sightings: Group) -> None:
    size = np.sqrt(np.mean(sightings["residual"] ** 2, axis=-1))
    for cap in range(size.shape[1]):
        axes.plot(frames["t"], np.minimum(size[:, cap], _RESIDUAL), ".", ms=2.5, color=rod_color(cap),
                  alpha=1.0 if cap % 2 else 0.5)  # fmt: skip
    rejected = frames["quality"] == 2
    for cap in range(size.shape[1]):
        t = frames["t"][rejected[:, cap]]
        axes.plot(t, np.full(len(t), _RESIDUAL), "x", ms=6, color="#d4380d")
    axes.axhline(1.0, color="black", lw=0.8, ls=":", label="as large as stated")
    axes.plot([], [], "x", ms=6, color="#d4380d", label="rejected")
    axes.set(ylabel="sighting minus\nsmoothed cap [sd]", ylim=(0, 1.06 * _RESIDUAL))
    legend_beside(axes)


def _modes(axes: Axes, frames: Group) -> None:
    from matplotlib.colors import ListedColormap

    mode = frames["mode"]
    rows = np.array([(mode & bit) > 0 for bit in MODE])
    shades = ListedColormap(["#00000000", "#d4380d"])
    axes.pcolormesh(_edges(frames["t"]), np.arange(len(rows) + 1) - 0.5, rows, cmap=shades, vmin=0, vmax=1)
    axes.set_yticks(range(len(rows)), [words.partition(":")[0] for words in MODE.values()], fontsize=7)
    axes.invert_yaxis()


def _sensors(figure: SubFigure, frames: Group, fit: Group) -> None:
    """What each sensor shows minus what the camera sees, its bias on it."""
    cable, t = frames["sensor_cable"], frames["t"]
    columns = math.ceil(math.sqrt(len(cable)))
    grid = figure.subplots(math.ceil(len(cable) / columns), columns, sharex=True, sharey=True, squeeze=False)
    off = 1e3 * (frames["sensor_length"] - frames["length"][:, cable])
    bias, sd = 1e3 * fit["bias"], 1e3 * fit["bias_sd"]
    for axes, i in zip(grid.flat, range(len(cable)), strict=False):
        axes.plot(t, off[:, i], ".", ms=2, color=_SENSOR, label="sensor minus camera")
        low, high = bias[:, i] - 2 * sd[:, i], bias[:, i] + 2 * sd[:, i]
        axes.fill_between(t, low, high, color=_BAND, lw=0, alpha=0.8, label="bias, 2 sd")
        axes.plot(t, bias[:, i], color="black", lw=1, label="estimated bias")
        axes.set_title(f"cable {cable[i]}" + (": not used" if fit["dead"][i] else ""), fontsize=9)
    for axes in grid.flat[len(cable) :]:
        axes.set_axis_off()
    for axes in grid[:, 0]:
        axes.set_ylabel("[mm]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    known = np.concatenate([off[np.isfinite(off)], bias.ravel()])
    bottom, top = np.percentile(known, (1, 99))
    grid[0, 0].set_ylim(bottom - 5, top + 5)
    legend_below(figure, list(grid.flat[: len(cable)]))


def _edges(t: np.ndarray) -> np.ndarray:
    """Ends of the time that each frame stands for, (frame + 1,)."""
    middle = 0.5 * (t[1:] + t[:-1])
    return np.concatenate([[t[0]], middle, [t[-1]]])
