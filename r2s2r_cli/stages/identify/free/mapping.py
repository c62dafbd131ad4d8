"""Values of free numbers -> what the engine reads, with exact derivatives; and what lies outside the engine."""

from __future__ import annotations

import collections.abc
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.free.actions import Outside, Place
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.free.catalogue import entries, require_effects, unknown
from r2s2r_cli.stages.identify.free.entry import Entry
from schemas.robot import Robot

if TYPE_CHECKING:
    import numpy as np
    import torch
    from torch import Tensor

    from r2s2r_cli.engine import LatchedPid, Parameters, Structure

    Vector = np.ndarray | Tensor


@dataclass(frozen=True)
class Observation:
    """Between the simulated robot and the log. ground_height [m]: an observed cap lies so much over the simulated one.
    command_delay [s]: a logged command reaches the winch so much later. camera_delay [s]: a frame stamped t shows the
    robot at t - camera_delay."""

    ground_height: float = 0.0
    command_delay: float = 0.0
    camera_delay: float = 0.0


class Mapping:
    """Free numbers of one robot at work: values x (n,) in the order of `frees` -> Parameters of `structure`.

    structure: laws that a free or fixed number needs are switched on, and its effects plugged in beside those named
    in `effects`. names: of the free numbers. in_engine: (n,) bool, whether the engine reads it; others are in
    `observation` or `pid`. delays: places of those that shift commands or frames in time. Numbers that are neither free
    nor fixed keep what robot.toml has, effects their off values; the winches' ends (`rest_min`, `rest_max`) always do.
    """

    def __init__(
        self, robot: Robot, frees: collections.abc.Sequence[Free], effects: tuple[str, ...] = (), *,
        fixed: collections.abc.Mapping[str, float] | None = None, structure: Structure | None = None,
    ) -> None:  # fmt: skip
        """fixed: values that are given, by name; a free number may be a part of a fixed one (fixed motor_speed, free
        motor_speed.2), then it wins there. structure: of the robot, if another than structure_of(robot).

        Raises UsageError for unknown names, for numbers that contradict each other and for a fixed value out of its
        bounds, InputError for a robot that cannot be simulated.
        """
        from r2s2r_cli.effects import with_off_values
        from r2s2r_cli.stages.effects import all_effects
        from r2s2r_cli.stages.model import parameters_of, structure_of

        require_effects(effects)
        known = entries(robot)
        self.robot = robot
        self.frees = tuple(frees)
        self.names = tuple(free.name for free in frees)
        self.fixed = dict(fixed or {})
        for name in (*self.names, *self.fixed):
            if name not in known:
                raise unknown(name, tuple(known), "--fix" if name in self.fixed else "--free")
        self._entries = tuple(known[name] for name in self.names)
        given = [known[name] for name in self.fixed]
        require_apart(self._entries)
        require_apart(given, "--fix")
        self._require_fixed(given)
        used = [*self._entries, *given]
        base = structure or structure_of(robot)
        wanted = {*effects, *(entry.effect for entry in used)} - {effect.name for effect in base.effects}
        laws = {entry.law for entry in used}
        base = replace(base, lag=base.lag or "lag" in laws, droop=base.droop or "droop" in laws)
        self.structure: Structure = base.with_effects(*(effect for effect in all_effects() if effect.name in wanted))
        self._own = with_off_values(self.structure, parameters_of(robot))
        # The catalogue has the whole before its parts, so that what is set last is the more special one.
        self._order = sorted((*self.names, *self.fixed), key=list(known).index)
        self._actions = {entry.free.name: entry.action for entry in used}
        self._curved = tuple(k for k, entry in enumerate(self._entries) if not entry.action.affine)
        self._constant: dict[tuple[torch.dtype, torch.device], Tensor] = {}
        self._given_outside = [
            (entry.action, self.fixed[entry.free.name]) for entry in given if isinstance(entry.action, Outside)
        ]
        self.delays = tuple(
            k for k, entry in enumerate(self._entries)
            if isinstance(entry.action, Outside) and entry.action.key in ("command_delay", "camera_delay")
        )  # fmt: skip
        self.in_engine = tuple(not isinstance(entry.action, Outside) for entry in self._entries)

    def starting(self, frees: collections.abc.Sequence[Free]) -> Mapping:
        """The same with other starts and priors of its free numbers."""
        other = copy(self)
        other.frees = tuple(frees)
        return other

    def theta(self, values: Vector) -> Parameters:
        """Parameters at values (n,) or (B, n): batch 1 or B. Differentiable by the values."""
        import torch

        x = torch.as_tensor(values, dtype=None if isinstance(values, torch.Tensor) else torch.float64)
        x = x if x.ndim == 2 else x[None]
        own = self._own.map(lambda one: one.to(x.device, x.dtype))
        theta = own
        for name in self._order:
            if name in self.fixed:
                value = x.new_full((1, 1), self.fixed[name])
            else:
                k = self.names.index(name)
                value = x[:, k : k + 1]
            theta = self._actions[name].apply(theta, own, value)
        return theta

    def packed(self, values: Vector) -> Tensor:
        """The flat parameter vector, (NP,) of values (n,) or (B, NP) of (B, n); differentiable."""
        from r2s2r_cli.engine.flat import pack_parameters

        flat = pack_parameters(self.structure, self.theta(values))
        return flat if values.ndim == 2 else flat[0]

    def jacobian(self, values: Vector) -> Tensor:
        """Derivatives d packed / d values, (NP, n), at values (n,); columns of numbers outside the engine are 0.

        Columns of affine numbers are computed once (see Action.affine). The others are angles, of which everything is
        A + B cos x + C sin x: there (f(x + pi/2) - f(x - pi/2)) / 2 is the derivative, exactly.
        """
        import torch

        x = torch.as_tensor(values).detach()
        key = (x.dtype, x.device)
        if key not in self._constant:
            none = x.new_zeros(len(self.packed(x)), 0)
            self._constant[key] = torch.func.jacfwd(self.packed)(x) if len(x) else none
        jacobian = self._constant[key].clone()
        if self._curved:
            turns = torch.eye(len(x), dtype=x.dtype, device=x.device)[list(self._curved)] * (torch.pi / 2)
            after, before = self.packed(torch.cat([x + turns, x - turns])).chunk(2)
            jacobian[:, list(self._curved)] = ((after - before) / 2).T
        return jacobian

    def observation(self, values: Vector) -> Observation:
        """What lies between the simulated robot and the log, of values (n,)."""
        return Observation(**{key: float(value) for key, value in self._outside("observation", values).items()})

    def pid(self, values: Vector) -> LatchedPid:
        """The low-level controller, of values (n,) or (B, n); free gains are tensors (B, 1), differentiable."""
        import torch

        from r2s2r_cli.engine import LatchedPid

        pid = self.robot.pid
        x = torch.as_tensor(values)
        gains: dict[str, Any] = {
            "p": pid.p, "i": pid.i, "d": pid.d, "tolerance": pid.tolerance, "min_length": pid.min_length_m,
            "range": pid.range_m,
        }  # fmt: skip
        gains.update(self._outside("pid", x if x.ndim == 2 else x[None]))
        return LatchedPid(
            **gains, period=1.0 / pid.rate_hz, cable_caps=tuple(cable.caps for cable in self.robot.cables),
            actuated=self.robot.actuated,
        )  # fmt: skip

    def _outside(self, of: str, values: Vector) -> dict[str, Any]:
        """Fixed and free numbers outside the engine, by key; of values (B, n) tensors (B, 1)."""
        numbers: list[tuple[Outside, Any]] = [*self._given_outside]
        for k, entry in enumerate(self._entries):
            if isinstance(entry.action, Outside):
                numbers.append((entry.action, values[:, k : k + 1] if values.ndim == 2 else values[k]))
        found: dict[str, Any] = {}
        for action, value in sorted(numbers, key=lambda one: bool(one[0].added)):
            if action.of == of:
                found[action.key] = found.get(action.key, 0.0) + value if action.added else value
        return found

    def _require_fixed(self, given: list[Entry]) -> None:
        """Fixed numbers are within their bounds, and no free number undoes one."""
        for entry in given:
            free, value = entry.free, self.fixed[entry.free.name]
            unit = "" if free.unit == "1" else f" {free.unit}"
            if not free.lower <= value <= free.upper:
                raise UsageError(
                    f"the fixed {free.name} is out of its bounds", where="--fix",
                    expected=f"{free.lower:g} to {free.upper:g}{unit}", received=f"{value:g}",
                    hint=f"--fix {free.name}={entry.nominal:g}",
                )  # fmt: skip
            for other in self._entries:
                both = entry.action.touches & other.action.touches
                if both and not other.action.touches < entry.action.touches:
                    raise UsageError(
                        f"{other.free.name} is free and {free.name} is fixed: they set the same number",
                        where="--free, --fix", expected="one of them", received=f"{other.free.name}, {free.name}",
                        hint=f"r2s2r identify --fix {free.name}={value:g}",
                    )  # fmt: skip


def require_apart(chosen: collections.abc.Sequence[Entry], option: str = "--free") -> None:
    """Raises UsageError where two free numbers set the same (motor_speed and motor_speed.2), or are alike (see Entry);
    of fixed ones, where two set the same."""
    owner: dict[Place, str] = {}
    for entry in chosen:
        name = entry.free.name
        for place in sorted(entry.action.touches | (entry.alike if option == "--free" else frozenset())):
            before = owner.setdefault(place, name)
            if before != name:
                raise UsageError(
                    f"{before} and {name} set the same number", where=option, expected="one of them",
                    received=f"{before}, {name}", hint=f"r2s2r identify {option} {name}",
                )  # fmt: skip
