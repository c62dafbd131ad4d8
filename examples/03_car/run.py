"""Which losses find the speed of a car that turns? `python examples/03_car/run.py --out DIR` (minutes).

The paper's small-scale problem: naive loss, multiple shooting with 2 to 9 windows (MS2 to MS9) and Key Frame Loss
(KFL), Adam with rate 0.1, from first speeds of 0.1 to 2 m/s. The paper leaves open how the car turns, what a window
starts from, and which of its defects count: all readings are run. "+": within 2 % of 1 m/s over the last tenth of the
iterations, "~": its mean there is, but not every iteration, ".": not. What comes out: docs/concepts/key-frame-loss.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from car import Array, Reading, Restart, Turn, gaits_loss, true_car, windows_loss

STARTS = np.round(np.arange(1, 21) * 0.1, 1)
RATE, TOLERANCE, DT = 0.1, 0.02, 1.0
PAPER = {"naive": False, "MS2": False, "MS3": False} | {f"MS{k}": True for k in range(4, 10)} | {"KFL": True}
"""What converges in the paper, from a first speed that it does not give."""
WORDS = {True: "converges", False: "fails"}
SHOWN_STARTS = (0.5, 1.5)
"""First speeds whose curves are drawn and whose last speeds are printed [m/s]."""
# Without a restart, windows of all steps are the naive loss. Cars that turn on command need no more than one reading.
CLOSED_LOOP = (Turn.EVENT, Turn.REFLECTED)
READINGS = [
    *(Reading(turn, restart) for turn in CLOSED_LOOP for restart in Restart),
    *(Reading(turn, restart, True) for turn in CLOSED_LOOP for restart in (Restart.FULL, Restart.POSITION)),
    Reading(Turn.COMMANDED),
]
Loss = Callable[[Array], tuple[Array, Array]]


def methods(reading: Reading, dt: float, seen: Array | None = None) -> dict[str, Loss]:
    """The paper's methods under one reading; the naive loss and KFL depend on its turn at most."""
    seen = true_car(dt)[0][:, None] if seen is None else seen
    naive = Reading(reading.turn, Restart.NONE, all_steps=True)
    found: dict[str, Loss] = {"naive": partial(windows_loss, windows=1, reading=naive, dt=dt, seen=seen)}
    for k in range(2, 10):
        found[f"MS{k}"] = partial(windows_loss, windows=k, reading=reading, dt=dt, seen=seen)
    found["KFL"] = partial(gaits_loss, dt=dt, seen=seen)
    return found


def descend(loss: Loss, start: Array, iterations: int) -> tuple[Array, Array]:
    """Adam, rate 0.1. Losses [m^2] and speeds [m/s] before every update, (iteration, start)."""
    import torch

    v = torch.tensor(start, requires_grad=True)
    adam = torch.optim.Adam([v], lr=RATE)
    losses, speeds = [], []
    for _ in range(iterations):
        value, slope = loss(v.detach().numpy())
        losses.append(value)
        speeds.append(v.detach().numpy().copy())
        v.grad = torch.from_numpy(slope)
        adam.step()
    return np.stack(losses), np.stack(speeds)


def verdict(speeds: Array) -> str:
    """One sign a start: see the head of this file."""
    tail = speeds[-max(len(speeds) // 10, 1) :]
    stays = np.all(np.abs(tail - 1) < TOLERANCE, axis=0)
    around = np.abs(tail.mean(0) - 1) < TOLERANCE
    return "".join("+" if a else "~" if b else "." for a, b in zip(stays, around, strict=True))


@dataclass(frozen=True)
class Fits:
    """One method from all first speeds. last: speeds after the last iteration [m/s], (start,). settled: median over the
    starts of the iteration from which on the speed stays within 2 %, or -1."""

    signs: str
    last: Array
    settled: int


def fits(loss: Loss, iterations: int) -> Fits:
    """Adam from all first speeds."""
    _, speeds = descend(loss, STARTS, iterations)
    away = np.abs(speeds - 1) >= TOLERANCE
    settled = np.where(away[-1], iterations, iterations - np.argmax(away[::-1], axis=0)) * away.any(0)
    median = int(np.median(settled))
    return Fits(verdict(speeds), speeds[-1], median if median < iterations else -1)


def sweep(reading: Reading, iterations: int, dt: float = DT) -> dict[str, Fits]:
    """All methods from all first speeds."""
    return {name: fits(loss, iterations) for name, loss in methods(reading, dt).items()}


def as_in_the_paper(found: dict[str, Fits]) -> list[float]:
    """First speeds from which every one of the ten methods converges or fails as the paper says [m/s]."""
    alike = [all((found[name].signs[k] != ".") == works for name, works in PAPER.items()) for k in range(len(STARTS))]
    return [float(start) for start, all_alike in zip(STARTS, alike, strict=True) if all_alike]


def print_sweep(reading: Reading, iterations: int, dt: float = DT) -> None:
    """One line a method; then the first speeds from which all of them fare as in the paper."""
    found = sweep(reading, iterations, dt)
    print(f"{reading}, step {dt:g} s")
    for name, fit in found.items():
        ends = "{:8.3f} {:8.3f}".format(*(fit.last[list(STARTS).index(start)] for start in SHOWN_STARTS))
        settled = f"settled at {fit.settled:3}" if fit.settled >= 0 else " " * 14
        counted = f"{fit.signs.count('+'):2} of 20   {ends}   {settled}"
        print(f"  {name:6} {fit.signs}  {counted}   paper: {WORDS[PAPER[name]]}")
    print(f"  all ten as in the paper from: {', '.join(f'{v:g}' for v in as_in_the_paper(found)) or 'nowhere'}\n")


def rivals(iterations: int) -> None:
    """KFL and its own variants, all by gaits: without detachment, with all steps."""
    seen = true_car(DT)[0][:, None]
    print("by gaits, step 1 s")
    variants: dict[str, dict[str, Any]] = {
        "KFL": {},
        "Last Step (not detached)": {"detach": False},
        "All Step (detached)": {"last_only": False},
        "All Step (not detached)": {"last_only": False, "detach": False},
    }
    for name, options in variants.items():
        signs = verdict(descend(partial(gaits_loss, dt=DT, seen=seen, **options), STARTS, iterations)[1])
        print(f"  {name:25} {signs}  {signs.count('+'):2} of 20")
    print()


def noise(iterations: int, turn: Turn, sd: float = 2.0, seeds: int = 40) -> None:
    """Error of the speed when positions are seen with noise, from 0.9 m/s (every method starts near the truth)."""
    clean = true_car(DT)[0][:, None]
    seen = clean + sd * np.random.default_rng(0).standard_normal((len(clean), seeds))
    print(
        f"positions seen with {sd:g} m of noise, {seeds} seeds, from 0.9 m/s, turn {turn}: rms error of the speed [m/s]"
    )
    for name, loss in methods(Reading(turn), DT, seen).items():
        speeds = descend(loss, np.full(seeds, 0.9), iterations)[1][-iterations // 10 :].mean(0)
        print(f"  {name:6} {np.sqrt(np.mean((speeds - 1) ** 2)):.4f}")
    print()


def figure(path: Path, reading: Reading, iterations: int) -> None:
    """The paper's figure, loss and speed over the iterations, from 0.5 and 1.5 m/s; and the losses over the speed."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(9, 7), dpi=64, layout="constrained")
    FigureCanvasAgg(sheet)
    axes: Any = sheet.subplots(3, 2)
    shown = ["naive", "MS2", "MS3", "MS4", "KFL"]
    losses = methods(reading, DT)
    speeds = np.linspace(0.1, 2, 381)
    for name in shown:
        for row, start in enumerate(SHOWN_STARTS):
            history = descend(losses[name], np.array([start]), iterations)
            for column, series in enumerate(history):
                axes[row][column].plot(series[:, 0], label=name, linewidth=1.2)
                axes[row][column].set(xlabel="iteration", ylabel=("loss [m²]", "speed [m/s]")[column])
                axes[row][column].set_title(f"from {start:g} m/s", fontsize=10, loc="left")
        value, slope = losses[name](speeds)
        axes[2][0].plot(speeds, value, label=name)
        axes[2][1].plot(speeds, np.sign(slope) * np.log10(1 + np.abs(slope)), label=name)
    axes[2][0].set(xlabel="speed [m/s]", ylabel="loss [m²]")
    axes[2][1].set(xlabel="speed [m/s]", ylabel="sign · log10(1 + |gradient|)")
    axes[0][1].legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(path, metadata={"Software": None})


def main(out: Path, iterations: int = 300) -> None:
    """Print every table, draw `car_event.png` and `car_reflected.png`."""
    print(f"first speeds 0.1, 0.2 ... 2.0 m/s from left to right; Adam {RATE}, {iterations} iterations")
    print(f"the two numbers: last speed from {SHOWN_STARTS[0]:g} and from {SHOWN_STARTS[1]:g} m/s\n")
    for reading in READINGS:
        print_sweep(reading, iterations)
    for turn in CLOSED_LOOP:
        print_sweep(Reading(turn), iterations, 0.5)
    rivals(iterations)
    for turn in CLOSED_LOOP:
        noise(iterations, turn)
        figure(out / f"car_{turn}.png", Reading(turn), min(iterations, 150))
    print(f"pictures in {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the pictures")
    main(parser.parse_args().out)
