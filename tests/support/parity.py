"""Machine code against torch: one step and its whole Jacobian, both ways, and a norm that is fair to every number.

Values: the error of a field over the largest magnitude of the field in that state, but at least `UNIT`, what the field
has in a moving robot: the velocity of a resting robot is a sum of impulses that cancel, not a number of 1e-9.
Derivatives: d out / d in in the fields' units, so that entries compare (a parameter's unit is its value); the error of
a field over the largest derivative it has in that state. This norm would let pass a wrong derivative by what hardly
matters; the same with a small `floor` looks at each block (field by field) beside its own largest entry.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine import Structure, pack_parameters, pack_state
from r2s2r_cli.engine.flat import Slot, parameter_slots, state_slots
from r2s2r_cli.engine.native import NativeStep
from r2s2r_cli.engine.state import State
from tests.support.variants import Variant

UNIT = {"p_WB": 0.1, "q_WR": 1.0, "v_WB": 0.1, "w_R": 1.0, "rest": 0.1, "winding": 0.05}
"""[m], 1, [m/s], [rad/s], [m], [m/s]; 1 for what effects remember."""


@dataclass(frozen=True)
class Problem:
    """A batch of states, commands and parameters as vectors, and the fields in them."""

    structure: Structure
    s: Tensor
    u: Tensor
    p: Tensor

    def outputs(self) -> dict[str, Slot]:
        """Fields of the state vector that have numbers."""
        return {name: slot for name, slot in state_slots(self.structure).items() if slot.size}

    def inputs(self) -> dict[str, Slot]:
        """Fields of all inputs in the Jacobian's columns: state, command, parameters."""
        fields = {f"state.{name}": slot for name, slot in self.outputs().items()}
        begin = self.s.shape[1]
        if self.u.shape[1]:
            n = self.u.shape[1]
            fields["command"] = Slot(begin, n, (n,), ())
        begin += self.u.shape[1]
        for name, slot in parameter_slots(self.structure).items():
            if slot.size:
                fields[name] = Slot(begin + slot.start, slot.size, slot.shape, slot.kept)
        return fields

    def units(self) -> tuple[Tensor, Tensor]:
        """Unit of every number of the state, (NS,), and of every column of the Jacobian, (NS + NU + NP,)."""
        state = torch.ones(self.s.shape[1], dtype=torch.float64)
        for name, slot in self.outputs().items():
            state[slot.start : slot.start + slot.size] = UNIT.get(name, 1.0)
        sizes = self.p[0].double().abs()
        parameter = torch.ones_like(sizes)
        for slot in parameter_slots(self.structure).values():
            if slot.size and (largest := sizes[slot.start : slot.start + slot.size].max()) > 0:
                parameter[slot.start : slot.start + slot.size] = largest
        return state, torch.cat([state, torch.ones(self.u.shape[1], dtype=torch.float64), parameter])


def problem(variant: Variant, state: State, *, seed: int = 0, dtype: torch.dtype = torch.float64) -> Problem:
    """The variant's step from these states with random commands, some beyond [-1, 1]."""
    s = pack_state(variant.structure, state)
    generator = torch.Generator().manual_seed(seed)
    u = 1.2 * (2 * torch.rand(len(s), variant.structure.n_actuated, generator=generator, dtype=torch.float64) - 1)
    p = pack_parameters(variant.structure, variant.theta)
    return Problem(variant.structure, s.to(dtype), u.to(dtype), p.to(dtype))


def value_error(problem: Problem, one: Tensor, other: Tensor) -> Tensor:
    """Largest relative error of any field, for each state, (B,)."""
    worst = torch.zeros(len(one), dtype=torch.float64)
    for name, slot in problem.outputs().items():
        a, b = (x[:, slot.start : slot.start + slot.size].double() for x in (one, other))
        size = torch.clamp(b.abs().amax(1), min=UNIT.get(name, 1.0))
        worst = torch.maximum(worst, (a - b).abs().amax(1) / size)
    return worst


def jacobian_error(problem: Problem, one: Tensor, other: Tensor, *, floor: float = 1.0) -> Tensor:
    """Largest relative error of any block of the Jacobians (B, NS, NS + NU + NP), for each state, (B,).

    floor: share of an output field's largest derivative that a smaller block is measured by.
    """
    rows, columns = problem.units()
    a, b = (x.double() * columns / rows[:, None] for x in (one, other))
    worst = torch.zeros(len(one), dtype=torch.float64)
    for out in problem.outputs().values():
        r = slice(out.start, out.start + out.size)
        row = floor * b[:, r].abs().amax((1, 2))
        for into in problem.inputs().values():
            c = slice(into.start, into.start + into.size)
            # What has no derivative at all (a direction that is remembered) must have none in both.
            size = torch.clamp(torch.maximum(b[:, r, c].abs().amax((1, 2)), row), min=1e-300)
            worst = torch.maximum(worst, (a[:, r, c] - b[:, r, c]).abs().amax((1, 2)) / size)
    return worst


def torch_jacobian(step: NativeStep, problem: Problem, h: float) -> Tensor:
    """The whole Jacobian by torch's autograd, (B, NS, NS + NU + NP): one state of a large batch a row."""
    batch, n = problem.s.shape
    s, u = (x.repeat_interleave(n, dim=0).requires_grad_() for x in (problem.s, problem.u))
    p = problem.p.expand(batch * n, -1).clone().requires_grad_()
    out = step.fn(s, u, p, s.new_full((batch * n, 1), h))
    seeds = torch.eye(n, dtype=out.dtype).repeat(batch, 1)
    grads = torch.autograd.grad(out, (s, u, p), seeds, allow_unused=True, materialize_grads=True)
    return torch.cat([g.reshape(batch, n, -1) for g in grads], dim=2)


def vjp_jacobian(step: NativeStep, problem: Problem, h: float) -> Tensor:
    """The same by the compiled vector-Jacobian product."""
    batch, n = problem.s.shape
    s, u = (x.repeat_interleave(n, dim=0) for x in (problem.s, problem.u))
    seeds = torch.zeros(batch * n, 2, n, dtype=s.dtype)
    seeds[:, 1] = torch.eye(n, dtype=s.dtype).repeat(batch, 1)
    grads = step.vjp(s, u[:, None], problem.p.expand(batch * n, -1), seeds, h=h)
    return torch.cat([g.reshape(batch, n, -1) for g in grads], dim=2)


def jvp_jacobian(step: NativeStep, problem: Problem, h: float) -> Tensor:
    """The same by the compiled Jacobian-vector product."""
    (batch, n), a, k = problem.s.shape, problem.u.shape[1], problem.p.shape[1]
    unit = torch.eye(n + a + k, dtype=problem.s.dtype)[None].expand(batch, -1, -1)
    ds0, du, dp = unit[:, :n], unit[:, n : n + a], unit[:, n + a :]
    _, tangents = step.jvp(problem.s, problem.u[:, None], problem.p, ds0=ds0, du=du[:, None], dp=dp, h=h)
    return tangents[:, 1]


def torch_step(step: NativeStep, problem: Problem, h: float) -> Tensor:
    """The state after one step, in torch, (B, NS)."""
    return step.fn(problem.s, problem.u, problem.p, problem.s.new_full((len(problem.s), 1), h))


def native_step(step: NativeStep, problem: Problem, h: float) -> Tensor:
    """The state after one step, in machine code, (B, NS): the kernel of lanes, or of a scalar for a batch of 1."""
    return step.forward(problem.s, problem.u[:, None], problem.p, h=h)[:, 1]


def part(problem: Problem, where: slice) -> Problem:
    """Some of the states."""
    return Problem(problem.structure, problem.s[where], problem.u[where], problem.p)
