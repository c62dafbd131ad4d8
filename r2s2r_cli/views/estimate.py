"""Picture of an estimate: path from above, cap heights and contacts, speeds, cable lengths against targets, noise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.estimate_lengths import draw_lengths
from r2s2r_cli.views.figure import (
    CAP_STYLE,
    draw_bands,
    draw_rods,
    legend_below,
    legend_beside,
    new_figure,
    png_bytes,
    rod_color,
    spread_out,
)
from r2s2r_cli.views.recording import stated
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

_OUTLIER, _JUMP = 2, 3
_BROKEN = "#d4380d"
_NUMBER_DISTANCE = 0.045
"""Numbers on the path nearer to each other than this share of the view's width would overlap."""


def draw_estimate(data: ArtifactData, robot: Robot) -> Iterator[tuple[str, bytes]]:
    """(run, PNG) of every run of an estimate."""
    for run in data.runs():
        yield run, _picture(data, run, robot)


def _picture(data: ArtifactData, run: str, robot: Robot) -> bytes:
    frames, intervals = data.groups[f"runs/{run}/frames"], data.group(run, "intervals")
    figure = new_figure(15, 14.5)
    nature = str(data.groups[f"runs/{run}"].attributes.get("nature", ""))
    figure.suptitle(f"run {run}: estimated states ({stated(nature)})")
    top, bottom = np.asarray(figure.subfigures(2, 1, height_ratios=(1, 1.05)))
    grid = top.add_gridspec(2, 2, width_ratios=(1, 1.5))
    draw_path(top.add_subplot(grid[:, 0]), frames, data, run, robot)
    heights, speeds = top.add_subplot(grid[0, 1]), top.add_subplot(grid[1, 1])
    for axes in (heights, speeds):
        draw_bands(axes, intervals)
    _heights(heights, frames, robot)
    _speeds(speeds, frames)
    tracks = data.group(run, "tracks")
    if tracks is None:
        draw_lengths(bottom, data, run, robot)
    else:
        lengths, noise = np.asarray(bottom.subfigures(1, 2, width_ratios=(3.4, 1)))
        draw_lengths(lengths, data, run, robot)
        _noise(noise, frames, tracks)
    return png_bytes(figure)


def draw_path(axes: Axes, frames: Group, data: ArtifactData, run: str, robot: Robot) -> None:
    """From above: caps and centre of mass of an estimated or simulated run, segments by shade and number."""
    p_WE, com = frames["p_WE"], centre_of_mass(frames, robot)
    for cap in range(p_WE.shape[1]):
        axes.plot(p_WE[:, cap, 0], p_WE[:, cap, 1], CAP_STYLE[cap % 2], color=rod_color(cap), lw=0.7, alpha=0.6)
    draw_rods(axes, p_WE)
    segments = data.group(run, "segments")
    if segments is None or not len(segments["first"]):
        axes.plot(com[:, 0], com[:, 1], color="black", lw=2.5)
    else:
        from matplotlib import colormaps
        from matplotlib.patheffects import withStroke

        shades = colormaps["viridis"](np.linspace(0, 0.92, len(segments["first"])))
        parts = [com[a : min(b + 2, len(com))] for a, b in zip(segments["first"], segments["last"], strict=True)]
        for part, shade in zip(parts, shades, strict=True):
            axes.plot(part[:, 0], part[:, 1], color=shade, lw=3, solid_capstyle="round")
        middles = np.array([part[len(part) // 2, :2] for part in parts])
        halo = [withStroke(linewidth=2.5, foreground="white")]
        for i in spread_out(middles, _NUMBER_DISTANCE * float(np.ptp(p_WE[:, :, :2].reshape(-1, 2), axis=0).max())):
            axes.annotate(str(i + 1), middles[i], fontsize=8, ha="center", va="bottom", weight="bold", xytext=(0, 3),
                          textcoords="offset points", path_effects=halo)  # fmt: skip
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(
        "from above: first frame pale, last frame full; caps thin; centre of mass thick,\n"
        "by segment from dark to light, numbered where there is room",
        fontsize=10,
    )


def _heights(axes: Axes, frames: Group, robot: Robot) -> None:
    t, z, contact, quality = frames["t"], 1e3 * frames["p_WE"][:, :, 2], frames["contact"], frames["quality"]
    top = float(np.max(z))
    step = 0.07 * top
    for cap in range(z.shape[1]):
        axes.plot(t, z[:, cap], CAP_STYLE[cap % 2], lw=1, color=rod_color(cap), label=f"cap {cap}")
        touching = t[contact[:, cap]]
        row = -step * (cap + 1)
        axes.plot(touching, np.full(len(touching), row), "s", ms=3, color=rod_color(cap), mec="none")
        axes.annotate(f"{cap}", (t[0], row), xytext=(-6, 0), textcoords="offset points", fontsize=6, va="center",
                      ha="right", color=rod_color(cap))  # fmt: skip
        broken = (quality[:, cap] == _OUTLIER) | (quality[:, cap] == _JUMP)
        axes.plot(t[broken], z[broken, cap], "x", ms=7, color=_BROKEN, mew=1.4)
    axes.plot([], [], "s", ms=3, color="gray", label="in contact")
    axes.plot([], [], "x", ms=7, color=_BROKEN, mew=1.4, label="outlier or jump")
    axes.axhline(1e3 * robot.rods[0].cap_radius_m, color="black", lw=0.8, ls=":", label="on the ground")
    axes.set_ylabel("height of cap centre [mm]\nbelow 0: contacts by cap")
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= top])
    axes.set_ylim(-step * (z.shape[1] + 1), 1.08 * top)
    legend_beside(axes)


def _speeds(axes: Axes, frames: Group) -> None:
    speed = 1e3 * np.linalg.norm(frames["v_WE"], axis=-1)
    for cap in range(speed.shape[1]):
        axes.plot(frames["t"], speed[:, cap], CAP_STYLE[cap % 2], lw=1, color=rod_color(cap))
    sd = 1e3 * np.sqrt(np.mean(np.sum(frames["sd_v_WE"] ** 2, axis=-1), axis=1))
    axes.fill_between(frames["t"], 0, sd, color="gray", alpha=0.35, lw=0, label="sd of one cap,\nmean")
    axes.set(xlabel="time [s]", ylabel="smoothed speed of caps [mm/s]", ylim=(0, None))
    legend_beside(axes)


def _noise(figure: SubFigure, frames: Group, tracks: Group) -> None:
    axes = figure.subplots()
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
    axes.set_ylim(len(caps) - 0.4, -0.6)
    axes.set_xlabel("standard deviation [mm]")
    axes.set_title(
        "noise per cap" + ("\n(hatched: held by the source,\nmedian of the run stands in)" if np.any(held) else ""),
        fontsize=9,
    )
    axes.set_xlim(0, 1.1 * float(np.max(noise)))
    legend_below(figure, [axes], columns=2)


def centre_of_mass(frames: Group, robot: Robot) -> np.ndarray:
    """Centre of mass of the rods [m], shape (frame, 3), from p_WE of an estimate's or simulation's frames."""
    even, odd = frames["p_WE"][:, 0::2], frames["p_WE"][:, 1::2]
    mass = np.array([sum(part.mass_kg for part in rod.parts) for rod in robot.rods])
    moment = np.array([sum(part.mass_kg * part.offset_m for part in rod.parts) for rod in robot.rods])
    share = 0.5 + moment / mass / np.array([rod.length_m for rod in robot.rods])
    centres = even + share[:, None] * (odd - even)
    return np.einsum("r,tri->ti", mass / mass.sum(), centres)
