"""Cables at the rod ends against cables on the caps: `python examples/06_attachment/run.py --out DIR`.

Prints a table and draws `attachment-contrast.png`, the paper's figure. What comes out:
docs/concepts/attachment-contrast.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import collapse
import numpy as np
from torch import Tensor

RODS = ("tab:red", "tab:green", "tab:blue")


def row(words: str, p_WE: Tensor) -> str:
    """One line of the table: how many sequences collapsed, how many stuck, and the thickness."""
    found = collapse.outcome(p_WE)
    flattest = found.thickness[:, : -collapse.EXTENSIONS].amin(1)
    low, middle = (1e3 * float(flattest.quantile(q)) for q in (0.0, 0.5))
    last = 1e3 * float(found.thickness[:, -1].median())
    number = len(found.stuck)
    return (
        f"{words:44s} {int(found.collapsed.sum()):4d} of {number:<4d} {int(found.stuck.sum()):4d} of {number:<4d}"
        f" {low:8.0f} {middle:8.0f} {last:8.0f}"
    )


def draw(path: Path, shown: dict[str, tuple[Tensor, Tensor]], cable_caps: Any) -> None:
    """Both attachments after the same shapes (above) and after full extension (below). shown: caps (cap, 3) [m]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(8.0, 6.4), dpi=75, layout="constrained")
    FigureCanvasAgg(sheet)
    titles = {"rod_end": "cables at the rod ends", "surface": "cables on the caps"}
    for column, (mode, moments) in enumerate(shown.items()):
        for line, (moment, words) in enumerate(zip(moments, ("after the shapes", "then fully extended"), strict=True)):
            axes: Any = sheet.add_subplot(2, 2, 2 * line + column + 1, projection="3d")
            p = moment.numpy() - np.append(moment.numpy()[:, :2].mean(0), 0.0)
            for k, (a, b) in enumerate(cable_caps):
                axes.plot(*p[[a, b]].T, color="black" if k < 6 else "tab:orange", linewidth=1)
            for rod, color in enumerate(RODS):
                axes.plot(*p[2 * rod : 2 * rod + 2].T, color=color, linewidth=4, marker="o", markersize=9)
            axes.set(title=f"{titles[mode]}, {words}", xlim=(-0.2, 0.2), ylim=(-0.2, 0.2), zlim=(0.0, 0.26))
            axes.set_box_aspect((0.4, 0.4, 0.26))
            axes.view_init(elev=18, azim=-60)
            axes.tick_params(labelsize=6)
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(path, metadata={"Software": None})


def main(
    out: Path, sequences: int = 256, shapes: int = 15, seed: int = 1, *, robot: str = "threebar",
    friction: float | None = None, rod_contact: bool = True,
) -> None:  # fmt: skip
    """All sequences with both attachments, the motor commands of each in the other, the table and the figure."""
    targets = collapse.random_shapes(sequences, shapes, seed)
    robots = {mode: collapse.Attached(mode, robot, friction, rod_contact=rod_contact) for mode in collapse.MODES}
    played = {mode: attached.play(targets) for mode, attached in robots.items()}
    print(f"{sequences} sequences of {shapes} random shapes, seed {seed}; flat: {1e3 * collapse.FLAT:g} mm")
    print(f"{'':44s} {'collapsed':>12s} {'stuck':>12s} {'flattest, median, end [mm]':>27s}")
    for mode in collapse.MODES:
        print(row(f"{mode}, shapes in closed loop", played[mode][0]))
    for mode, other in (collapse.MODES, collapse.MODES[::-1]):
        print(row(f"{mode}, motor commands of {other}", robots[mode].replay(played[other][1])))
    ends = played["rod_end"][0]
    found = collapse.outcome(ends)
    # The sequence to draw: the first that collapses and sticks; without one, the flattest.
    both = (found.collapsed & found.stuck).nonzero()[:, 0]
    chosen = int(both[0]) if len(both) else int(found.thickness.amin(1).argmin())
    shown = {mode: (p_WE[chosen, -1 - collapse.EXTENSIONS], p_WE[chosen, -1]) for mode, (p_WE, _) in played.items()}
    print(f"drawn: sequence {chosen}")
    draw(out / "attachment-contrast.png", shown, robots["surface"].cable_caps)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--sequences", type=int, default=256)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--robot", default="threebar")
    parser.add_argument("--friction", type=float)
    parser.add_argument("--no-rod-contact", dest="rod_contact", action="store_false")
    main(**vars(parser.parse_args()))
