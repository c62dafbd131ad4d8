"""Noisy late and early observations, and contradicting gradients: `python examples/04_observations/run.py --out DIR`.

Prints two tables (seconds) and draws `noisy.png` and `contradiction.png`, the paper's two figures. What comes out:
docs/concepts/key-frame-loss.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import contradiction
import noisy
import numpy as np


def draw_noisy(path: Path) -> None:
    """Fits through one early and one late observation of the same error, for both paths; sd over the time."""
    axes, save = panels(path, 3)
    s = np.linspace(0, 10, 1001)
    for k, (track, error) in enumerate(((noisy.LINE, -0.6), (noisy.ZIGZAG, -0.3))):
        axes[k].plot(s, track.f(s), "g", linewidth=2, label="truth, 1 m/s")
        for t, color in ((0.8, "tab:orange"), (9.0, "tab:red")):
            seen = float(track.f(np.array(t))) + error
            speeds = noisy.SPEEDS[np.argsort(np.abs(noisy.SPEEDS - 1), kind="stable")]
            miss = np.abs(track.f(speeds * t) - seen)
            v = float(speeds[np.argmax(miss < 0.01)])
            axes[k].plot(s, track.f(v * s), "--", color=color, label=f"fit at {t:g} s: {v:.2f} m/s")
            axes[k].plot(t, seen, "o", color=color)
        axes[k].set(title=track.name, xlabel="t [s]", ylabel="x [m]")
        axes[k].legend(fontsize=8)
    for track in noisy.PATHS:
        axes[2].semilogy(s[10:], noisy.closed_form(track, s[10:]), label=track.name)
    axes[2].set(
        title=f"sd of v [m/s], noise {noisy.SD:g} m", xlabel="t [s] of the observation", ylabel="[m/s]", ylim=(1e-3, 10)
    )
    axes[2].legend(fontsize=8)
    save()


def draw_contradiction(path: Path, v: float = 0.3) -> None:
    """The trajectory with three targets and which way each pulls; the signs over the speed."""
    axes, save = panels(path, 2)
    t = np.linspace(0, 300, 601)
    axes[0].plot(t, contradiction.triangle(t)[0], "g", label="truth, 1 m/s")
    axes[0].plot(t, contradiction.triangle(v * t)[0], "r", label=f"engine, {v:g} m/s")
    for k, (at, pull) in enumerate(zip(contradiction.TARGETS, contradiction.pulls(np.array(v)), strict=True)):
        x, goal = (float(contradiction.triangle(np.array(speed * at))[0]) for speed in (v, 1.0))
        axes[0].plot([at, at], [x, goal], "k:", linewidth=1)
        axes[0].annotate(
            f"loss {k + 1}\n{'faster' if pull > 0 else 'slower'}", (at - 4, (x + goal) / 2), ha="right", va="center"
        )
    axes[0].set(xlabel="t [s]", ylabel="x [m]")
    axes[0].legend(fontsize=8, loc="upper left")
    speeds = np.linspace(0.05, 2, 791)
    rows = [*np.sign(contradiction.pulls(speeds)).T, np.sign(contradiction.key_frame_pulls(speeds)).T[0]]
    names = ["loss 1", "loss 2", "loss 3", "key frames"]
    for k, row in enumerate(rows):
        axes[1].plot(speeds, row * 0.8 - 3 * k, "k" if k == 3 else "C0")
    axes[1].set(
        xlabel="speed [m/s]", title="up: faster, down: slower", yticks=[-3 * k for k in range(4)], yticklabels=names
    )
    axes[1].axvline(1, color="g", linewidth=0.8)
    save()


def panels(path: Path, count: int) -> tuple[Any, Any]:
    """Axes side by side, and what writes them to `path`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(4.2 * count, 3.4), dpi=75, layout="constrained")
    FigureCanvasAgg(sheet)
    axes = sheet.subplots(1, count)

    def save() -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        sheet.savefig(path, metadata={"Software": None})

    return axes, save


def main(out: Path) -> None:
    """Print both tables, draw both pictures."""
    print(noisy.report())
    print(contradiction.report())
    draw_noisy(out / "noisy.png")
    draw_contradiction(out / "contradiction.png")
    print(f"pictures in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    main(parser.parse_args().out)
