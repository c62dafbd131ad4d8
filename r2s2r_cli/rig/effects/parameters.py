"""`Effects`: the table `[effects]` of a world file, one key an effect id."""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.rig.effects.base import EffectSection
from r2s2r_cli.rig.effects.battery import BatterySag
from r2s2r_cli.rig.effects.cables import CapstanFriction, TendonHysteresis, TendonRelaxation, TendonSet, TendonStiffness
from r2s2r_cli.rig.effects.camera import CameraDelay, CameraPose, CameraScale, Dropout
from r2s2r_cli.rig.effects.contact import CapRadius, RollingResistance, SoftGround
from r2s2r_cli.rig.effects.friction import CapFriction, FrictionAnisotropy, FrictionField, Stribeck
from r2s2r_cli.rig.effects.mass import ComOffset, Payload
from r2s2r_cli.rig.effects.motors import CommandLatency, LoadDroop, MotorDeadZone, MotorLag, MotorSpeedMismatch
from r2s2r_cli.rig.effects.place import AirDrag, GroundSlope, Obstacle, TetherDrag, ViscousContact
from r2s2r_cli.rig.effects.sensing import SensorBias, SensorGain, SensorSaturation
from r2s2r_cli.rig.effects.winches import AttachmentOffset, Backlash, SpoolBuildup
from r2s2r_cli.rig.section import Section


class Effects(Section):
    """The laws that hold. A key that is left out: the law does not hold."""

    motor_dead_zone: MotorDeadZone | None = None
    command_latency: CommandLatency | None = None
    motor_lag: MotorLag | None = None
    motor_speed_mismatch: MotorSpeedMismatch | None = None
    battery_sag: BatterySag | None = None
    load_droop: LoadDroop | None = None
    spool_buildup: SpoolBuildup | None = None
    backlash: Backlash | None = None
    tendon_stiffness: TendonStiffness | None = None
    tendon_relaxation: TendonRelaxation | None = None
    tendon_hysteresis: TendonHysteresis | None = None
    tendon_set: TendonSet | None = None
    capstan_friction: CapstanFriction | None = None
    attachment_offset: AttachmentOffset | None = None
    com_offset: ComOffset | None = None
    payload: Payload | None = None
    friction_field: FrictionField | None = None
    friction_anisotropy: FrictionAnisotropy | None = None
    stribeck: Stribeck | None = None
    viscous_contact: ViscousContact | None = None
    rolling_resistance: RollingResistance | None = None
    soft_ground: SoftGround | None = None
    cap_friction: CapFriction | None = None
    cap_radius: CapRadius | None = None
    ground_slope: GroundSlope | None = None
    obstacle: Obstacle | None = None
    tether_drag: TetherDrag | None = None
    air_drag: AirDrag | None = None
    sensor_bias: SensorBias | None = None
    sensor_gain: SensorGain | None = None
    sensor_saturation: SensorSaturation | None = None
    camera_pose: CameraPose | None = None
    camera_scale: CameraScale | None = None
    camera_delay: CameraDelay | None = None
    dropout: Dropout | None = None

    def present(self) -> Iterator[tuple[str, EffectSection]]:
        """Those that hold, with their ids, in the catalogue's order."""
        for name in type(self).model_fields:
            section = getattr(self, name)
            if section is not None:
                yield name, section
