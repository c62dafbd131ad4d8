"""Backlash of the winches.

What it is: after a reversal a winch turns through the play of its gearbox, or takes up loose turns, before its cable
moves.
Where it acts: channel cable; the winding rate is 0 until the motor has travelled the play since its last reversal. A
motor that has never turned is taken to have let its cable out last, as robots are put down with long cables: winding in
it has all of the play before it.
Parameters: play_m, one a winch.
What it looks like in data: motion of a cable is missing right after its reversals, and only there.
What it is confused with: load_droop, camera_delay, command_latency.
Source: play operator (Brokate and Sprekels).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from r2s2r_cli.effects.base import Effect, EffectParameter
from r2s2r_cli.engine.hooks import Channel, MotorTerms, Values
from r2s2r_cli.engine.structure import Structure

FAR = 1.0
"""[m] travel of a motor that goes on letting its cable out: no play is left."""


class Backlash(Effect):
    """Cables do not move until the play is taken up."""

    name = "backlash"
    channel = Channel.CABLE
    title = "backlash of the winches"
    own = (EffectParameter("play_m", "m", 0.0, 0.012, off=0.0, scale=0.004, what="of the winch", per="actuated"),)
    look_alikes = ("load_droop", "camera_delay", "command_latency")

    @classmethod
    def signature(cls) -> str:
        """What it looks like in data."""
        return "motion of a cable is missing right after its reversals, and only there"

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Last direction of each motor (0: never turned) and its travel since the last reversal [m]; both go on at the
        off value too."""
        return {"way": structure.n_actuated, "travel": structure.n_actuated}

    def motor(self, x: Values, z: Values, rate: Tensor, terms: MotorTerms, h: Tensor) -> tuple[Tensor, Values]:
        """The rate, less what the play swallows within the step."""
        del terms
        play, zero = x["play_m"], torch.zeros_like(rate)
        way = torch.where(rate > 0, zero + 1.0, torch.where(rate < 0, zero - 1.0, z["way"]))
        # What is left of the play after a short way back is only what was taken up of it.
        reversed_now = torch.relu(play - z["travel"])
        first = torch.where(way > 0, zero, zero + FAR)  # of a motor that has never turned
        before = torch.where(z["way"] * way < 0, reversed_now, torch.where(z["way"] == 0, first, z["travel"]))
        travel = before + h * torch.abs(rate)
        rest = way * torch.relu(travel - play) / h
        moved = torch.where(before >= play, rate, rest)
        return moved, {"way": way, "travel": torch.where(way == 0, zero, torch.clamp(travel, max=FAR))}
