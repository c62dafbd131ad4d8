"""Pictures of what the parts of a robot measure: tendon curves, rods with their masses."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.views.figure import BLUE, GREY, ORANGE, PALE, RED, as_typed, new_figure, png_bytes, texts
from schemas.robot import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_tendons(points: Group, tendons: Group) -> bytes:
    """PNG: force and stiffness of every tendon over its displacement, and their average."""
    figure = new_figure(9, 8)
    force, stiffness = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    names = [as_typed(name) for name in texts(tendons, "name")]
    ks = np.stack([tendons[key] for key in ("k1", "k2", "k3")], axis=1)
    for i in range(len(names)):
        mine = points["curve"] == i
        x = np.linspace(0, tendons["x_max"][i], 201)
        color, style = (GREY, "-") if tendons["monotone"][i] else (RED, "--")
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
    return png_bytes(figure)


def draw_masses(parts: Group, masses: Group, robot: Robot) -> bytes:
    """PNG: the weighed parts of every rod to scale, and its centre of mass."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    rods = masses["rod"]
    shade = Normalize(0.0, 1e3 * float(parts["mass"].max()))
    figure = new_figure(12, 2.7 * len(rods) + 0.5)
    for row, (axes, rod) in enumerate(
        zip(np.atleast_1d(figure.subplots(len(rods), 1, sharex=True)), rods, strict=True)
    ):
        _rod(axes, parts, masses, robot, row, int(rod), lambda grams: colormaps["Blues"](shade(grams)))
    axes.set_xlabel("along the rod [mm], from the middle between the caps towards the odd cap")
    figure.colorbar(ScalarMappable(shade, colormaps["Blues"]), ax=figure.axes, label="mass of the part [g]", shrink=0.6)
    figure.suptitle("weighed parts, to scale, the darker the heavier, and the centre of mass of each rod")
    return png_bytes(figure)


def _rod(
    axes: Axes, parts: Group, masses: Group, robot: Robot, row: int, rod: int, shade: Callable[[float], Any]
) -> None:
    from matplotlib.patches import Circle, Rectangle

    body = robot.rods[rod]
    half, cap = 1e3 * body.length_m / 2, 1e3 * body.cap_radius_m
    axes.plot([-half, half], [0, 0], color=PALE, lw=1, zorder=0)
    for end in (-half, half):
        axes.add_patch(Circle((end, 0), cap, fill=False, ls=":", color=GREY, lw=0.8))
    mine = np.flatnonzero(parts["rod"] == rod)
    mine = mine[np.argsort(parts["offset"][mine], kind="stable")]
    top = max(cap, 1e3 * float(parts["radius"][mine].max()))
    shapes, names = texts(parts, "shape"), [as_typed(name) for name in texts(parts, "name")]
    for place, i in enumerate(mine):
        x, radius, length = (1e3 * float(parts[key][i]) for key in ("offset", "radius", "length"))
        color = shade(1e3 * float(parts["mass"][i]))
        look: dict[str, Any] = {"facecolor": color, "edgecolor": GREY, "lw": 1.0}
        if shapes[i] == "point":
            axes.plot([x], [0], "D", color=color, mec=GREY, ms=8)
        elif shapes[i] == "sphere":
            axes.add_patch(Circle((x, 0), radius, **look))
        else:
            axes.add_patch(Rectangle((x - length / 2, -radius), length, 2 * radius, **look))
        level = top * (1.35 + 0.75 * (place % 3))
        axes.plot([x, x], [0, level], color=PALE, lw=0.7, zorder=0)
        axes.text(x, level, f"{names[i]} {1e3 * parts['mass'][i]:.1f} g", fontsize=8, ha="center", va="bottom",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip
    com = round(1e3 * float(masses["com"][row]), 6) + 0.0
    axes.plot([com], [0], "X", color="black", ms=9)
    axes.annotate(f"centre of mass {com:+.1f} mm", (com, 0), (com, -1.6 * top), fontsize=8, ha="center", va="top",
                  arrowprops={"arrowstyle": "-", "lw": 0.7})  # fmt: skip
    axial, across = (1e6 * masses[key][row] for key in ("inertia_axial", "inertia_transverse"))
    title = f"rod {as_typed(body.name)}: {1e3 * masses['mass'][row]:.1f} g, moment of inertia {axial:.3g} kg mm² along"
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
