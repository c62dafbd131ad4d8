"""The numbers of a diagnosis: nuisances that are always fitted again, and those of every effect; the engine reads them.

One simulator has all effects of the catalogue plugged in, so that one machine code serves every hypothesis. At its off
value an effect is not there, to the last bit.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.effects import effects_looked_for
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.free.mapping import Mapping, Observation

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters

NUMERICS = {
    "rolling_resistance": 0.6,
    "soft_ground": 0.3,
    "command_latency": 0.4,
    "motor_lag": 0.4,
    "load_droop": 0.3,
    "camera_delay": 0.3,
}
"""Effects that another engine, or the robot as it was built, has a little of: nuisances too, near their off values. By
effect, how far from off that puts them, in the scale of their numbers."""
FARTHEST = 3.0
"""Prior sd from off to which such a nuisance goes."""
MOST = 1.0
"""Of a logarithm: no nuisance that is a factor leaves e^-1 .. e^1."""
SENSOR_LAG = "sensor_lag"
MOST_LATE = 0.12
"""[s] Of a sensor."""


@dataclass(frozen=True)
class Number:
    """One number. kind: `factor`, the field times exp(x), `shift`, the field plus x within 0..1, `own`, of an effect,
    or `reading`, of what reads the simulated robot, which the engine does not know. field: of Parameters; index: which
    of its numbers, () for all. off: where it changes nothing. sd: of its prior as a nuisance, from what the nominal
    model has; scale: of an effect's number, how far from off it usually is; tried: other values of it to look at;
    only_shape: whether it only says where or how, and nothing while others of its effect are off."""

    name: str
    unit: str
    kind: str
    field: str
    index: tuple[int, ...]
    off: float
    lower: float
    upper: float
    sd: float
    scale: float
    what: str
    tried: tuple[float, ...] = ()
    only_shape: bool = False

    @property
    def within(self) -> tuple[float, float]:
        """Bounds as a nuisance: an effect's number stays near off, where an engine's numerics may put it."""
        if self.kind != "own":
            return self.lower, self.upper
        return max(self.lower, self.off - FARTHEST * self.sd), min(self.upper, self.off + FARTHEST * self.sd)


NUISANCES = (
    Number("friction", "log", "factor", "friction", (), 0.0, -MOST, MOST, 0.3, 0.3, "friction of all caps"),
    Number("motor_speed_in", "log", "factor", "speed_in", (), 0.0, -MOST, MOST, 0.15, 0.15, "speed of all winches in"),
    Number("motor_speed_out", "log", "factor", "speed_out", (), 0.0, -MOST, MOST, 0.15, 0.15,
           "speed of all winches out"),
    Number("restitution", "1", "shift", "restitution", (), 0.0, -1.0, 1.0, 0.1, 0.1, "restitution"),
    Number("stiffness", "log", "factor", "stiffness", (), 0.0, -MOST, MOST, 0.15, 0.15, "stiffness of all cables"),
    Number(SENSOR_LAG, "s", "reading", "", (), 0.0, -MOST_LATE, MOST_LATE, 0.04, 0.04, "delay of all length sensors"),
)  # fmt: skip
"""Of the robot, fitted again in every hypothesis alike. `stiffness` stands for how an engine pulls its cables taut; the
lag for filters, converters and half a control tick, which are in no log: 40 ms are 2 to 3 mm on every ramp."""


class Model:
    """The nominal simulator with all effects at hand: values (n,) or (k, n) of `numbers` -> Parameters.

    It stands where a `Mapping` does (predict.py, start.py). nuisances: places of those that are always fitted;
    values0 (n,): the nominal simulator.
    """

    def __init__(self, nominal: Identified, effects: Sequence[str] | None = None, asked: Collection[str] = ()) -> None:
        """effects: those plugged in, by default the whole catalogue, what installed packages bring and what is `asked`
        for by id. Raises InputError as `Mapping`, and for a package whose effect is none."""
        own = nominal.mapping
        self.robot = nominal.robot
        at_hand = effects_looked_for(asked if effects is None else effects)
        self.effects = tuple(effect for effect in at_hand if effects is None or effect.name in effects)
        names = tuple(effect.name for effect in self.effects)
        self._nominal, self._values = own, nominal.values
        self._mapping = Mapping(own.robot, own.frees, names, fixed=own.fixed, structure=own.structure)
        self.structure = self._mapping.structure
        self._base = self._mapping.theta(nominal.values)
        numbers = list(NUISANCES)
        for effect in self.effects:
            for one in effect.own:
                count = one.count(self.structure)
                for i in range(count):
                    label = "" if one.per == "robot" else f".{self._label(one.per, i)}"
                    numerics = NUMERICS.get(effect.name, 0.0) * one.scale
                    numbers.append(
                        Number(f"{effect.name}.{one.name}{label}", one.unit, "own", f"{effect.name}.{one.name}", (i,),
                               one.off, one.lower, one.upper, numerics, one.scale, one.what, one.tried, one.only_shape)
                    )  # fmt: skip
        self.numbers = tuple(numbers)
        self.names = tuple(number.name for number in numbers)
        self.place = {name: k for k, name in enumerate(self.names)}
        given = {number.field: self._base.extra[number.field] for number in numbers if number.kind == "own"}
        self.values0 = np.array([float(given[n.field][0, n.index[0]]) if n.kind == "own" else n.off for n in numbers])
        self.nuisances = tuple(
            k for k, n in enumerate(numbers)
            if n.kind != "own" or (n.sd > 0 and self.values0[k] == n.off)
        )  # fmt: skip
        self.frees = tuple(
            Free(n.name, n.unit, float(v), n.lower, n.upper, Coordinate.LINEAR, n.sd or n.scale, n.what)
            for n, v in zip(numbers, self.values0, strict=True)
        )

    def theta(self, values: np.ndarray | Tensor) -> Parameters:
        """Parameters at values (n,) or (k, n): batch 1 or k; differentiable."""
        import torch

        x = torch.as_tensor(values, dtype=torch.float64) if not isinstance(values, torch.Tensor) else values
        x = x if x.ndim == 2 else x[None]
        named: dict[str, Tensor] = {}
        own_numbers: dict[str, list[Tensor]] = {}
        for k, number in enumerate(self.numbers):
            value = x[:, k : k + 1]
            if number.kind == "own":
                own_numbers.setdefault(number.field, []).append(value)
                continue
            if number.kind == "reading":
                continue
            own = getattr(self._base, number.field)
            by = value.reshape(-1, *[1] * (own.ndim - 1))
            named[number.field] = own * by.exp() if number.kind == "factor" else (own + by).clamp(0.0, 1.0)
        return self._base.with_values({**named, **{name: torch.cat(one, dim=1) for name, one in own_numbers.items()}})

    def packed(self, values: np.ndarray | Tensor) -> Tensor:
        """The flat parameter vector, (NP,) of values (n,), (k, NP) of (k, n)."""
        from r2s2r_cli.engine.flat import pack_parameters

        flat = pack_parameters(self.structure, self.theta(values))
        return flat if values.ndim == 2 else flat[0]

    def jacobian(self, values: np.ndarray | Tensor) -> Tensor:
        """D packed / d values, (NP, n), at values (n,)."""
        import torch

        return torch.func.jacfwd(self.packed)(torch.as_tensor(values, dtype=torch.float64).detach())

    def observation(self, values: np.ndarray | Tensor | None = None) -> Observation:
        """What lies between the simulated robot and the log: as identified, and later by an effect's delay."""
        from r2s2r_cli.engine import delay_of

        own = self._nominal.observation(self._values)
        late = None if values is None else delay_of(self.structure, self.theta(values))
        return own if late is None else replace(own, command_delay=own.command_delay + float(late[0, 0]))

    def pid(self, values: object = None) -> object:
        """The controller, as identified."""
        del values
        return self._nominal.pid(self._values)

    def sensor_lags(self, values: np.ndarray) -> np.ndarray:
        """By how much all length readings are late at values (k, n), (k,) [s]."""
        return np.asarray(values[:, self.place[SENSOR_LAG]])

    def off(self, effect: str) -> tuple[int, ...]:
        """Places of the numbers of an effect."""
        return tuple(k for k, number in enumerate(self.numbers) if number.field.split(".")[0] == effect)

    def _label(self, per: str, index: int) -> int:
        return self.robot.actuated[index] if per == "actuated" else index
