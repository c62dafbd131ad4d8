"""What a rollout gives: states at regular times, and the end caps as they are and as the camera sees them."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from r2s2r_cli.engine.flat import pack_state, unpack_state
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.late import observe
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.state import State, end_caps
from r2s2r_cli.engine.structure import Structure


@dataclass(frozen=True)
class Trajectory:
    """States at regular times. t: (frame,) [s]; states: fields (B, frame, ...); substeps: engine steps a `step`."""

    structure: Structure
    theta: Parameters
    t: Tensor
    states: State
    step: float
    substeps: int

    def at(self, frame: int) -> State:
        """The state at one frame, batch first."""
        return unpack_state(self.structure, pack_state(self.structure, self.states, leading=2)[:, frame])

    def end_caps(self) -> Tensor:
        """End-cap centres p_WE [m], (B, frame, cap, 3)."""
        flat = pack_state(self.structure, self.states, leading=2)
        batch, frames = flat.shape[:2]
        merged = unpack_state(self.structure, flat.flatten(0, 1))
        theta = effective(self.structure, self.theta).map(
            lambda x: x.expand(batch, *x.shape[1:]).repeat_interleave(frames, dim=0)
        )
        return end_caps(theta, merged).unflatten(0, (batch, frames))

    def observed(self) -> Tensor:
        """End caps as the camera sees them, (B, frame, cap, 3) [m]: effects of channel observation included."""
        return observe(self.structure, self.theta, self.t, self.end_caps())
