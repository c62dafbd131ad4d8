"""The state of the simulated robot: what a step changes. Frozen tensors, batch first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure


@dataclass(frozen=True)
class State:
    """Rods, winches and the memory of effects; frame W is the ground frame G inside the engine (ground.py)."""

    p_WB: Tensor
    """Centres of mass [m], (B, rod, 3)."""
    q_WR: Tensor
    """Orientations, unit quaternions xyzw, (B, rod, 4)."""
    v_WB: Tensor
    """Velocities of the centres of mass [m/s], (B, rod, 3)."""
    w_R: Tensor
    """Angular velocities in rod axes [rad/s], (B, rod, 3)."""
    rest: Tensor
    """Rest lengths of the winched cables between their attachment points [m], (B, actuated)."""
    winding: Tensor
    """Winding rates, + shortens [m/s], (B, actuated); a state where Structure.lag, else what the last step used."""
    extra: Mapping[str, Tensor] = field(default_factory=dict)
    """States of effects, `effect.state` -> (B, n)."""

    def of(self, effect: str) -> dict[str, Tensor]:
        """The own states of one effect by their short names."""
        prefix = effect + "."
        return {name[len(prefix) :]: value for name, value in self.extra.items() if name.startswith(prefix)}

    def select(self, index: Tensor | slice | int) -> State:
        """The same for part of the batch."""
        if isinstance(index, int):
            index = slice(index, index + 1) if index != -1 else slice(-1, None)
        named = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "extra"}
        return State(**named, extra={name: tensor[index] for name, tensor in self.extra.items()})


def state_shapes(structure: Structure) -> dict[str, tuple[int, ...]]:
    """Shape of every field of State without the batch axis, effect states included, in the order of the flat vector."""
    rods, winches = structure.n_rods, structure.n_actuated
    named: dict[str, tuple[int, ...]] = {
        "p_WB": (rods, 3), "q_WR": (rods, 4), "v_WB": (rods, 3), "w_R": (rods, 3),
        "rest": (winches,), "winding": (winches,),
    }  # fmt: skip
    for effect in structure.effects:
        named.update({f"{effect.name}.{key}": (n,) for key, n in effect.state_sizes(structure).items()})
    return named


def check_state(structure: Structure, state: State) -> None:
    """Raises EngineInputError for a wrong shape, a number that is not finite, or a quaternion that is no rotation."""
    for name, shape in state_shapes(structure).items():
        tensor = state.extra.get(name) if "." in name else getattr(state, name)
        if tensor is None:
            raise EngineInputError(
                name, "a state of an effect is missing", expected=f"(B, {shape[0]})", received="none"
            )
        if tuple(tensor.shape[1:]) != shape or tensor.ndim != len(shape) + 1:
            raise EngineInputError(
                name,
                "wrong shape",
                expected="(B, " + ", ".join(map(str, shape)) + ")",
                received=str(tuple(tensor.shape)),
            )
        if not torch.isfinite(tensor).all():
            index = tuple(int(i) for i in torch.nonzero(~torch.isfinite(tensor))[0])
            raise EngineInputError(
                f"{name}.{'.'.join(map(str, index[1:]))}", "not a finite number", expected="finite numbers",
                received=f"{float(tensor[index])} in environment {index[0]}",
            )  # fmt: skip
    norm = torch.linalg.vector_norm(state.q_WR, dim=-1)
    if not bool(((norm - 1).abs() < 1e-3).all()):
        raise EngineInputError(
            "q_WR", "not a unit quaternion", expected="norm 1", received=f"norm {float(norm.min()):g}"
        )


def end_caps(theta: Parameters, state: State) -> Tensor:
    """End-cap centres p_WE [m], (B, cap, 3), caps 2 i and 2 i + 1 on rod i."""
    R_WR = roma.unitquat_to_rotmat(state.q_WR)
    p_WE = state.p_WB[:, :, None] + torch.einsum("brij,brej->brei", R_WR, theta.p_BE.expand(len(R_WR), -1, -1, -1))
    return p_WE.flatten(1, 2)


def cap_velocities(theta: Parameters, state: State) -> Tensor:
    """Velocities of the end-cap centres v_WE [m/s], (B, cap, 3)."""
    R_WR = roma.unitquat_to_rotmat(state.q_WR)
    arm = theta.p_BE.expand(len(R_WR), -1, -1, -1)
    spin = torch.linalg.cross(state.w_R[:, :, None].expand_as(arm), arm)
    return (state.v_WB[:, :, None] + torch.einsum("brij,brej->brei", R_WR, spin)).flatten(1, 2)


def cable_ends(structure: Structure, device: torch.device) -> Tensor:
    """Rods of the two ends of each cable, (cable, 2), for indexing."""
    return torch.tensor(structure.cable_rods, dtype=torch.long, device=device).reshape(-1, 2)


def middles(theta: Parameters, state: State) -> tuple[Tensor, Tensor]:
    """Middle between the caps of each rod p_WR [m] and its velocity [m/s], each (B, rod, 3): what artifacts hold."""
    shape = (len(state.p_WB), -1, 2, 3)
    return end_caps(theta, state).reshape(shape).mean(2), cap_velocities(theta, state).reshape(shape).mean(2)


def angular_velocities(state: State) -> Tensor:
    """Angular velocities in the world frame w_WR [rad/s], (B, rod, 3)."""
    return torch.einsum("brij,brj->bri", roma.unitquat_to_rotmat(state.q_WR), state.w_R)


def pose_state(structure: Structure, theta: Parameters, p_WE: Tensor, R_WR: Tensor, *, rest: Tensor) -> State:
    """The state at rest of rods with frames R_WR (B, rod, 3, 3), their middles between the caps p_WE (B, cap, 3) [m].

    The rods keep their own length. rest: rest lengths of the winched cables [m], (B, actuated). Effects start at 0.
    """
    batch, rods = len(p_WE), structure.n_rods
    middle = p_WE.reshape(batch, rods, 2, 3).mean(2)
    p_RB = -theta.p_BE.mean(2).expand(batch, -1, -1)
    zero = torch.zeros_like(middle)
    extra = {
        f"{effect.name}.{key}": middle.new_zeros(batch, n)
        for effect in structure.effects
        for key, n in effect.state_sizes(structure).items()
    }
    return State(
        p_WB=middle + torch.einsum("brij,brj->bri", R_WR, p_RB), q_WR=roma.rotmat_to_unitquat(R_WR),
        v_WB=zero, w_R=zero.clone(), rest=rest, winding=torch.zeros_like(rest), extra=extra,
    )  # fmt: skip
