"""When a rollout steps, and its arrays as every kernel is given them."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.native import machine
from r2s2r_cli.engine.native.lanes import to_lanes


@dataclass(frozen=True)
class Schedule:
    """Times of a rollout. h: step [s]. hold: steps that a row of inputs is held. every: steps from frame to frame.
    threads: blocks of lanes that run side by side."""

    h: float
    hold: int
    every: int
    threads: int = 1

    def steps(self, rows: int) -> int:
        """Number of steps for so many rows of inputs."""
        return rows * self.hold

    def frames(self, rows: int) -> int:
        """Number of frames, the initial state counted."""
        return self.steps(rows) // self.every + 1


def lanes_for(batch: int, dtype: torch.dtype) -> int:
    """Environments that one kernel call takes: as many as a vector register holds, a single one alone."""
    return 1 if batch == 1 else machine.vector_bytes() // dtype.itemsize


def given_arrays(s0: Tensor, u: Tensor, p: Tensor, plan: Schedule, lanes: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """State, inputs and parameters by block, and the step; detached, for autograd cannot see what a kernel does."""
    step = s0.new_full((lanes,), plan.h)
    state, inputs, parameters = (to_lanes(x.detach(), lanes) for x in (s0, u, p))
    return state, inputs, parameters, step
