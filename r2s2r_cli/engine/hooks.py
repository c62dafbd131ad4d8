"""Where an effect can act: one method a channel, each the identity unless an effect says otherwise.

The step calls the hooks of `Structure.effects` in order. They are torch code on the same tensors, batch first, so that
the tracer compiles them with the rest; hooks that depend on parameters only are hoisted out of the loop. An effect at
its off value must return bitwise what it received.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING

from torch import Tensor

from r2s2r_cli.engine.state import cable_ends

if TYPE_CHECKING:
    from r2s2r_cli.engine.parameters import Parameters
    from r2s2r_cli.engine.structure import Structure

Values = Mapping[str, Tensor]
"""An effect's own parameters or states by name, each (B, n)."""


class Channel(StrEnum):
    """The channels of the design, section 5: hooks, probes and verdicts all use these words."""

    COMMAND = "command"
    MOTOR = "motor"
    CABLE = "cable"
    MASS = "mass"
    CONTACT = "contact"
    WORLD = "world"
    SENSING = "sensing"
    OBSERVATION = "observation"


@dataclass(frozen=True)
class CableTerms:
    """All cables at the start of a step. stretch: beyond the rest length [m], (B, cable); negative: slack.
    rate: of the length between the attachment points [m/s]. force: of the spring [N], 0 where slack. stiffness:
    of the spring where it is now, tangent [N/m]. passive: 1 where no winch winds it, else 0."""

    stretch: Tensor
    rate: Tensor
    force: Tensor
    stiffness: Tensor
    passive: Tensor


@dataclass(frozen=True)
class MotorTerms:
    """All winches at the start of a step, (B, actuated). u: command as it arrives, -1 to 1. tension [N]; rest: length
    of the winched cable [m]; wound: how much of it is on the spool, beyond that at its longest [m]."""

    u: Tensor
    tension: Tensor
    rest: Tensor
    wound: Tensor


@dataclass(frozen=True)
class MassTerms:
    """Of all rods. mass [kg], (B, rod); inertia about the centre of mass [kg m^2], (B, rod, 3, 3); centre: of mass,
    from the origin of frame B, where the nominal one lies [m], (B, rod, 3)."""

    mass: Tensor
    inertia: Tensor
    centre: Tensor


@dataclass(frozen=True)
class GroundTerms:
    """The surface below each cap, (B, rod, 2). sunk: how far it lies below the plane [m]; rising: its speed upwards if
    nothing loads it [m/s]; give: how much slower per normal impulse [1/kg]; creep: the same sideways, of a cap that
    friction holds. Given: p_GC, v_GC: ground point below each cap centre and its velocity, as the cap moves over the
    ground [m], [m/s], frame G, (B, rod, 2, 3); mobility: of the cap's lowest point, along each axis of G by an impulse
    along it [1/kg], same shape."""

    sunk: Tensor
    rising: Tensor
    give: Tensor
    creep: Tensor
    p_GC: Tensor
    v_GC: Tensor
    mobility: Tensor


@dataclass(frozen=True)
class ContactTerms:
    """All caps at the start of a step, frame G. p_GC: ground point below each cap centre [m], (B, rod, 2, 3);
    v_GC: velocity of the cap's lowest point [m/s], same shape; gap: its height [m], (B, rod, 2)."""

    p_GC: Tensor
    v_GC: Tensor
    gap: Tensor


@dataclass(frozen=True)
class WorldTerms:
    """All rods at the start of a step, frame G. p_GB, v_GB: centre of mass [m], [m/s], (B, rod, 3);
    R_GR: (B, rod, 3, 3); w_R: angular velocity in rod axes [rad/s], (B, rod, 3); v_GB and w_R with what gravity and
    cables add within the step, turning: w_R without. inverse_inertia: rod axes [1/(kg m^2)], (B, rod, 3, 3);
    inverse_mass: [1/kg], (B, rod, 1)."""

    p_GB: Tensor
    v_GB: Tensor
    R_GR: Tensor
    w_R: Tensor
    turning: Tensor
    inverse_inertia: Tensor
    inverse_mass: Tensor


def overrides(structure: Structure, hook: str) -> tuple[Hooks, ...]:
    """The effects of a structure that have a hook of their own, in order."""
    return tuple(effect for effect in structure.effects if getattr(type(effect), hook) is not getattr(Hooks, hook))


def effective(structure: Structure, theta: Parameters) -> Parameters:
    """The parameters that the step works with: those of the robot, changed by its effects. For whoever reads caps,
    forces or energy off a state; the step itself does the same and must be handed the parameters before."""
    for effect in overrides(structure, "parameters"):
        theta = effect.parameters(theta.of(effect.name), theta)
    for effect in overrides(structure, "tied"):
        points = effect.tied(theta.of(effect.name), theta, cable_ends(structure, theta.p_BS.device))
        theta = replace(theta, p_BS=points)
    return theta


class Hooks:
    """Base of everything that plugs into the step. `x`: own parameters, `z`: own states, `h`: step [s], (B, 1)."""

    name: str = ""

    def structure(self, structure: Structure) -> Structure:
        """Switch on the laws that this effect parametrises."""
        return structure

    def sizes(self, structure: Structure) -> Mapping[str, int]:
        """Own parameters and how many numbers each has."""
        del structure
        return {}

    def off(self, structure: Structure) -> Mapping[str, float]:
        """Off value of each own parameter: with these the effect is not there."""
        del structure
        return {}

    def state_sizes(self, structure: Structure) -> Mapping[str, int]:
        """Own states and how many numbers each has; they start at 0."""
        del structure
        return {}

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Every channel: change the numbers of the nominal laws. Machine code computes it once a rollout."""
        del x
        return theta

    def tied(self, x: Values, theta: Parameters, rods: Tensor) -> Tensor:
        """Channel cable: attachment points of both ends of each cable [m], frames B, (B, cable, 2, 3). rods: of these
        ends, (cable, 2), for indexing. Machine code computes it once a rollout."""
        del x, rods
        return theta.p_BS

    def mass(self, x: Values, terms: MassTerms) -> MassTerms:
        """Channel mass: mass, inertia and centre of mass of every rod. States stay those of the origin of frame B, so
        that no start moves with an effect. Structure.axial demands that the centre stays on the axis."""
        del x
        return terms

    def delay(self, x: Values) -> Tensor | None:
        """Channel command: time from a command to its arrival at the winches [s], (B, 1); None: no say in it. Acts on
        the commands of `Simulator.rollout` and of closed loops before the step sees them."""
        del x
        return None

    def command(self, x: Values, z: Values, u: Tensor, h: Tensor) -> tuple[Tensor, Values]:
        """Channel command: what the winches receive of the motor command u (B, actuated)."""
        del x, h
        return u, z

    def motor(self, x: Values, z: Values, rate: Tensor, terms: MotorTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Channel motor: winding rate [m/s], + shortens, (B, actuated)."""
        del x, terms, h
        return rate, z

    def rest(self, x: Values, rest: Tensor) -> Tensor:
        """Channel cable: rest length [m], (B, cable), of all cables from what they are without the effect."""
        del x
        return rest

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Channel cable: spring force [N], (B, cable), before damping. A slack cable has none, whatever is said here:
        what makes it taut belongs into `rest`."""
        del x, h
        return terms.force, z

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Channel contact: friction coefficient of each cap, (B, rod, 2)."""
        del x, terms
        return friction

    def surface(self, x: Values, z: Values, terms: GroundTerms, h: Tensor) -> GroundTerms:
        """Channel contact: a ground that gives way."""
        del x, z, h
        return terms

    def push(self, x: Values, z: Values, p_GC: Tensor, force: Tensor) -> Tensor:
        """Channel contact: level force of a ground that is not level on each cap centre [N], frame G, (B, rod, 2, 3);
        p_GC: ground point below it [m], same shape."""
        del x, z, p_GC
        return force

    def resist(self, x: Values, z: Values, terms: WorldTerms, torque: Tensor, h: Tensor) -> Tensor:
        """Channel contact: torque of the ground on each rod [N m], rod axes, (B, rod, 3)."""
        del x, z, terms, h
        return torque

    def landed(self, x: Values, z: Values, force: Tensor, h: Tensor) -> Values:
        """Channel contact: own states after the step, from the normal force on each cap within it [N], (B, rod, 2)."""
        del x, force, h
        return z

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """Channel world: force [N], frame G, and torque [N m], rod axes, on each rod, (B, rod, 3)."""
        del x, terms
        return force, torque

    def sensing(self, x: Values, length: Tensor, t: Tensor | float = 0.0) -> Tensor:
        """Channel sensing: cable lengths [m], (..., cable), as the sensors read them at time t [s] of the run, a number
        or (..., 1). The controller reads these, and these are recorded."""
        del x, t
        return length

    def observation(self, x: Values, t: Tensor, p_WE: Tensor) -> Tensor:
        """Channel observation: end caps [m], (B, frame, cap, 3), as the camera sees them at times t [s], (frame,); NaN:
        not seen."""
        del x, t
        return p_WE
