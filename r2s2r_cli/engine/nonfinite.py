"""Where a simulation left the finite numbers: the step, the body and the term."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from r2s2r_cli.engine.body import bodies, gyroscopic
from r2s2r_cli.engine.cable import cable_rows, pulled, rest_lengths, spring_force, tension_impulse
from r2s2r_cli.engine.contact import contact_rows
from r2s2r_cli.engine.errors import NonFiniteError
from r2s2r_cli.engine.flat import unpack_parameters, unpack_state
from r2s2r_cli.engine.friction_solve import solve
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.structure import Structure

FlatStep = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]


def require_finite(
    structure: Structure, fn: FlatStep, frames: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int, every: int
) -> None:
    """Raises NonFiniteError if a frame (B, F, NS) is not finite, found by repeating the steps before it in torch."""
    # Poses and velocities are sums: what is not finite once stays so, and the last frame tells.
    good = torch.isfinite(frames[:, -1]).all(-1)
    if bool(good.all()):
        return
    one = int(torch.nonzero(~good)[0])
    with torch.no_grad():
        finite = torch.isfinite(frames[one]).all(-1)
        first = int(torch.nonzero(~finite)[0])
        if first == 0:
            raise NonFiniteError(step=0, time=0.0, environment=one, body="the start", term="state")
        s = frames[one : one + 1, first - 1]
        params = p[one : one + 1] if len(p) > 1 else p
        dt = s.new_full((1, 1), h)
        for k in range((first - 1) * every, first * every):
            command = u[one : one + 1, k // hold]
            after = fn(s, command, params, dt)
            if not bool(torch.isfinite(after).all()):
                body, term = _culprit(structure, s, params, dt, after)
                raise NonFiniteError(step=k, time=k * h, environment=one, body=body, term=term)
            s = after
    # Rounding differs between torch and machine code: torch just stayed finite where the machine code did not.
    raise NonFiniteError(
        step=first * every, time=first * every * h, environment=one, body="a rod", term="state, between two frames"
    )


def _culprit(structure: Structure, s: Tensor, p: Tensor, h: Tensor, after: Tensor) -> tuple[str, str]:
    for kind, term, tensor in _terms(structure, s, p, h):
        if not bool(torch.isfinite(tensor).all()):
            index = torch.nonzero(~torch.isfinite(tensor[0].flatten(1) if tensor.ndim > 2 else tensor[0][:, None]))[0]
            return f"{kind} {int(index[0])}", term
    state = unpack_state(structure, after)
    for name in ("v_WB", "w_R", "p_WB", "q_WR"):
        tensor = getattr(state, name)
        if not bool(torch.isfinite(tensor).all()):
            return f"rod {int(torch.nonzero(~torch.isfinite(tensor[0]))[0][0])}", name
    return "a winch or an effect", "state"


def _terms(structure: Structure, s: Tensor, p: Tensor, h: Tensor) -> Iterator[tuple[str, str, Tensor]]:
    """The quantities of a step in the order in which it computes them: (rod or cable, its name, tensor)."""
    theta, state = unpack_parameters(structure, p), unpack_state(structure, s)
    theta = effective(structure, theta)
    rods = bodies(theta, state, axial=structure.axial)
    yield "rod", "inverse inertia", rods.inverse_inertia
    if structure.n_cables:
        rows = cable_rows(structure, theta, rods)
        yield "cable", "length", rows.length
        yield "cable", "length rate", rows.rate
        terms = spring_force(structure, theta, rows, rest_lengths(structure, theta, state.rest))
        yield "cable", "spring force", terms.force
        impulse = tension_impulse(structure, theta, rows, terms, terms.force, h)
        yield "cable", "tension impulse", impulse
        dv, dw = pulled(structure, rods, rows, impulse)
    else:
        dv, dw = torch.zeros_like(rods.v), torch.zeros_like(rods.w)
    yield "rod", "velocity change by cables", dv
    turn = gyroscopic(theta, rods.inverse_inertia, rods.w, h)
    yield "rod", "gyroscopic change of angular velocity", turn
    v, w = rods.v + h[..., None] * theta.gravity[:, None] + dv, rods.w + turn + dw
    memory = {effect.name: state.of(effect.name) for effect in structure.effects}
    ground = contact_rows(structure, theta, rods, v, w, h, memory)
    yield "rod", "contact mobility", ground.mobility
    yield "rod", "contact velocity", ground.free
    yield "rod", "contact impulse", solve(structure, ground)
