"""What the derivative of the Key Frame Loss is worth: by what is detached, and against differentiating the loop."""

from __future__ import annotations

import time

import numpy as np
import torch
from task import Task, engine, task
from torch import Tensor

from r2s2r_cli.engine import Detach, closed_loop
from r2s2r_cli.stages.identify.paper import Flight, Loss, compare, fly

SPECS = {"motor_speed=0.5,0.1..1.5": 0.65, "friction=0.76,0.1..2": 0.5}
"""Free number with its truth; where the derivative is taken."""
WIDTH = 1e-4
SEED, SHAPES = 0, 4


def parts(one: Task, flight: Flight, value: float) -> tuple[Tensor, Tensor]:
    """The number and the key-frame loss of every segment [m^2], each from its detached start."""
    x = torch.tensor([value], dtype=torch.float64, requires_grad=True)
    made = one.made
    found = compare(Loss.KEY_FRAME, made.world, made.numbers.theta(x), flight, one.demo, mask=False)
    return x, found.value.parts


def print_slopes() -> None:
    """Derivative of every segment's loss, by `Structure.detach`, beside central differences of the same windows."""
    for spec, at in SPECS.items():
        print(f"d loss / d number of every segment at {at:g}, truth and bounds {spec} [mm^2]")
        for detach in Detach:
            one = task(engine(detach, spec), SEED, SHAPES)
            flight = fly(one.made.world, one.made.numbers.theta(np.array([at])), one.start, one.targets)
            x, losses = parts(one, flight, at)
            print_row(detach, [float(torch.autograd.grad(each, x, retain_graph=True)[0]) for each in losses])
            if detach is Detach.NONE:
                above, below = (parts(one, flight, at + d)[1].detach() for d in (WIDTH, -WIDTH))
                print_row("difference", ((above - below) / (2 * WIDTH)).tolist())
    print()


def print_row(name: str, slopes: list[float]) -> None:
    """One line, in mm^2."""
    print(f"  {name:10}" + "".join(f"{1e6 * slope:12.4g}" for slope in slopes))


def print_costs() -> None:
    """Seconds of the parts of one iteration, and of what they stand for: autograd through the closed loop."""
    one = task(engine(), SEED, SHAPES)
    world, numbers = one.made.world, one.made.numbers
    x = torch.tensor([0.65], dtype=torch.float64, requires_grad=True)
    for _ in range(2):  # the first compiles
        began = time.perf_counter()
        flight = fly(world, numbers.theta(x.detach()), one.start, one.targets)
        flown = time.perf_counter()
        torch.autograd.grad(compare(Loss.KEY_FRAME, world, numbers.theta(x), flight, one.demo).value.total, x)
        replayed = time.perf_counter()
    timeouts = torch.full((len(one.targets),), world.timeout, dtype=torch.float64)
    run = closed_loop(world.simulator, numbers.theta(x), one.start, world.pid, torch.as_tensor(one.targets),
                      torch.zeros_like(timeouts), timeouts)  # fmt: skip
    torch.autograd.grad(run.trajectory.end_caps()[0, -1].sum(), x)
    through = time.perf_counter()
    size = flight.commands.abs()
    print(f"closed loop of {flight.t[-1]:.1f} s: {flown - began:.2f} s; its windows replayed with derivatives: "
          f"{replayed - flown:.2f} s;")  # fmt: skip
    print(f"autograd through the loop instead of both: {through - replayed:.2f} s; of the commands that are not 0 "
          f"{float((size[size > 0] < 1).double().mean()):.1%} are not saturated\n")  # fmt: skip


if __name__ == "__main__":
    torch.set_num_threads(1)
    print_slopes()
    print_costs()
