"""The numbers of a robot and its ground as the step reads them: named tensors, batch first.

Made from `robot.toml` by `r2s2r_cli.stages.model`; whoever identifies parameters writes a torch function that makes
this from them, and differentiates through it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property

import torch
from torch import Tensor

from r2s2r_cli.engine.batch import common_batch
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.structure import Structure


@dataclass(frozen=True)
class Parameters:
    """Numbers of one robot, or of a batch of them: every shape has a leading batch axis B or 1.

    The body frame B of a rod has the axes of its frame R and its origin at the centre of mass.
    """

    mass: Tensor
    """Of each rod [kg], (B, rod)."""
    inertia: Tensor
    """About the centre of mass [kg m^2], frame B, (B, rod, 3, 3)."""
    p_BE: Tensor
    """Cap centres [m], frame B, (B, rod, 2, 3)."""
    cap_radius: Tensor
    """[m], (B, rod, 2)."""
    rod_radius: Tensor
    """Of the shaft between the caps [m], (B, rod)."""
    friction: Tensor
    """Coulomb coefficient of each cap on the ground [1], (B, rod, 2)."""
    restitution: Tensor
    """Coefficient of restitution of ground and rod impacts [1], (B, 1)."""
    impact_speed: Tensor
    """Restitution sets in here and is whole at twice this speed [m/s], (B, 1); keeps a resting robot from hopping."""
    rod_friction: Tensor
    """Coulomb coefficient between rods [1], (B, 1)."""
    p_BS: Tensor
    """Attachment points of the two ends of each cable [m], frames B of their rods, (B, cable, 2, 3)."""
    stiffness: Tensor
    """[N/m], (B, cable)."""
    stiffness2: Tensor
    """[N/m^2], (B, cable); read where Structure.cubic."""
    stiffness3: Tensor
    """[N/m^3], (B, cable); read where Structure.cubic."""
    damping: Tensor
    """[N s/m], (B, cable); acts while the cable is taut, and never makes it push."""
    rest: Tensor
    """Rest length of the passive cables between their attachment points [m], (B, passive)."""
    tendon_stiffness: Tensor
    """Of the sensor tendon beside each cable [N/m], (B, cable); read where Structure.tendons."""
    tendon_rest: Tensor
    """Rest length of the sensor tendon between the attachment points [m], (B, cable)."""
    speed_in: Tensor
    """Winding rate at command +1, no load [m/s], (B, actuated)."""
    speed_out: Tensor
    """Unwinding rate at command -1, no load [m/s], (B, actuated)."""
    rest_min: Tensor
    """A winch winds no further than this rest length [m], (B, actuated)."""
    rest_max: Tensor
    """A winch pays out no more than this rest length [m], (B, actuated)."""
    lag: Tensor
    """Time constant of the winches [s], (B, actuated); read where Structure.lag."""
    droop: Tensor
    """Relative loss of winding speed per tension [1/N], (B, actuated); read where Structure.droop."""
    gravity: Tensor
    """Acceleration [m/s^2], frame G, (B, 3)."""
    extra: Mapping[str, Tensor] = field(default_factory=dict)
    """Parameters of effects, `effect.parameter` -> (B, n)."""

    def of(self, effect: str) -> dict[str, Tensor]:
        """The own parameters of one effect by their short names."""
        return dict(self._own.get(effect, {}))

    @cached_property
    def _own(self) -> dict[str, dict[str, Tensor]]:
        """The parameters of effects by effect and short name: asked for by every hook of every effect."""
        found: dict[str, dict[str, Tensor]] = {}
        for name, tensor in self.extra.items():
            effect, _, own = name.partition(".")
            found.setdefault(effect, {})[own] = tensor
        return found

    def map(self, function: Callable[[Tensor], Tensor]) -> Parameters:
        """The same with `function` applied to every tensor."""
        named = {f.name: function(getattr(self, f.name)) for f in fields(self) if f.name != "extra"}
        return Parameters(**named, extra={name: function(value) for name, value in self.extra.items()})

    def with_values(self, values: Mapping[str, Tensor]) -> Parameters:
        """The same with fields or effect parameters (`motor_lag.tau_s`) replaced; tensors with a batch axis."""
        own = {name: value for name, value in values.items() if "." not in name}
        return replace(self, **own, extra={**self.extra, **{k: v for k, v in values.items() if "." in k}})


def shapes(structure: Structure) -> dict[str, tuple[int, ...]]:
    """Shape of every field of Parameters without the batch axis, effect parameters included."""
    rods, cables, winches = structure.n_rods, structure.n_cables, structure.n_actuated
    named: dict[str, tuple[int, ...]] = {
        "mass": (rods,), "inertia": (rods, 3, 3), "p_BE": (rods, 2, 3), "cap_radius": (rods, 2), "rod_radius": (rods,),
        "friction": (rods, 2), "restitution": (1,), "impact_speed": (1,), "rod_friction": (1,),
        "p_BS": (cables, 2, 3), "stiffness": (cables,), "stiffness2": (cables,), "stiffness3": (cables,),
        "damping": (cables,), "rest": (cables - winches,), "tendon_stiffness": (cables,), "tendon_rest": (cables,),
        "speed_in": (winches,), "speed_out": (winches,), "rest_min": (winches,), "rest_max": (winches,),
        "lag": (winches,), "droop": (winches,), "gravity": (3,),
    }  # fmt: skip
    for effect in structure.effects:
        named.update({f"{effect.name}.{key}": (n,) for key, n in effect.sizes(structure).items()})
    return named


def value(theta: Parameters, name: str) -> Tensor:
    """A field by its name in `shapes`."""
    return theta.extra[name] if "." in name else getattr(theta, name)


def check_parameters(structure: Structure, theta: Parameters) -> None:
    """Raises EngineInputError for a number that no robot has, or a wrong shape; names the field."""
    for name, shape in shapes(structure).items():
        if "." in name and name not in theta.extra:
            raise EngineInputError(
                name, "a parameter of an effect is missing", expected=f"(B, {shape[0]})", received="none"
            )
        tensor = value(theta, name)
        if tuple(tensor.shape[1:]) != shape or tensor.ndim != len(shape) + 1:
            raise EngineInputError(
                name,
                "wrong shape",
                expected="(B, " + ", ".join(map(str, shape)) + ")",
                received=str(tuple(tensor.shape)),
            )
        if not torch.isfinite(tensor).all():
            bad = ~torch.isfinite(tensor)
            raise EngineInputError(name, "not a finite number", expected="finite numbers", received=_where(tensor, bad))
    for name in ("mass", "cap_radius", "stiffness", "impact_speed"):
        _require(theta, name, "above 0", getattr(theta, name) > 0)
    for name in ("rod_radius", "friction", "restitution", "rod_friction", "damping", "tendon_stiffness", "speed_in",
                 "speed_out", "rest", "lag", "droop"):  # fmt: skip
        _require(theta, name, "at least 0", getattr(theta, name) >= 0)
    if structure.axial:
        _require_axial(theta)
    _require(theta, "restitution", "0 to 1", theta.restitution <= 1)
    common_batch({"rest_min": theta.rest_min, "rest_max": theta.rest_max})
    _require(theta, "rest_min", "at most rest_max", theta.rest_min <= theta.rest_max)
    length = torch.linalg.vector_norm(theta.p_BE[..., 1, :] - theta.p_BE[..., 0, :], dim=-1)
    if not bool((length > 0).all()):
        raise EngineInputError(
            "p_BE", "a rod of zero length", expected="two different caps", received=_where(length, length <= 0)
        )
    diagonal = torch.linalg.eigvalsh(theta.inertia)
    if not bool((diagonal > 0).all()):
        raise EngineInputError(
            "inertia", "not an inertia", expected="positive definite", received=_where(diagonal, diagonal <= 0)
        )


def _require(theta: Parameters, name: str, rule: str, good: Tensor) -> None:
    if not bool(good.all()):
        tensor = getattr(theta, name).expand_as(good)  # compared with a field of a larger batch it is shared
        index = tuple(int(i) for i in torch.nonzero(~good)[0])
        raise EngineInputError(
            f"{name}.{'.'.join(map(str, index[1:]))}",
            "out of its range",
            expected=rule,
            received=f"{float(tensor[index]):g}",
        )


def _require_axial(theta: Parameters) -> None:
    """Structure.axial leaves out what a body of revolution has not: it must not be there."""
    diagonal = torch.diagonal(theta.inertia, dim1=-2, dim2=-1)
    slack = 1e-9 * diagonal.amax()
    off = (theta.inertia - torch.diag_embed(diagonal)).abs().amax()
    if bool(off > slack) or bool((diagonal[..., 0] - diagonal[..., 1]).abs().amax() > slack):
        raise EngineInputError(
            "inertia", "not that of a body of revolution",
            expected="diag(transverse, transverse, axial), or Structure(axial=False)", received="another",
        )  # fmt: skip
    if bool(theta.p_BE[..., :2].abs().amax() > 1e-12):
        raise EngineInputError("p_BE", "caps off the rod's axis", expected="x = y = 0, or Structure(axial=False)",
                               received=f"{float(theta.p_BE[..., :2].abs().amax()):g} m off it")  # fmt: skip


def _where(tensor: Tensor, bad: Tensor) -> str:
    """The first number that is bad, and its place without the batch axis."""
    index = tuple(int(i) for i in torch.nonzero(bad)[0])
    return f"{float(tensor[index]):g} at {index[1:]}"
