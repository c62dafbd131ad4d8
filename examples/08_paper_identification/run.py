"""Which loss finds the motor speed? The paper's figure 'sim2sim_eval'; run this file with python, minutes.

A closed-loop run of the three-bar robot at motor speed 0.5, random policies; Adam with rate 0.1 from 0.3 and 0.8; Key
Frame Loss, Last Step, All Step, and beyond the figure the naive loss and multiple shooting with four windows.
What comes out: docs/concepts/paper-identification.md.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gradients import print_costs, print_slopes
from task import TRUTH, Array, Descent, descend, engine, task

from r2s2r_cli.stages.identify.paper import Loss, Preset

SHOWN = {
    Loss.ALL_STEP: ("All Step", "tab:blue"), Loss.LAST_STEP: ("Last Step", "tab:orange"),
    Loss.KEY_FRAME: ("KFL", "tab:green"), Loss.NAIVE: ("naive", "tab:gray"),
    Loss.MULTIPLE_SHOOTING: ("MS4", "tab:red"),
}  # fmt: skip
"""Names and colours of the paper's figure; the last two are not in it."""
FIRSTS = (0.8, 0.3)
NEAR = 0.05
"""A fit has converged where it stays within 10 % of the truth."""


def all_fits(made: Preset, seeds: range, shapes: int, iterations: int, noise_sd: float, every: int) -> list[Descent]:
    """One batch a policy: every loss from every first speed, losses in the order of SHOWN."""
    losses = [loss for loss in SHOWN for _ in FIRSTS]
    found = []
    for seed in seeds:
        one = task(made, seed, shapes, noise_sd=noise_sd, every=every)
        began = time.perf_counter()
        found.append(descend(one, losses, list(FIRSTS) * len(SHOWN), iterations))
        took = (time.perf_counter() - began) / iterations / len(losses)
        print(f"policy {seed}: {one.demo.t[-1]:.1f} s, {len(one.demo.spans)} segments; {took:.2f} s a step of a fit")
    return found


def print_table(found: list[Descent]) -> None:
    """One line a loss over all policies and first speeds.

    Converged: within 10 % in the whole last third. Error: of the mean of the last third, median and worst fit.
    Settled: iteration from which on it is within 10 %, median and worst of those that converged. Rough: mean size of
    the second difference after the first third, in 1/1000.
    """
    print(f"{'':10}  converged   error: median  worst   settled: median  worst   rough")
    for k, (name, _) in enumerate(SHOWN.values()):
        speeds = np.concatenate([each.speeds[:, 2 * k : 2 * k + 2] for each in found], axis=1)
        third = len(speeds) // 3
        off = np.abs(speeds[-third:].mean(0) - TRUTH)
        away = np.abs(speeds - TRUTH) >= NEAR
        inside = ~away[-third:].any(0)
        settled = (len(speeds) - np.argmax(away[::-1], axis=0))[inside]
        when = f"{np.median(settled):6.0f} {settled.max():6}" if len(settled) else f"{'-':>6} {'-':>6}"
        rough = 1e3 * np.abs(np.diff(speeds, 2, axis=0))[third:].mean()
        error = f"{np.median(off):14.4f} {off.max():7.3f}"
        print(f"  {name:10} {inside.sum():2} of {len(inside)} {error} {when:>22} {rough:8.2f}")
    print()


def figure(path: Path, found: list[Descent]) -> None:
    """Loss and motor speed over the iterations; the paper's three losses above. Thin: the speeds of other policies."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sheet = Figure(figsize=(9, 6), dpi=66, layout="constrained")
    FigureCanvasAgg(sheet)
    axes: Any = sheet.subplots(2, 2, sharex=True)
    for k, (name, colour) in enumerate(SHOWN.values()):
        row = axes[k // 3]
        for number, each in enumerate(found):
            style = {"color": colour, "linewidth": 1.8 if number == 0 else 0.5, "alpha": 1.0 if number == 0 else 0.6}
            for start in range(len(FIRSTS)):
                label = name if number == start == 0 else None
                if number == 0:
                    rms: Array = 1e3 * np.sqrt(each.losses[:, 2 * k + start])
                    row[0].plot(rms, label=label, **style)
                row[1].plot(each.speeds[:, 2 * k + start], label=label, **style)
    for row in axes:
        row[0].set(yscale="log", ylabel="root of the loss [mm]")
        row[1].set(ylabel="motor speed [1]")
        row[1].axhline(TRUTH, color="black", linewidth=0.8, linestyle=":")
        row[0].legend(fontsize=8)
    for axis in axes[1]:
        axis.set(xlabel="iteration")
    path.parent.mkdir(parents=True, exist_ok=True)
    sheet.savefig(path, metadata={"Software": None})


def main(out: Path, *, policies: int = 4, shapes: int = 4, iterations: int = 60) -> None:
    """Print every table, draw `paper-identification.png`."""
    torch.set_num_threads(1)
    made = engine()
    print_slopes()
    print_costs()
    print(f"Adam 0.1, {iterations} iterations, motor speed from {FIRSTS[0]} and {FIRSTS[1]}, truth {TRUTH}")
    exact = all_fits(made, range(policies), shapes, iterations, 0.0, 1)
    print_table(exact)
    figure(out / "paper-identification.png", exact)
    print("policy 0 again, its caps seen every 0.1 s with 2 mm of noise")
    print_table(all_fits(made, range(1), shapes, iterations, 2e-3, 5))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out"), help="folder of the picture")
    parser.add_argument("--policies", type=int, default=4)
    parser.add_argument("--shapes", type=int, default=4, help="of a policy")
    parser.add_argument("--iterations", type=int, default=60)
    arguments = parser.parse_args()
    main(arguments.out, policies=arguments.policies, shapes=arguments.shapes, iterations=arguments.iterations)
