"""Steps a second of many robots at once: machine code on one core, plain torch on a GPU where torch sees one.

Run `python examples/05_engine_library/on_gpu.py`; what came out on one machine: docs/concepts/engine.md, On a GPU.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import torch
from run import bench
from torch import Tensor

from r2s2r_cli.engine import Simulator, pack_parameters, pack_state

STEPS = {"cpu": 200, "cuda": 10}
"""Of 1 ms, timed after as many that are not."""
MOST_ON_A_CORE = 1024
"""Robots: more are simulated no faster there."""


def seconds(job: Callable[[], None], clock: Callable[[], float]) -> float:
    """That `job` takes the second time."""
    job()
    began = clock()
    job()
    return clock() - began


def steps_per_second(simulator: Simulator, s0: Tensor, p: Tensor, robots: int, *, gradient: bool = False) -> float:
    """Processor time of one core, or the clock of a GPU. s0: flat state (1, NS); p: flat parameters (1, NP)."""
    on_gpu, steps = s0.device.type != "cpu", STEPS[s0.device.type]
    start = s0.expand(robots, -1).contiguous()
    u = s0.new_zeros(robots, 1, simulator.structure.n_actuated)
    numbers = p.expand(robots, -1).clone().requires_grad_(gradient)

    def job() -> None:
        with torch.set_grad_enabled(gradient):
            frames = simulator.advance(start, u, numbers, h=1e-3, hold=steps, every=steps)
        if gradient:
            frames[:, -1].square().sum().backward()
        if on_gpu:
            torch.cuda.synchronize()

    return robots * steps / seconds(job, time.perf_counter if on_gpu else time.process_time)


def main(sizes: list[int]) -> None:
    """A line for each number of robots."""
    made = bench()
    s0, p = pack_state(made.structure, made.start), pack_parameters(made.structure, made.theta)
    devices = {"one core, machine code": "cpu"}
    if torch.cuda.is_available():
        devices[f"{torch.cuda.get_device_name(0)}, plain torch"] = "cuda"
    else:
        print("torch sees no GPU here")
    for name, device in devices.items():
        for robots in sizes if device != "cpu" else [n for n in sizes if n <= MOST_ON_A_CORE]:
            for gradient in (False, True):
                found = steps_per_second(made.simulator, s0.to(device), p.to(device), robots, gradient=gradient)
                what = "with a gradient" if gradient else "forward"
                print(f"{name}, {robots} robots, {what}: {found:,.0f} steps/s", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, nargs="+", default=[1, 1024, 16384], help="robots at once")
    main(parser.parse_args().robots)
