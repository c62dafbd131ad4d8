"""Battery sag.

What it is: winches slow down as the battery empties, and while others pull at the same time.
Where it acts: channel motor; winding rate times 1 - fade * charge - drop * (winches pulling). Charge is what was drawn
since the run began, in seconds of one winch at full command: a robot that waits draws none.
Parameters: fade_per_s, loss of speed per second of one winch; drop, loss per winch that pulls.
What it looks like in data: all slopes fall with time, or with the number of cables that move.
What it is confused with: motor_speed_mismatch (in a short run), load_droop.
Source: internal resistance and discharge of a battery.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, MotorTerms, Values
from r2s2r_cli.engine.structure import Structure


class BatterySag(Effect):
    """All winches slow down with use."""

    name = "battery_sag"
    channel = Channel.MOTOR
    title = "battery sag"
    own = (
        EffectParameter("fade_per_s", "1/s", 0.0, 0.03, off=0.0, scale=0.004,
                        what="loss of speed per second of one winch at full command"),
        EffectParameter("drop", "1", 0.0, 0.1, off=0.0, scale=0.03, what="loss of speed per winch that pulls"),
    )  # fmt: skip
    look_alikes = ("motor_speed_mismatch", "load_droop")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "all length ramps flatten with time, or with the number of cables that move"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Charge drawn, in seconds of one winch; it is counted at the off value too."""
        del structure
        return {"charge": 1}

    def motor(self, x: Values, z: Values, rate: Tensor, terms: MotorTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Slower by the charge and by what pulls now; never backwards."""
        pulling = torch.abs(terms.u).sum(-1, keepdim=True)
        left = torch.relu(1.0 - x["fade_per_s"] * z["charge"] - x["drop"] * pulling)
        return rate * left, {"charge": z["charge"] + h * pulling}
