"""The roll of a rod about its own axis: end caps do not show it, cable tensions do."""

from __future__ import annotations

from dataclasses import replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine.balance import balance
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state
from r2s2r_cli.engine.nonfinite import require_finite
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.reading import read
from r2s2r_cli.engine.rollout import Simulator
from r2s2r_cli.engine.state import State

HEAVY = 1e9
"""Factor that pins a rod in place while only its roll relaxes."""


def along(p_WE: Tensor, R_WR: Tensor) -> Tensor:
    """Frames turned by the smallest rotation that puts z along the observed rods, (B, rod, 3, 3): roll is kept."""
    axis = p_WE[:, 1::2] - p_WE[:, 0::2]
    length = torch.linalg.vector_norm(axis, dim=-1, keepdim=True)
    if not bool((length > 0).all()):
        raise EngineInputError(
            "p_WE", "a rod of zero length", expected="two different caps", received=str(length.min())
        )
    z, old = axis / length, R_WR[..., 2].expand_as(axis)
    cross, dot = torch.linalg.cross(old, z), (old * z).sum(-1, keepdim=True)
    # Half-angle form; opposite axes (dot = -1) turn about x of the old frame.
    quaternion = torch.cat([cross, 1.0 + dot], dim=-1)
    flip = torch.cat([R_WR[..., 0].expand_as(axis), torch.zeros_like(dot)], dim=-1)
    quaternion = torch.where(dot < -1 + 1e-9, flip, quaternion)
    turn = roma.unitquat_to_rotmat(quaternion / torch.linalg.vector_norm(quaternion, dim=-1, keepdim=True))
    return turn @ R_WR.expand(len(p_WE), -1, -1, -1)


def resting(state: State) -> State:
    """The same pose at rest."""
    zero = torch.zeros_like(state.v_WB)
    return replace(state, v_WB=zero, w_R=zero.clone(), winding=torch.zeros_like(state.winding))


def roll_relaxed(simulator: Simulator, theta: Parameters, state: State, *, rounds: int = 3) -> State:
    """Each rod turned about its own axis to where the balancing tensions leave no torque; axes and places stay.

    The engine does it: rods so heavy that only the axial turn moves, cables of constant tension, no ground.
    """
    structure = simulator.structure
    winched = list(structure.actuated)
    pinned = replace(
        theta, mass=theta.mass * HEAVY, gravity=torch.zeros_like(theta.gravity),
        damping=torch.zeros_like(theta.damping),
        inertia=theta.inertia * theta.inertia.new_tensor([[HEAVY] * 3, [HEAVY] * 3, [HEAVY, HEAVY, 1.0]]),
    )  # fmt: skip
    soft = theta.stiffness.clone()
    soft[:, winched] = 1.0
    high = state.p_WB + state.p_WB.new_tensor([0.0, 0.0, 10.0])
    for _ in range(rounds):
        tension = balance(structure, theta, state).tension[:, winched]
        length = read(structure, theta, resting(state)).length[:, winched]
        free = replace(
            pinned, stiffness=soft, rest_min=torch.full_like(theta.rest_min, -HEAVY),
            rest_max=torch.full_like(theta.rest_max, HEAVY),
        )  # fmt: skip
        moving = replace(resting(state), p_WB=high, rest=length - tension)
        moving = _rolled(simulator, free, moving)
        state = replace(state, q_WR=moving.q_WR)
    return state


def _rolled(simulator: Simulator, theta: Parameters, state: State) -> State:
    structure = simulator.structure
    p = pack_parameters(structure, theta)
    idle = state.p_WB.new_zeros(len(state.p_WB), 1, structure.n_actuated)
    before = state.p_WB.new_zeros(len(state.p_WB))
    for _ in range(60):
        frames = simulator.advance(pack_state(structure, state), idle, p, h=5e-4, hold=10, every=10)
        require_finite(structure, simulator.kernels.fn, frames, idle, p, h=5e-4, hold=10, every=10)
        state = unpack_state(structure, frames[:, -1])
        kinetic = (state.w_R[..., 2] ** 2).sum(1)
        calm = (kinetic < before)[:, None, None]
        state = replace(state, w_R=torch.where(calm, 0.0, state.w_R))
        before = torch.where(calm[:, 0, 0], torch.zeros_like(kinetic), kinetic)
    return resting(state)
