"""One picture a run: where real and simulated robot went, what each segment adds, and how long it took."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from r2s2r_cli.views.figure import BLUE, GREEN, ORANGE, PURPLE, as_typed, new_figure, png_bytes, rod_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REAL = "#111111"
MODELS = (BLUE, ORANGE, GREEN, PURPLE, "#56b4e9")
"""Colours of the simulators in their order (Okabe and Ito), used again beyond the last."""
_WIDTH, _HEIGHT = 13.0, 8.0


def model_color(k: int) -> str:
    """Colour of simulator k."""
    return MODELS[k % len(MODELS)]


def draw_comparison(data: ArtifactData) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run."""
    names = [as_typed(name.decode()) for name in data.groups["models"]["name"].tolist()]
    for run in data.runs():
        real, simulated = data.groups[f"runs/{run}/real"], data.groups[f"runs/{run}/simulated"]
        figure = new_figure(_WIDTH, _HEIGHT)
        axes = figure.subplot_mosaic(
            [["top", "end"], ["top", "gait"], ["top", "key"], ["top", "time"]], width_ratios=[1.2, 1]
        )
        for name in ("end", "gait", "key"):
            axes[name].sharex(axes["time"])
        floor = data.groups["floor"].attributes
        _top(axes["top"], real, simulated, names)
        _bars(axes["end"], 1e3 * simulated["segment_end"], names, "caps at the end\nof each interval [mm]", None)
        _bars(axes["gait"], 1e3 * simulated["gait"], names, "the same, laid on\nat its start [mm]", floor.get("gait"))
        _bars(
            axes["key"],
            1e3 * simulated["keyframe"],
            names,
            "key frames, com-\nmand replay [mm]",
            floor.get("keyframe_cap"),
        )
        _times(axes["time"], real, simulated, names)
        figure.suptitle(run)
        yield run, png_bytes(figure)


def _top(axes: Axes, real: Group, simulated: Group, names: list[str]) -> None:
    """Paths of the centre of mass seen from above, and the rods at the ends."""
    _walk(axes, real["com"].reshape(-1, 3), real["p_WE"][-1, -1], REAL, "real robot", width=2.4)
    _rods(axes, real["p_WE_start"], 0.25)
    for k, name in enumerate(names):
        count = int(simulated["compared"][k])
        if count:
            com = simulated["com"][k, :count].reshape(-1, 3)
            _walk(axes, com, simulated["p_WE"][k, count - 1, -1], model_color(k), name, width=1.6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="seen from above; pale: the rods at the start")
    axes.legend(fontsize=8)


def _walk(axes: Axes, com: np.ndarray, p_WE: np.ndarray, color: str, name: str, *, width: float) -> None:
    axes.plot(com[:, 0], com[:, 1], color=color, lw=width, label=name)
    axes.plot(com[-1, 0], com[-1, 1], "o", color=color, ms=6)
    for a in range(0, len(p_WE), 2):
        axes.plot(*p_WE[a : a + 2, :2].T, color=color, lw=0.8, alpha=0.7)


def _rods(axes: Axes, p_WE: np.ndarray, alpha: float) -> None:
    for a in range(0, len(p_WE), 2):
        axes.plot(*p_WE[a : a + 2, :2].T, color=rod_color(a), lw=3, alpha=alpha)


def _bars(axes: Axes, values: np.ndarray, names: list[str], label: str, floor: Scalar | None) -> None:
    """values: (model, interval) [mm]; floor [m]."""
    width = 0.8 / max(len(names), 1)
    x = np.arange(1, values.shape[1] + 1)
    for k, name in enumerate(names):
        axes.bar(x - 0.4 + (k + 0.5) * width, np.nan_to_num(values[k]), width, color=model_color(k), label=name)
    if floor is not None:
        axes.axhline(1e3 * float(floor), color=REAL, lw=1, ls=":", label="floor")
        axes.annotate("floor", (0.995, 1e3 * float(floor)), xycoords=("axes fraction", "data"), fontsize=8, ha="right",
                      va="bottom")  # fmt: skip
    axes.set(ylabel=label)
    axes.tick_params(labelbottom=False)


def _times(axes: Axes, real: Group, simulated: Group, names: list[str]) -> None:
    from matplotlib.ticker import MaxNLocator

    x = np.arange(1, len(real["duration"]) + 1)
    axes.plot(x, real["duration"], "_", color=REAL, ms=14, mew=3)
    for k, _ in enumerate(names):
        axes.plot(x, simulated["duration"][k], "o", color=model_color(k), ms=4)
    axes.set(xlabel="target interval", ylabel="duration [s]", ylim=(0, None), xlim=(0.4, len(x) + 0.6))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
