"""The ground plane in any orientation: the step works in the ground's own frame G, and this is the border.

G has the plane z = 0 and z along the plane's normal; its origin is the point of the plane below the world's origin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.state import State


@dataclass(frozen=True)
class Ground:
    """The plane normal . x = offset. normal: pointing out of the ground, frame W, (3,); offset [m], ()."""

    normal: Tensor
    offset: Tensor

    def R_GW(self) -> Tensor:
        """Rotation from W to G, (3, 3): the smallest that takes the normal to z. Raises EngineInputError."""
        length = torch.linalg.vector_norm(self.normal)
        if not bool(length > 0):
            raise EngineInputError("ground.normal", "no direction", expected="a vector", received=str(self.normal))
        x, y, z = (self.normal / length).unbind()
        if float(z.detach()) < -1 + 1e-9:
            return torch.diag(torch.stack([torch.ones_like(z), -torch.ones_like(z), -torch.ones_like(z)]))
        f = 1.0 / (1.0 + z)
        rows = [1 - f * x * x, -f * x * y, -x, -f * x * y, 1 - f * y * y, -y, x, y, z]
        return torch.stack(rows).reshape(3, 3)

    def p_WG(self) -> Tensor:
        """Origin of G [m], frame W, (3,)."""
        return self.normal * (self.offset / (self.normal * self.normal).sum())

    def to_ground(self, state: State) -> State:
        """A state in W as a state in G."""
        R_GW = self.R_GW()
        return replace(
            state, p_WB=(state.p_WB - self.p_WG()) @ R_GW.T, v_WB=state.v_WB @ R_GW.T,
            q_WR=roma.quat_product(roma.rotmat_to_unitquat(R_GW).expand_as(state.q_WR), state.q_WR),
        )  # fmt: skip

    def to_world(self, state: State) -> State:
        """A state in G as a state in W; leading axes stay."""
        R_GW = self.R_GW()
        turn = roma.rotmat_to_unitquat(R_GW.T).expand_as(state.q_WR)
        return replace(
            state, p_WB=state.p_WB @ R_GW + self.p_WG(), v_WB=state.v_WB @ R_GW,
            q_WR=roma.quat_product(turn, state.q_WR),
        )  # fmt: skip

    def parameters(self, theta: Parameters) -> Parameters:
        """Parameters with gravity given in W, as the step in G reads them."""
        return replace(theta, gravity=theta.gravity @ self.R_GW().T)


def tilted(angle_x: float, angle_y: float, offset: float = 0.0) -> Ground:
    """The plane z = 0 turned by angles [rad] about the world's x, then y axis, moved up its normal by offset [m]."""
    turn = roma.rotvec_to_rotmat(torch.tensor([0.0, angle_y, 0.0], dtype=torch.float64))
    turn = turn @ roma.rotvec_to_rotmat(torch.tensor([angle_x, 0.0, 0.0], dtype=torch.float64))
    return Ground(turn[:, 2], torch.tensor(offset, dtype=torch.float64))
