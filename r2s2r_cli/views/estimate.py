"""Picture of an estimate: path from above, cap heights and contacts, speeds, cable lengths against targets, noise."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.recording import ROD_COLORS
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_BAND = ("#eef2f7", "#dbe3ee")
_CAP_STYLE = ("-", "--")
"""Even caps are drawn solid, odd ones dashed."""
_OUTLIER, _JUMP = 2, 3
_BROKEN = "#d4380d"


def draw_estimate(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run of an estimate."""
    for run in data.runs():
        yield run, _picture(data, run, robot)


def _picture(data: ArtifactData, run: str, robot: Robot) -> bytes:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    frames, tracks, intervals = (
        data.groups[f"runs/{run}/frames"],
        data.group(run, "tracks"),
        data.group(run, "intervals"),
    )
    figure = Figure(figsize=(14, 12), layout="constrained")
    FigureCanvasAgg(figure)
    nature = data.groups[f"runs/{run}"].attributes.get("nature", "")
    figure.suptitle(f"run {run}: estimated states" + (f" ({nature})" if nature else ""))
    outer = figure.add_gridspec(2, 1, height_ratios=(1.25, 1))
    top = outer[0].subgridspec(2, 2, width_ratios=(1, 1.5))
    _path(figure.add_subplot(top[:, 0]), frames, data, run, robot)
    heights, speeds = figure.add_subplot(top[0, 1]), figure.add_subplot(top[1, 1])
    for axes in (heights, speeds):
        _bands(axes, intervals)
    _heights(heights, frames, robot)
    _speeds(speeds, frames)
    columns = max(1, -(-len(robot.actuated) // 2))
    bottom = outer[1].subgridspec(2, columns + 1, width_ratios=(*[1.0] * columns, 0.9))
    shared: Axes | None = None
    for i, cable in enumerate(robot.actuated):
        axes = figure.add_subplot(bottom[i // columns, i % columns], sharex=shared, sharey=shared)
        shared = shared or axes
        _bands(axes, intervals, numbers=False)
        _length(axes, frames, data, run, robot, i, cable)
    if tracks is not None:
        _noise(figure.add_subplot(bottom[:, columns]), frames, tracks)
    return _png(figure)


def _path(axes: Axes, frames: Group, data: ArtifactData, run: str, robot: Robot) -> None:
    p_WE, com = frames["p_WE"], centre_of_mass(frames, robot)
    for cap in range(p_WE.shape[1]):
        axes.plot(p_WE[:, cap, 0], p_WE[:, cap, 1], _CAP_STYLE[cap % 2], color=_color(cap), lw=0.7, alpha=0.6)
    for frame, alpha in ((0, 0.3), (-1, 1.0)):
        for rod in range(p_WE.shape[1] // 2):
            ends = p_WE[frame, 2 * rod : 2 * rod + 2]
            axes.plot(ends[:, 0], ends[:, 1], "o-", color=_color(2 * rod), lw=3, ms=8, alpha=alpha)
        for cap in range(p_WE.shape[1]):
            if frame == -1:
                axes.annotate(
                    str(cap),
                    (p_WE[frame, cap, 0], p_WE[frame, cap, 1]),
                    ha="center",
                    va="center",
                    fontsize=7,
                    color="white",
                )
    segments = data.group(run, "segments")
    if segments is None or not len(segments["first"]):
        axes.plot(com[:, 0], com[:, 1], color="black", lw=2.5)
    else:
        from matplotlib import colormaps

        shades = colormaps["viridis"](np.linspace(0, 0.92, len(segments["first"])))
        for i, (first, last) in enumerate(zip(segments["first"], segments["last"], strict=True)):
            part = com[first : min(last + 2, len(com))]
            axes.plot(part[:, 0], part[:, 1], color=shades[i], lw=3, solid_capstyle="round")
            x, y, _ = part[len(part) // 2]
            axes.annotate(str(i + 1), (x, y), fontsize=8, color=shades[i], ha="center", va="bottom",
                          xytext=(0, 5), textcoords="offset points", weight="bold")  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title("from above: centre of mass by segment (thick), caps (thin),\nfirst frame pale, last frame full")


def _heights(axes: Axes, frames: Group, robot: Robot) -> None:
    t, z, contact, quality = frames["t"], 1e3 * frames["p_WE"][:, :, 2], frames["contact"], frames["quality"]
    top = float(np.max(z))
    step = 0.07 * top
    for cap in range(z.shape[1]):
        axes.plot(t, z[:, cap], _CAP_STYLE[cap % 2], lw=1, color=_color(cap), label=f"cap {cap}")
        touching = t[contact[:, cap]]
        row = -step * (cap + 1)
        axes.plot(touching, np.full(len(touching), row), "s", ms=3, color=_color(cap), mec="none")
        axes.annotate(f"{cap}", (t[0], row), xytext=(-6, 0), textcoords="offset points", fontsize=6, va="center",
                      ha="right", color=_color(cap))  # fmt: skip
        broken = (quality[:, cap] == _OUTLIER) | (quality[:, cap] == _JUMP)
        axes.plot(t[broken], z[broken, cap], "x", ms=7, color=_BROKEN, mew=1.4)
    axes.plot([], [], "s", ms=3, color="gray", label="in contact")
    axes.plot([], [], "x", ms=7, color=_BROKEN, mew=1.4, label="outlier or jump")
    axes.axhline(1e3 * robot.rods[0].cap_radius_m, color="black", lw=0.8, ls=":")
    axes.set_ylabel("height of cap centre [mm]\n(dotted: on the ground)\nbelow 0: contacts by cap")
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= top])
    axes.set_ylim(-step * (z.shape[1] + 1), 1.3 * top)
    axes.legend(ncol=4, fontsize=7, loc="upper right")


def _speeds(axes: Axes, frames: Group) -> None:
    speed = 1e3 * np.linalg.norm(frames["v_WE"], axis=-1)
    for cap in range(speed.shape[1]):
        axes.plot(frames["t"], speed[:, cap], _CAP_STYLE[cap % 2], lw=1, color=_color(cap))
    sd = 1e3 * np.sqrt(np.mean(np.sum(frames["sd_v_WE"] ** 2, axis=-1), axis=1))
    axes.fill_between(frames["t"], 0, sd, color="gray", alpha=0.35, lw=0, label="standard deviation, mean of caps")
    axes.set(xlabel="time [s]", ylabel="smoothed speed of caps [mm/s]", ylim=(0, None))
    axes.legend(fontsize=7, loc="upper right")


def _length(axes: Axes, frames: Group, data: ArtifactData, run: str, robot: Robot, i: int, cable: int) -> None:
    t, length, sd = frames["t"], 1e3 * frames["length"][:, cable], 1e3 * frames["length_sd"][:, cable]
    axes.fill_between(t, length - 2 * sd, length + 2 * sd, color="#0b5fa5", alpha=0.25, lw=0)
    axes.plot(t, length, color="#0b5fa5", lw=1.2, label="between cap centres, 2 sd")
    if "sensor_length" in frames:
        for column in np.flatnonzero(frames["sensor_cable"] == cable):
            axes.plot(t, 1e3 * frames["sensor_length"][:, column], ".", ms=2.5, color="#b8860b", label="sensor")
    commands = data.group(run, "commands")
    if commands is not None:
        facts = data.groups[f"runs/{run}"].attributes
        low = float(facts.get("pid_min_length", robot.pid.min_length_m))
        span = float(facts.get("pid_range", robot.pid.range_m))
        axes.step(commands["t"], 1e3 * (low + span * commands["target"][:, i]), where="post", color="black", lw=1,
                  label="target")  # fmt: skip
    a, b = robot.cables[cable].caps
    axes.set_title(f"cable {cable} (caps {a}-{b})", fontsize=9)
    axes.set(xlabel="time [s]", ylabel="length [mm]")
    axes.label_outer()
    if i == len(robot.actuated) - 1:
        axes.legend(fontsize=7, loc="best")


def _noise(axes: Axes, frames: Group, tracks: Group) -> None:
    noise, held = 1e3 * tracks["noise_sd"], tracks["held"]
    caps = np.arange(len(noise))
    for axis, name in enumerate("xyz"):
        bars = axes.barh(caps + 0.25 * (axis - 1), noise[:, axis], height=0.22, label=f"{name}, observed",
                         color=("#8fa8c8", "#5a7aa5", "#2f4a73")[axis])  # fmt: skip
        for bar, is_held in zip(bars, held[:, axis], strict=True):
            bar.set_hatch("///" if is_held else "")
    smoothed = 1e3 * np.sqrt(np.median(np.trace(frames["cov_p_WE"], axis1=2, axis2=3) / 3, axis=0))
    axes.plot(smoothed, caps, "D", color=_BROKEN, ms=5, label="after smoothing, rms of axes")
    axes.set_yticks(caps, [f"cap {cap}" for cap in caps])
    axes.set_ylim(len(caps) + 0.9, -0.6)
    axes.set_xlabel("standard deviation [mm]")
    axes.set_title(
        "noise per cap" + ("\n(hatched: held by the source,\nmedian of the run stands in)" if np.any(held) else "")
    )
    axes.set_xlim(0, 1.1 * float(np.max(noise)))
    axes.legend(fontsize=7, loc="lower center", ncol=2)


def centre_of_mass(frames: Group, robot: Robot) -> np.ndarray:
    """Centre of mass of the rods [m], shape (frame, 3), from p_WE of an estimate's or simulation's frames."""
    even, odd = frames["p_WE"][:, 0::2], frames["p_WE"][:, 1::2]
    mass = np.array([sum(part.mass_kg for part in rod.parts) for rod in robot.rods])
    moment = np.array([sum(part.mass_kg * part.offset_m for part in rod.parts) for rod in robot.rods])
    share = 0.5 + moment / mass / np.array([rod.length_m for rod in robot.rods])
    centres = even + share[:, None] * (odd - even)
    return np.einsum("r,tri->ti", mass / mass.sum(), centres)


def _bands(axes: Axes, intervals: Group | None, *, numbers: bool = True) -> None:
    if intervals is None:
        return
    for i, (start, stop) in enumerate(zip(intervals["t_first"], intervals["t_last"], strict=True)):
        axes.axvspan(start, stop, color=_BAND[i % 2], lw=0)
        if numbers:
            axes.annotate(str(i + 1), ((start + stop) / 2, 1.0), xycoords=("data", "axes fraction"), ha="center",
                          va="bottom", fontsize=7, color="#5a6675")  # fmt: skip


def _color(cap: int) -> str:
    return ROD_COLORS[cap // 2 % len(ROD_COLORS)]


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=100, metadata={"Software": None})
    return buffer.getvalue()
