"""The catalogue of effects: physical laws that the nominal simulator lacks, one a file, in the design's order."""

from r2s2r_cli.effects.base import (
    Effect as Effect,
    EffectParameter as EffectParameter,
    with_off_values as with_off_values,
)
from r2s2r_cli.effects.cap_friction import CapFriction
from r2s2r_cli.effects.ground_slope import GroundSlope
from r2s2r_cli.effects.motor_lag import MotorLag

CATALOGUE: tuple[Effect, ...] = (MotorLag(), CapFriction(), GroundSlope())
"""Every effect, in the order of design.md section 5."""
