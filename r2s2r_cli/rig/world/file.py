"""`World`, the whole of a world file, and how it is read."""

from __future__ import annotations

import tomllib
from pathlib import Path

from pydantic import ValidationError

from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.effects.parameters import Effects
from r2s2r_cli.rig.section import Index, NonNegative, Positive, Real, Section, Share, Vector2
from r2s2r_cli.rig.world.device import Boards, Inertial, Sensors
from r2s2r_cli.rig.world.faults import Fault, Wire


class Floor(Section):
    """The ground plane. Its slope is the effect `ground_slope`, places of other friction are `friction_field`."""

    friction: NonNegative | None = None
    """Coulomb coefficient under every cap; left out: that of `robot.toml`."""
    restitution: Share | None = None
    """Left out: that of `robot.toml`."""


class Start(Section):
    """Where the robot lies when the rig starts: the rest pose of `robot.toml`, turned and moved, settled."""

    position_m: Vector2 = (0.0, 0.0)
    """Of the rest pose's origin on the floor [m], frame W."""
    heading_rad: Real = 0.0
    """Turn about the vertical [rad]."""
    settle_s: NonNegative = 3.0
    """How long it comes to rest before the rig's time 0 [s]."""
    put_back: bool = False
    """Whenever its motors are told to stop after it has moved, a hand puts it back there: on the side it lay on at
    first, in the shape it has, at rest, turned about the vertical at random (from the seed). A host says stop between
    runs."""


class World(Section):
    """A world file. Frame W: z against gravity, origin on the floor."""

    seed: Index = 0
    """Every random number of the rig follows from it."""
    timestep_s: Positive = 0.001
    """Of MuJoCo [s]."""
    stiff: bool = False
    """Contacts nearly as hard as impulses, at steps of 0.25 ms, whatever `timestep_s`: for comparisons with the
    engine."""
    floor: Floor = Floor()
    start: Start = Start()
    boards: Boards = Boards()
    sensors: Sensors = Sensors()
    inertial: Inertial = Inertial()
    camera: CameraSettings = CameraSettings()
    """What the camera is said to be; effects may have changed it (`seen`)."""
    effects: Effects = Effects()
    """`[effects.<id>]`: which unmodelled laws hold, and how strongly. Left out: none."""
    faults: tuple[Fault, ...] = ()
    """`[[faults]]`: what breaks, and when."""
    wire: Wire = Wire()

    def seen(self) -> CameraSettings:
        """The camera as it really is: its table with the effects of the camera and of the floor in it."""
        camera = self.camera
        for _, effect in self.effects.present():
            camera = effect.seen(camera)
        return camera


_EXAMPLE = "r2s2r rig --help   # docs/reference/world.md has an example of a world file"


def load_world(path: Path) -> World:
    """Read a world file. Raises InputError: no such file, no TOML, an unknown key, a value that cannot be."""
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path} cannot be read", where=str(path), expected="a world file (TOML)",
            received=error.strerror or str(error), hint="r2s2r rig --world world.toml",
        ) from error  # fmt: skip
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} is no TOML", where=str(path), expected="a world file (TOML)", received=str(error),
            hint=_EXAMPLE,
        ) from error  # fmt: skip
    try:
        return World.model_validate(raw)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(
            f"{path} is no world file: {first['msg']}", where=f"{path}: {key}",
            expected="the keys and bounds of docs/reference/world.md",
            received=repr(first["input"])[:80],
            # Nothing in another program's file, or in that of a project, is to be corrected into a world.
            hint=f"correct {key} in {path}" if set(raw) & set(World.model_fields) else _EXAMPLE,
        ) from error  # fmt: skip
