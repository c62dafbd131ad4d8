"""Channel probes: free numbers where an effect of each channel would act, in one simulator with exact derivatives.

No law says how large they are: they are constant over a target interval, and 0 is the nominal simulator bit by bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.engine.hooks import CableTerms, ContactTerms, Hooks, MotorTerms, Values, WorldTerms
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.structure import Structure
from r2s2r_cli.stages.diagnose.which.numbers import NUMERICS, Model
from r2s2r_cli.stages.identify.free.mapping import Observation

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.stages.identified import Identified


class Probe(Hooks):
    """All probes of the engine.

    rate: winding rate of every winch, relative; force: of every cable while it is taut [N]; grip: friction of every
    cap, relative; height: radius of every cap [m]; push: force on every rod along x and y [N]; weight: of every rod
    [N], and lever: weight times its place along the rod [N m].
    """

    name = "probe"

    def __repr__(self) -> str:
        return "Probe()"

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(repr(self))

    def sizes(self, structure: Structure) -> Mapping[str, int]:
        """Every probe and how many numbers it has."""
        rods = structure.n_rods
        return {
            "rate": structure.n_actuated, "force": structure.n_cables, "grip": 2 * rods, "height": 2 * rods,
            "push": 2 * rods, "weight": rods, "lever": rods,
        }  # fmt: skip

    def off(self, structure: Structure) -> Mapping[str, float]:
        """All 0."""
        return dict.fromkeys(self.sizes(structure), 0.0)

    def parameters(self, x: Values, theta: Parameters) -> Parameters:
        """Radii of the caps."""
        return replace(theta, cap_radius=theta.cap_radius + x["height"].unflatten(-1, (-1, 2)))

    def motor(self, x: Values, z: Values, rate: Tensor, terms: MotorTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Winding rates."""
        del terms, h
        return rate * (1.0 + x["rate"]), z

    def cable(self, x: Values, z: Values, terms: CableTerms, h: Tensor) -> tuple[Tensor, Values]:
        """Forces of taut cables; a cable never pushes."""
        del h
        return (terms.force + x["force"]).relu().where(terms.stretch > 0, terms.force), z

    def contact(self, x: Values, terms: ContactTerms, friction: Tensor) -> Tensor:
        """Friction of every cap."""
        del terms
        return friction * (1.0 + x["grip"].unflatten(-1, (-1, 2))).relu()

    def world(self, x: Values, terms: WorldTerms, force: Tensor, torque: Tensor) -> tuple[Tensor, Tensor]:
        """Pushes along the ground; weights, and where along the rod they hang."""
        import torch

        push = x["push"].unflatten(-1, (-1, 2))
        down = -x["weight"]
        added = torch.cat([push, down[..., None]], dim=-1)
        # In rod axes the weight at s along z gives s z x R' (0, 0, -1), and the last is minus the third row of R.
        third = terms.R_GR[..., 2, :]
        lever = x["lever"][..., None]
        turned = torch.stack([third[..., 1], -third[..., 0], torch.zeros_like(third[..., 0])], dim=-1)
        return force + added, torque + lever * turned


@dataclass(frozen=True)
class Kind:
    """A probe. channel: of the design. kind: of its elements. unit. scale: sd of its prior; of cables of those with a
    winch, and without."""

    channel: str
    kind: str
    unit: str
    scale: float


KINDS = {
    "rate": Kind("motor", "motor", "1", 0.1), "force": Kind("cable", "cable", "N", 0.6),
    "grip": Kind("contact", "cap", "1", 0.3), "height": Kind("contact", "cap", "m", 2e-3),
    "push": Kind("world", "rod", "N", 0.1), "weight": Kind("mass", "rod", "N", 0.3),
    "lever": Kind("mass", "rod", "N m", 0.02), "delay": Kind("command", "motor", "s", 0.08),
    "bias": Kind("sensing", "sensor", "m", 5e-3), "scale": Kind("observation", "camera", "1", 0.02),
    "late": Kind("observation", "camera", "s", 0.06),
}  # fmt: skip
WINCHED_N = 5.0
"""[N] The same for a winched cable, which is twenty times as stiff."""


class ProbeModel:
    """The refit nominal simulator with probes: stands where a `Mapping` does. values (n,): of the probes, 0 the
    nominal.

    names: `rate.3`, elements as the engine counts them. Those nuisances that are effects stay plugged in.
    """

    def __init__(self, nominal: Identified, model: Model, values: np.ndarray) -> None:
        """values: of the model, at which the probes are 0."""
        from r2s2r_cli.effects import CATALOGUE

        given = {effect.name for effect in nominal.structure.effects}
        numerics = [e for e in CATALOGUE if e.name in NUMERICS and e.name not in given and e in model.effects]
        probe = Probe()
        self.robot = model.robot
        self.structure: Structure = nominal.structure.with_effects(*numerics, probe)
        whole = model.theta(values)
        kept = tuple(f"{effect.name}." for effect in self.structure.effects)
        self._sizes = probe.sizes(self.structure)
        zero = {f"probe.{name}": whole.mass.new_zeros(1, n) for name, n in self._sizes.items()}
        own = {name: value for name, value in whole.extra.items() if name.startswith(kept)}
        self._base = replace(whole, extra={**own, **zero})
        self._observation: Observation = model.observation(values)
        self.names = tuple(f"{name}.{k}" for name, n in self._sizes.items() for k in range(n))
        self.frees = ()
        self.delays = ()

    def theta(self, values: np.ndarray | Tensor) -> Parameters:
        """Parameters at values (n,) or (B, n)."""
        import torch

        x = torch.as_tensor(values, dtype=torch.float64)
        x = x if x.ndim == 2 else x[None]
        parts = torch.split(x, list(self._sizes.values()), dim=-1)
        return self._base.with_values({f"probe.{name}": part for name, part in zip(self._sizes, parts, strict=True)})

    def packed(self, values: np.ndarray | Tensor) -> Tensor:
        """The flat parameter vector, (NP,) of values (n,), (B, NP) of (B, n)."""
        from r2s2r_cli.engine.flat import pack_parameters

        flat = pack_parameters(self.structure, self.theta(values))
        return flat if values.ndim == 2 else flat[0]

    def jacobian(self, values: np.ndarray | Tensor) -> Tensor:
        """Derivatives d packed / d values, (NP, n): every probe is a number of its own."""
        import torch

        from r2s2r_cli.engine.flat import parameter_slots

        slots = parameter_slots(self.structure)
        first = min(slot.start for name, slot in slots.items() if name.startswith("probe."))
        count = len(self.names)
        whole = torch.zeros(len(self.packed(values)), count, dtype=torch.float64)
        whole[first : first + count] = torch.eye(count, dtype=torch.float64)
        return whole

    def observation(self, values: object = None) -> Observation:
        """What lies between the simulated robot and the log, as refit."""
        del values
        return self._observation
