"""The tables of docs/concepts/engine-accuracy.md: `python examples/07_accuracy/run.py [--seconds 10] [--seeds 8]`.

One step of machine code against torch, how the difference grows over a gait, how large derivatives of gaits are, and
forward against reverse and central differences. With its defaults three minutes on one core, most of it torch.
"""

from __future__ import annotations

import argparse

import torch
from accuracy import PARAMETERS, Bench, backward_derivatives, bench, derivatives, growth, one_step, secants
from torch import Tensor


def print_one_step(b: Bench) -> None:
    """Machine code against torch, one step."""
    print("\none step from states along the gaits, machine code against torch, relative")
    print(f"{'':8}{'median':>10}{'largest':>10}")
    for name, error in one_step(b):
        print(f"{name:8}{float(error.median()):10.1e}{float(error.max()):10.1e}")


def print_growth(b: Bench, seconds: float) -> None:
    """How far they come apart."""
    t, apart = growth(b, seconds, 0.1)
    print("\nlargest distance of a cap between machine code and torch [m], over the gaits")
    print(f"{'time [s]':8}{'median':>10}{'largest':>10}")
    for at in (0.1, 1.0, 2.0, 5.0, 10.0):
        k = int((t - at).abs().argmin())
        if abs(float(t[k]) - at) < 1e-9:
            print(f"{at:8g}{float(apart[:, k].median()):10.1e}{float(apart[:, k].max()):10.1e}")


def print_sizes(b: Bench, times: tuple[float, ...]) -> None:
    """How large derivatives are."""
    found = derivatives(b, times)
    print("\nderivatives of the rods' positions over a gait: largest entry, median and largest over the gaits")
    print(f"{'time [s]':8}{'by log parameter [m]':>24}{'by start position [1]':>24}")
    for k, at in enumerate(times):
        print(f"{at:8g}{_pair(found.by_parameter[:, k]):>24}{_pair(found.by_start[:, k]):>24}")
    worst = found.by_parameter[:, -1].abs().amax((0, 1))
    print(
        "by parameter at the end: " + ", ".join(f"{n} {float(x):.2g}" for n, x in zip(PARAMETERS, worst, strict=True))
    )


def print_checks(b: Bench, times: tuple[float, ...]) -> None:
    """Forward, reverse and central differences."""
    print("\nrelative to the largest entry, median and largest over the gaits")
    forward = derivatives(b, (1.0,)).by_parameter[:, 0]
    print(f"JVP against VJP, 1 s             {_ratio(backward_derivatives(b, 1.0), forward)}")
    for k, at in enumerate(times):
        forward = derivatives(b, times).by_parameter[:, k]
        print(f"JVP against central differences, {at:g} s  {_ratio(secants(b, at, 1e-6), forward)}")


def _pair(x: Tensor) -> str:
    each = x.flatten(1).abs().amax(1)
    return f"{float(each.median()):.2g} / {float(each.max()):.2g}"


def _ratio(one: Tensor, other: Tensor) -> str:
    each = (one - other).flatten(1).abs().amax(1) / other.flatten(1).abs().amax(1)
    return f"{float(each.median()):.1e} / {float(each.max()):.1e}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0, help="length of the gaits")
    parser.add_argument("--seeds", type=int, default=8, help="number of gaits")
    options = parser.parse_args()
    torch.set_num_threads(1)
    b = bench(seeds=options.seeds, seconds=options.seconds)
    print(f"{options.seeds} gaits of {options.seconds:g} s: random shapes in closed loop, commands replayed, 1 ms")
    within = tuple(t for t in (1.0, 2.0, 5.0, 10.0) if t <= options.seconds)
    print_one_step(b)
    print_sizes(b, within)
    print_checks(b, within[:2])
    print_growth(b, options.seconds)
