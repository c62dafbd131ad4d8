"""Pictures of a calibration: every fit with its residuals, the drift, the tendon curves, the rods with their masses."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from schemas.calibration import LINE_STATES
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, PURPLE, RED = "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00"
"""Of the palette of Okabe and Ito, which colour-blind people can tell apart."""

_SERIES = ((BLUE, "o"), (ORANGE, "s"), (GREEN, "^"), (PURPLE, "D"))
_GREY, _PALE = "#555555", "#bbbbbb"
_SWAP = 2
DAY_S = 86400.0


def draw_calibration(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, bytes]]:
    """(name, PNG) of everything that was measured: `sensors-<set>`, `drift`, `tendons`, `masses`."""
    groups = data.groups
    if "lines" in groups:
        names = _texts(groups["lines"], "name")
        for number, (name, file_name) in enumerate(zip(names, _file_names(names), strict=True)):
            yield f"sensors-{file_name}", _sensors(groups["points"], groups["lines"], number, name)
    if "history" in groups:
        yield "drift", _drift(groups["history"], groups["drift"])
    if "tendons" in groups:
        yield "tendons", _tendons(groups["tendon_points"], groups["tendons"])
    if "masses" in groups:
        yield "masses", _masses(groups["mass_parts"], groups["masses"], robot)


def _sensors(points: Group, lines: Group, number: int, name: str) -> bytes:
    n = lines["slope"].shape[1]
    columns = min(3, n)
    rows = math.ceil(n / columns)
    figure = _figure(4.2 * columns, 3.1 * rows + 0.6)
    mine = points["set"] == number
    both = np.concatenate([points[name][mine] for name in ("residual", "loo_residual")])
    reach = 1.15e3 * np.nanmax(np.abs(both), initial=5e-4)
    grid = figure.add_gridspec(2 * rows, columns, height_ratios=(3, 1.3) * rows)
    for sensor in range(n):
        row, column = divmod(sensor, columns)
        fit, below = figure.add_subplot(grid[2 * row, column]), figure.add_subplot(grid[2 * row + 1, column])
        _sensor(fit, below, points, lines, number, sensor)
        below.set_ylim(-reach, reach)
        if column == 0:
            fit.set_ylabel("capacitance [pF]")
            below.set_ylabel("residual\n[mm]")
        if sensor + columns >= n:
            below.set_xlabel("length [mm]")
    figure.suptitle(
        f"set {name}: line per sensor, rms {1e3 * lines['rms_set'][number]:.2f} mm over all points\n"
        "residual: length read from the line minus measured length (ring: line fitted without that point)"
    )
    return _png(figure)


def _sensor(fit: Axes, below: Axes, points: Group, lines: Group, number: int, sensor: int) -> None:
    rows = (points["set"] == number) & (points["sensor"] == sensor)
    length, capacitance = points["length"][rows], points["capacitance"][rows]
    slope, offset = lines["slope"][number, sensor], lines["offset"][number, sensor]
    state = int(lines["state"][number, sensor])
    color = BLUE if state == 0 else RED
    ends = np.array([length.min(), length.max()])
    fit.plot(1e3 * ends, 1e12 * (slope * ends + offset), "-", color=color, lw=1.2)
    fit.plot(1e3 * length, 1e12 * capacitance, "o", color="black", ms=4)
    if state == 1:
        fit.set_title(f"sensor {sensor}: dead", fontsize=9, color=RED)
        below.text(0.5, 0.5, "no length can be read", transform=below.transAxes, ha="center", va="center", color=RED)
    else:
        text = f"sensor {sensor}: {1e9 * slope:.4f} pF/mm, rms {1e3 * lines['rms'][number, sensor]:.2f} mm"
        fit.set_title(text if state == 0 else f"{text}\n{LINE_STATES[state].split(':')[0]}", fontsize=9, color=color)
        below.bar(1e3 * length, 1e3 * points["residual"][rows], width=4, color=color)
        below.plot(1e3 * length, 1e3 * points["loo_residual"][rows], "o", mfc="none", color="black", ms=4)
    below.axhline(0, color="black", lw=0.7)
    below.set_xlim(fit.get_xlim())
    fit.tick_params(labelbottom=False)


def _drift(history: Group, drift: Group) -> bytes:
    n = history["slope"].shape[1]
    columns = min(3, n)
    rows = math.ceil(n / columns)
    figure = _figure(4.4 * columns, 2.3 * rows + 3.4)
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=(1,) * rows + (1.2,))
    files = list(dict.fromkeys(_texts(history, "file")))
    ticks = sorted({round(t / DAY_S) for t in np.linspace(history["time"].min(), history["time"].max(), 4)})
    labels = [f"{datetime.fromtimestamp(DAY_S * day, UTC):%d %b\n%Y}" for day in ticks]
    first: Axes | None = None
    for sensor in range(n):
        row, column = divmod(sensor, columns)
        axes = figure.add_subplot(grid[row, column], sharex=first, sharey=first)
        first = first or axes
        _drift_panel(axes, history, drift, sensor, files)
        axes.set_xticks(ticks, labels)
        if column == 0:
            axes.set_ylabel("deviation [mm]")
    if first is not None:
        handles, names = first.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncol=len(names), fontsize=9, frameon=False)
    _drift_sizes(figure.add_subplot(grid[rows, :]), history, drift)
    figure.suptitle(
        "drift: length that one and the same capacitance means, calibration after calibration\n"
        "(capacitance: the file's median in the middle of the working range; deviation from that middle)"
    )
    return _png(figure)


def _drift_panel(axes: Axes, history: Group, drift: Group, sensor: int, files: list[str]) -> None:
    file = np.array(_texts(history, "file"))
    state, slope, offset = (history[key][:, sensor] for key in ("state", "slope", "offset"))
    middle = history["range"][sensor].mean()
    dates = history["time"] / DAY_S
    swapped = drift["after"][(drift["sensor"] == sensor) & (drift["state"] == _SWAP)]
    for i, name in enumerate(files):
        color, marker = _SERIES[i % len(_SERIES)]
        good = (file == name) & (state == 0)
        if good.any():
            typical = np.median(slope[good] * middle + offset[good])
            length = 1e3 * ((typical - offset[good]) / slope[good] - middle)
            axes.plot(dates[good], length, "-", color=color, marker=marker, ms=4, lw=1, label=name or "history")
            ringed = np.isin(np.flatnonzero(good), swapped)
            axes.plot(dates[good][ringed], length[ringed], "o", mfc="none", color=RED, ms=10, mew=1.5)
        failed = (file == name) & (state != 0)
        axes.plot(dates[failed], np.full(failed.sum(), 0.06), "x", color=RED, transform=axes.get_xaxis_transform())
    axes.set_title(f"sensor {sensor}", fontsize=9)
    axes.axhline(0, color="black", lw=0.7)
    axes.grid(color="#eeeeee")
    if sensor == 0:
        axes.plot([], [], "o", mfc="none", color=RED, ms=10, mew=1.5, label="swap")
        axes.plot([], [], "x", color=RED, label="failed or suspect fit (shown at the bottom)")


def _drift_sizes(axes: Axes, history: Group, drift: Group) -> None:
    n = history["slope"].shape[1]
    measured = drift["state"] != 1
    size = 1e3 * np.abs(drift["change"])
    spread = np.linspace(-0.18, 0.18, 7)
    for sensor in range(n):
        mine = measured & (drift["sensor"] == sensor)
        axes.plot(sensor + spread[np.arange(mine.sum()) % 7], size[mine], ".", color=_PALE, ms=6,
                  label="one recalibration" if sensor == 0 else None)  # fmt: skip
    axes.plot(range(n), 1e3 * history["median_change"], "_", color=BLUE, ms=26, mew=2.5, label="median")
    axes.plot(range(n), 1e3 * history["p90_change"], "_", color=ORANGE, ms=26, mew=2.5, label="90th percentile")
    threshold = 1e3 * float(history.attributes["swap_threshold"])
    axes.axhline(threshold, color=RED, lw=0.8, ls="--", label=f"swap, above {threshold:g} mm")
    axes.set_xticks(range(n), [f"sensor {i}" for i in range(n)])
    axes.set_ylabel("change [mm]\nper recalibration")
    axes.legend(fontsize=8, ncol=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _tendons(points: Group, tendons: Group) -> bytes:
    figure = _figure(9, 8)
    force, stiffness = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    names = _texts(tendons, "name")
    ks = np.stack([tendons[key] for key in ("k1", "k2", "k3")], axis=1)
    for i in range(len(names)):
        mine = points["curve"] == i
        x = np.linspace(0, tendons["x_max"][i], 201)
        color, style = (_GREY, "-") if tendons["monotone"][i] else (RED, "--")
        many = i == 0
        force.plot(1e3 * points["displacement"][mine], points["force"][mine], "o", color=ORANGE, mec="black", mew=0.4,
                   ms=4.5, zorder=3, label="measured" if many else None)  # fmt: skip
        label = "cubic of one tendon" if many else None
        force.plot(1e3 * x, _cubic(ks[i], x), style, color=color, lw=0.8, label=label)
        stiffness.plot(1e3 * x, _slope(ks[i], x), style, color=color, lw=0.8)
        if not tendons["monotone"][i]:
            force.annotate(f"{names[i]} falls", (1e3 * x[-1], _cubic(ks[i], x[-1:])[0]), color=RED, fontsize=8)
    x, mean, sd = tendons["x"], tendons["mean"], tendons["sd"]
    k = np.array([float(tendons.attributes[f"k{i}_mean"]) for i in (1, 2, 3)])
    if np.isfinite(sd).all():
        force.fill_between(1e3 * x, mean - sd, mean + sd, color=BLUE, alpha=0.25, lw=0, label="± 1 sd between tendons")
    force.plot(1e3 * x, mean, "-", color=BLUE, lw=2.5, label="average")
    stiffness.plot(1e3 * x, _slope(k, x), "-", color=BLUE, lw=2.5)
    stiffness.axhline(0, color="black", lw=0.8)
    force.set_ylabel("force [N]")
    force.set_ylim(bottom=min(0.0, float(points["force"].min())))
    force.legend(fontsize=8, ncol=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False)
    stiffness.set_ylabel("stiffness [N/m]\n(below 0: falls)")
    stiffness.set_ylim(bottom=min(0.0, stiffness.get_ylim()[0]))
    stiffness.set_xlabel("displacement beyond the rest length [mm]")
    title = (
        f"{len(names)} tendon curves, a cubic through the origin each, and their average"
        if len(names) > 1
        else names[0]
    )
    figure.suptitle(
        f"{title}\nforce [N] = {k[0]:.4g} x {_signed(k[1])} x² {_signed(k[2])} x³, x in m; "
        f"worst residual rms {tendons['rms'].max():.3g} N"
    )
    return _png(figure)


def _masses(parts: Group, masses: Group, robot: Robot) -> bytes:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    rods = masses["rod"]
    shade = Normalize(0.0, 1e3 * float(parts["mass"].max()))
    figure = _figure(12, 2.7 * len(rods) + 0.5)
    for row, (axes, rod) in enumerate(
        zip(np.atleast_1d(figure.subplots(len(rods), 1, sharex=True)), rods, strict=True)
    ):
        _rod(axes, parts, masses, robot, row, int(rod), lambda grams: colormaps["Blues"](shade(grams)))
    axes.set_xlabel("along the rod [mm], from the middle between the caps towards the odd cap")
    figure.colorbar(ScalarMappable(shade, colormaps["Blues"]), ax=figure.axes, label="mass of the part [g]", shrink=0.6)
    figure.suptitle("weighed parts, to scale, the darker the heavier, and the centre of mass of each rod")
    return _png(figure)


def _rod(
    axes: Axes, parts: Group, masses: Group, robot: Robot, row: int, rod: int, shade: Callable[[float], Any]
) -> None:
    from matplotlib.patches import Circle, Rectangle

    body = robot.rods[rod]
    half, cap = 1e3 * body.length_m / 2, 1e3 * body.cap_radius_m
    axes.plot([-half, half], [0, 0], color=_PALE, lw=1, zorder=0)
    for end in (-half, half):
        axes.add_patch(Circle((end, 0), cap, fill=False, ls=":", color=_GREY, lw=0.8))
    mine = np.flatnonzero(parts["rod"] == rod)
    mine = mine[np.argsort(parts["offset"][mine], kind="stable")]
    top = max(cap, 1e3 * float(parts["radius"][mine].max()))
    shapes, names = _texts(parts, "shape"), _texts(parts, "name")
    for place, i in enumerate(mine):
        x, radius, length = (1e3 * float(parts[key][i]) for key in ("offset", "radius", "length"))
        color = shade(1e3 * float(parts["mass"][i]))
        look: dict[str, Any] = {"facecolor": color, "edgecolor": _GREY, "lw": 1.0}
        if shapes[i] == "point":
            axes.plot([x], [0], "D", color=color, mec=_GREY, ms=8)
        elif shapes[i] == "sphere":
            axes.add_patch(Circle((x, 0), radius, **look))
        else:
            axes.add_patch(Rectangle((x - length / 2, -radius), length, 2 * radius, **look))
        level = top * (1.35 + 0.75 * (place % 3))
        axes.plot([x, x], [0, level], color=_PALE, lw=0.7, zorder=0)
        axes.text(x, level, f"{names[i]} {1e3 * parts['mass'][i]:.1f} g", fontsize=8, ha="center", va="bottom",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip
    com = round(1e3 * float(masses["com"][row]), 6) + 0.0
    axes.plot([com], [0], "X", color="black", ms=9)
    axes.annotate(f"centre of mass {com:+.1f} mm", (com, 0), (com, -1.6 * top), fontsize=8, ha="center", va="top",
                  arrowprops={"arrowstyle": "-", "lw": 0.7})  # fmt: skip
    axial, across = (1e6 * masses[key][row] for key in ("inertia_axial", "inertia_transverse"))
    title = f"rod {body.name}: {1e3 * masses['mass'][row]:.1f} g, moment of inertia {axial:.3g} kg mm² along"
    axes.set_title(f"{title}, {across:.4g} kg mm² across", fontsize=9)
    axes.set_xlim(-half - 2 * cap, half + 2 * cap)
    axes.set_ylim(-2.6 * top, 3.6 * top)
    axes.set_aspect("equal")
    axes.set_yticks([])
    axes.spines[["left", "right", "top"]].set_visible(False)


def _signed(value: float) -> str:
    return f"{'−' if value < 0 else '+'} {abs(value):.4g}"


def _cubic(k: np.ndarray, x: np.ndarray) -> np.ndarray:
    return x * (k[0] + x * (k[1] + x * k[2]))


def _slope(k: np.ndarray, x: np.ndarray) -> np.ndarray:
    return k[0] + x * (2 * k[1] + x * 3 * k[2])


def _texts(group: Group, name: str) -> list[str]:
    return [bytes(value).decode() for value in group[name]]


def _file_names(names: list[str]) -> list[str]:
    """Names of sets as parts of file names, all different."""
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:80] for name in names]
    return [f"{name}-{i + 1}" if plain.count(name) > 1 else name for i, name in enumerate(plain)]


def _figure(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})
    return buffer.getvalue()
