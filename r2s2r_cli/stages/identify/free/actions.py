"""What a value does to the numbers of a robot: torch functions of Parameters, differentiable, batch first.

Each action reads the robot's own numbers (`own`, those of robot.toml) and changes the present ones (`theta`). At the
value that robot.toml has it returns exactly what robot.toml has. `value` is (B, 1), in the unit of its Free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Protocol

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters

Place = tuple[str, int]
"""A field of Parameters (`speed_in`, `motor_lag.tau_s`) and a place in it, flattened without the batch axis."""


class Action(Protocol):
    """How one value acts. touches: what it sets; two values that set the same contradict each other. affine: what it
    sets is affine in the value and depends on no other value: its derivatives are constants. Otherwise it is affine in
    sine and cosine of the value."""

    affine: ClassVar[bool]

    @property
    def touches(self) -> frozenset[Place]:
        """What it sets."""
        ...

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """`theta` with the value at work."""
        ...


@dataclass(frozen=True)
class Scale:
    """The robot's own numbers at `places` times value / reference."""

    places: tuple[Place, ...]
    reference: float

    affine: ClassVar[bool] = True

    @property
    def touches(self) -> frozenset[Place]:
        """The places."""
        return frozenset(self.places)

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """Exactly the robot's own at value = reference."""
        return _placed(theta, self.places, lambda field: _field(own, field) * (value / self.reference))


@dataclass(frozen=True)
class Shift:
    """The robot's own numbers at `places` plus value - reference."""

    places: tuple[Place, ...]
    reference: float

    affine: ClassVar[bool] = True

    @property
    def touches(self) -> frozenset[Place]:
        """The places."""
        return frozenset(self.places)

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """Exactly the robot's own at value = reference."""
        return _placed(theta, self.places, lambda field: _field(own, field) + (value - self.reference))


@dataclass(frozen=True)
class Assign:
    """The value itself at all `places`."""

    places: tuple[Place, ...]

    affine: ClassVar[bool] = True

    @property
    def touches(self) -> frozenset[Place]:
        """The places."""
        return frozenset(self.places)

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """The value at the places."""
        return _placed(theta, self.places, lambda field: value.expand(-1, _field(own, field).shape[1]))


@dataclass(frozen=True)
class CentreOfMass:
    """Axial place of a rod's centre of mass [m], from the middle between its caps, + towards the odd cap. Caps and
    attachment points keep their places on the rod, so they move the other way in the body frame B; the inertia about
    the centre of mass stays. ends: places in p_BS, flattened to (2 cable, 3), of the cable ends on this rod."""

    rod: int
    ends: tuple[int, ...]
    reference: float

    affine: ClassVar[bool] = True

    @property
    def touches(self) -> frozenset[Place]:
        """The centre of mass of this rod."""
        return frozenset({("centre of mass", self.rod)})

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """Exactly the robot's own at value = reference."""
        caps: tuple[Place, ...] = tuple(("p_BE", 6 * self.rod + 3 * cap + 2) for cap in range(2))
        sites: tuple[Place, ...] = tuple(("p_BS", 3 * end + 2) for end in self.ends)
        return _placed(theta, caps + sites, lambda field: _field(theta, field) - (value - self.reference))


@dataclass(frozen=True)
class AttachmentPhase:
    """Rotation [rad] of all attachment points of a rod about its axis, + by the right hand about z, towards the odd
    cap. ends: as in CentreOfMass."""

    rod: int
    ends: tuple[int, ...]

    affine: ClassVar[bool] = False

    @property
    def touches(self) -> frozenset[Place]:
        """The phase of this rod."""
        return frozenset({("attachment phase", self.rod)})

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """Points turned about z."""
        import torch

        del own
        points = theta.p_BS.flatten(1, 2)
        here = torch.zeros(points.shape[1], 1, dtype=torch.bool, device=points.device)
        here[list(self.ends)] = True
        x, y, z = points.unbind(-1)
        c, s = torch.cos(value), torch.sin(value)
        x, y = c * x - s * y, s * x + c * y
        turned = torch.stack([x, y, z.expand_as(x)], dim=-1)
        return replace(theta, p_BS=torch.where(here, turned, points).unflatten(1, theta.p_BS.shape[1:3]))


@dataclass(frozen=True)
class Slope:
    """Rotation [rad] of the ground about the world's axis 0 (x) or 1 (y), as effects/ground_slope: gravity leans
    against the ground. Of both, y is applied first."""

    axis: int

    affine: ClassVar[bool] = False

    @property
    def touches(self) -> frozenset[Place]:
        """The lean of gravity about this axis."""
        return frozenset({("gravity", self.axis)})

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """Gravity as the ground's frame sees it."""
        import torch

        del own
        gx, gy, gz = theta.gravity.split(1, dim=-1)
        c, s = torch.cos(value), torch.sin(value)
        if self.axis == 1:
            gx, gz = c * gx - s * gz, s * gx + c * gz
        else:
            gy, gz = c * gy + s * gz, c * gz - s * gy
        # Of both angles one may be given, a batch of 1, where the other is free.
        return replace(theta, gravity=torch.cat(torch.broadcast_tensors(gx, gy, gz), dim=-1))


@dataclass(frozen=True)
class Outside:
    """A number that the engine's step does not read: `of` the controller (pid) or what is observed (observation).

    added: name of the effect's number that comes on top of what `key` has; "": the number is `key` itself.
    """

    of: str
    key: str
    added: str = ""

    affine: ClassVar[bool] = True

    @property
    def touches(self) -> frozenset[Place]:
        """The number."""
        return frozenset({(self.added or f"{self.of}.{self.key}", 0)})

    def apply(self, theta: Parameters, own: Parameters, value: Tensor) -> Parameters:
        """Nothing."""
        del own, value
        return theta


def _field(theta: Parameters, name: str) -> Tensor:
    """A field of Parameters, flattened, (B, n)."""
    return (theta.extra[name] if "." in name else getattr(theta, name)).flatten(1)


def _placed(theta: Parameters, places: tuple[Place, ...], made: _Made) -> Parameters:
    """`theta` with made(field) (B, n) at the places, field by field."""
    import torch

    changed = {}
    for field in dict(places):
        before = theta.extra[field] if "." in field else getattr(theta, field)
        here = torch.zeros(before[0].numel(), dtype=torch.bool, device=before.device)
        here[[k for name, k in places if name == field]] = True
        changed[field] = torch.where(here, made(field), before.flatten(1)).unflatten(1, before.shape[1:])
    return theta.with_values(changed)


class _Made(Protocol):
    def __call__(self, field: str, /) -> Tensor: ...
