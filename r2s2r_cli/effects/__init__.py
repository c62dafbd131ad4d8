"""The catalogue of effects: physical laws that the nominal simulator lacks, one a file, in the design's order."""

from r2s2r_cli.effects.air_drag import AirDrag
from r2s2r_cli.effects.attachment_offset import AttachmentOffset
from r2s2r_cli.effects.backlash import Backlash
from r2s2r_cli.effects.base import (
    Effect as Effect,
    EffectParameter as EffectParameter,
    with_off_values as with_off_values,
)
from r2s2r_cli.effects.battery_sag import BatterySag
from r2s2r_cli.effects.camera_delay import CameraDelay
from r2s2r_cli.effects.camera_pose import CameraPose
from r2s2r_cli.effects.camera_scale import CameraScale
from r2s2r_cli.effects.cap_friction import CapFriction
from r2s2r_cli.effects.cap_radius import CapRadius
from r2s2r_cli.effects.capstan_friction import CapstanFriction
from r2s2r_cli.effects.com_offset import ComOffset
from r2s2r_cli.effects.command_latency import CommandLatency
from r2s2r_cli.effects.dropout import Dropout
from r2s2r_cli.effects.friction_anisotropy import FrictionAnisotropy
from r2s2r_cli.effects.friction_field import FrictionField
from r2s2r_cli.effects.ground_slope import GroundSlope
from r2s2r_cli.effects.known import known_effects as known_effects, looked_for as looked_for
from r2s2r_cli.effects.load_droop import LoadDroop
from r2s2r_cli.effects.motor_dead_zone import MotorDeadZone
from r2s2r_cli.effects.motor_lag import MotorLag
from r2s2r_cli.effects.motor_speed_mismatch import MotorSpeedMismatch
from r2s2r_cli.effects.obstacle import Obstacle
from r2s2r_cli.effects.payload import Payload
from r2s2r_cli.effects.rolling_resistance import RollingResistance
from r2s2r_cli.effects.sensor_bias import SensorBias
from r2s2r_cli.effects.sensor_gain import SensorGain
from r2s2r_cli.effects.sensor_saturation import SensorSaturation
from r2s2r_cli.effects.soft_ground import SoftGround
from r2s2r_cli.effects.spool_buildup import SpoolBuildup
from r2s2r_cli.effects.stribeck import Stribeck
from r2s2r_cli.effects.tendon_hysteresis import TendonHysteresis
from r2s2r_cli.effects.tendon_relaxation import TendonRelaxation
from r2s2r_cli.effects.tendon_set import TendonSet
from r2s2r_cli.effects.tendon_stiffness import TendonStiffness
from r2s2r_cli.effects.tether_drag import TetherDrag
from r2s2r_cli.effects.viscous_contact import ViscousContact

CATALOGUE: tuple[Effect, ...] = (
    MotorDeadZone(),
    CommandLatency(),
    MotorLag(),
    MotorSpeedMismatch(),
    BatterySag(),
    LoadDroop(),
    SpoolBuildup(),
    Backlash(),
    TendonStiffness(),
    TendonRelaxation(),
    TendonSet(),
    ComOffset(),
    Payload(),
    FrictionField(),
    RollingResistance(),
    SoftGround(),
    CapFriction(),
    CapRadius(),
    GroundSlope(),
    TetherDrag(),
    SensorBias(),
    SensorGain(),
    CameraPose(),
    CameraScale(),
    CameraDelay(),
    Dropout(),
)
"""What `diagnose` looks for, in the order of the way of the data: its calibration rests on these."""

FURTHER: tuple[Effect, ...] = (
    TendonHysteresis(),
    CapstanFriction(),
    AttachmentOffset(),
    FrictionAnisotropy(),
    Stribeck(),
    ViscousContact(),
    Obstacle(),
    AirDrag(),
    SensorSaturation(),
)
"""Looked for only where they are named, in the same order: no calibration set has them."""
