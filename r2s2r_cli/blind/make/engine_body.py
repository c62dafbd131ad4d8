"""Tier A: our own engine at half the diagnoser's step, effects in forms that are not the catalogue's.

Winches, their laws and those of the sensors are the rig's; what acts on bodies and contacts changes the engine's
numbers, once or every 20 ms. A check of the algorithm: who shares the engine with the world sees no foreign numerics.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from r2s2r_cli.blind.make.engine_numbers import REEL_M_PER_S, engine_numbers
from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.rig.effects.base import Law, Scene, overrides
from r2s2r_cli.rig.model.frames import rotation
from r2s2r_cli.rig.winches import Winches
from r2s2r_cli.rig.world import World
from schemas.robot import Robot

if TYPE_CHECKING:
    import torch

    from r2s2r_cli.engine import Parameters

STEP_S, HOLD = 5e-4, 2
"""Of the engine [s]; a winch turns every HOLD steps."""
SETTLE_S = 2.0
CREEP_S = (0.6, 5.0)
_WINCH_AND_SENSE = frozenset({
    "motor_dead_zone", "command_latency", "motor_lag", "motor_speed_mismatch", "battery_sag", "load_droop",
    "spool_buildup", "backlash", "sensor_bias", "sensor_gain",
})  # fmt: skip


class EngineBody:
    """A robot in the engine. See `Body`."""

    def __init__(self, robot: Robot, world: World, hidden: Hidden, gait: int) -> None:
        from r2s2r_cli.engine import Simulator
        from r2s2r_cli.stages.model import rest_state, structure_of

        self._robot, self._world, self._hidden = robot, world, hidden
        self._sim = _simulator(structure_of(robot), Simulator)
        self._theta = engine_numbers(robot, hidden, world)
        self._mu = self._theta.friction
        self._rest0 = self._theta.rest
        self.winches = Winches(robot)
        self._laws = self._working(hidden, gait)
        self.winches.use(self._laws)
        self._state = rest_state(robot)
        self._ends = np.array([cable.caps for cable in robot.cables])
        a = world.start.heading_rad
        self._R = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        self._p = np.array([*world.start.position_m, 0.0])
        self._creep = np.zeros((len(CREEP_S), self._rest0.shape[1]))
        self._t, self._done = 0.0, 0
        self.winches.rest = self.winches.acting = self._state.rest[0].numpy().copy()
        self._t = -SETTLE_S
        self._begin = self._t
        self.advance(SETTLE_S, np.zeros(len(robot.motors)))

    @property
    def t(self) -> float:
        """[s]"""
        return self._t

    def advance(self, dt: float, duty: np.ndarray) -> None:
        """Go on, in whole winch steps; what is left of one is made up for the next time."""
        self._t += dt
        wanted = int((self._t - self._begin) / (HOLD * STEP_S) + 1e-6)
        while self._done < wanted:
            count = min(wanted - self._done, 20)
            self._go(self._begin + self._done * HOLD * STEP_S, count, duty)
            self._done += count

    def caps(self) -> np.ndarray:
        """True end caps [m], (cap, 3)."""
        from r2s2r_cli.engine import end_caps

        return np.asarray(end_caps(self._theta, self._state)[0].numpy() @ self._R.T + self._p)

    def sensed(self) -> np.ndarray:
        """Cap distances through the laws of sensing [m], (cable,)."""
        p = self.caps()
        length = np.linalg.norm(p[self._ends[:, 1]] - p[self._ends[:, 0]], axis=-1)
        for law in self._laws:
            if overrides(law, "sense"):
                length = law.sense(self._t, length)
        return np.asarray(length)

    def keep(self) -> object:
        """The state now."""
        w = self.winches
        return self._state, w.rest.copy(), w.acting.copy(), w.angle.copy()

    def restore(self, state: Any) -> None:
        """Another one's state."""
        self._state, rest, acting, angle = state
        self.winches.rest, self.winches.acting, self.winches.angle = rest.copy(), acting.copy(), angle.copy()

    def push(self, velocity: np.ndarray, rate: np.ndarray, let_out: np.ndarray) -> None:
        """Add to the rods' velocities [m/s] and rates [rad/s], (rod, 3), and to the winches' rest lengths [m]."""
        import torch

        state = self._state
        self._state = replace(
            state, v_WB=state.v_WB + torch.as_tensor(velocity @ self._R).reshape(state.v_WB.shape),
            w_R=state.w_R + torch.as_tensor(rate).reshape(state.w_R.shape),
        )  # fmt: skip
        self.winches.rest, self.winches.acting = self.winches.rest + let_out, self.winches.acting + let_out

    def _working(self, hidden: Hidden, gait: int) -> tuple[Law, ...]:
        # These laws ask their scene for the winches' radii and for chance alone: there is no MuJoCo here.
        rng = np.random.default_rng([hidden.seed, 12])
        scene = Scene(self._robot, None, self.winches.r, rng)  # type: ignore[arg-type]
        found: list[Law] = []
        for name, effect in self._world.effects.present():
            if name in _WINCH_AND_SENSE:
                found.append(effect.law(scene))
        own = (hidden.healthy() if self._sways() else hidden).laws(scene, gait)
        return (*found, *own)

    def _sways(self) -> bool:
        return self._hidden.strange is not None and self._hidden.strange[0] == "gravity_sway"

    def _go(self, t: float, count: int, duty: np.ndarray) -> None:
        import torch

        theta = self._now(t)
        tension = self._tension(theta)
        dt = HOLD * STEP_S
        rest = self._state.rest[0].numpy()
        rows = np.empty((count, len(rest)))
        for k in range(count):
            wanted = self.winches.turn(t + k * dt, dt, duty, tension)
            rows[k] = np.clip((rest - wanted) / (REEL_M_PER_S * dt), -1.0, 1.0)
            rest = rest - rows[k] * REEL_M_PER_S * dt
        run = self._sim.rollout(theta, self._state, torch.as_tensor(rows)[None], step=STEP_S, hold=HOLD,
                                every=HOLD * count)  # fmt: skip
        self._state = run.at(-1)

    def _now(self, t: float) -> Parameters:
        """The numbers for the next 20 ms: what depends on place, tension or time."""
        effects = self._world.effects
        changed: dict[str, torch.Tensor] = {}
        if effects.friction_field is not None:
            changed["friction"] = self._mu * _field(effects.friction_field, self.caps()).reshape(1, -1, 2)
        if effects.tendon_relaxation is not None:
            changed["rest"] = self._rest0 + self._crept(effects.tendon_relaxation)
        if self._sways():
            changed["gravity"] = _swayed(self._hidden, t, self._R)
        return self._theta.with_values(changed) if changed else self._theta

    def _crept(self, p: Any) -> torch.Tensor:
        """Two Kelvin elements with time constants of their own, followed every 20 ms."""
        import torch

        passive = [k for k, cable in enumerate(self._robot.cables) if cable.kind == "passive"]
        k = self._theta.stiffness[0].numpy()[passive]
        pull = np.maximum(self._spans(self._theta)[passive] - (self._rest0[0].numpy() + self._creep.sum(axis=0)), 0.0)
        share = np.array([[p.fast_share], [p.slow_share]])
        rate = 1.0 - np.exp(-0.02 / np.array([CREEP_S]).T)
        self._creep = self._creep + rate * (share * pull * (k / k.mean()) - self._creep)
        return torch.as_tensor(self._creep.sum(axis=0))[None]

    def _spans(self, theta: Parameters) -> np.ndarray:
        p, q = self._state.p_WB[0].numpy(), self._state.q_WR[0].numpy()
        R = rotation(q)
        rods = self._ends // 2
        ends = p[rods] + np.einsum("ceij,cej->cei", R[rods], theta.p_BS[0].numpy())
        return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1))

    def _tension(self, theta: Parameters) -> np.ndarray:
        winched = list(self._robot.actuated)
        stretch = self._spans(theta)[winched] - self._state.rest[0].numpy()
        return np.asarray(theta.stiffness[0].numpy()[winched] * np.maximum(stretch, 0.0))


def _simulator(structure: Any, kind: Any, kept: dict[Any, Any] = {}) -> Any:  # noqa: B006 - one a process, compiled once
    if structure not in kept:
        kept[structure] = kind(structure)
    return kept[structure]


def _field(p: Any, caps: np.ndarray) -> torch.Tensor:
    """Factor of every cap's friction: bells where the catalogue has discs, and an exponential slope."""
    import torch

    xy = caps[:, :2]
    factor = np.exp(xy @ np.array(p.gradient_per_m))
    for patch in p.patches:
        away = np.linalg.norm(xy - np.array(patch.center_m), axis=1)
        factor = factor * (1.0 + (patch.factor - 1.0) * np.exp(-0.5 * (away / (0.75 * patch.radius_m)) ** 2))
    return torch.as_tensor(factor)


def _swayed(hidden: Hidden, t: float, R_WG: np.ndarray) -> torch.Tensor:
    import torch

    assert hidden.strange is not None  # noqa: S101 - asked before
    p: Any = hidden.strange[1]
    a = p.angle * np.sin(2 * np.pi * t / p.period)
    g = 9.81 * np.array([*(np.sin(a) * np.array(p.way)), -np.cos(a)])
    return torch.as_tensor(g @ R_WG)[None]
