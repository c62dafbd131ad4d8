"""Effects of the cables themselves: stiffness, relaxation, hysteresis, set."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.rig.section import Angle, Factor, NonNegative, Positive, Share, Shift


class Cords:
    """The cables of a MuJoCo model, to be lengthened and stiffened while it runs.

    A cable is an actuator with force = k (rest - length) + ..., or, with a cubic law, a tendon with a dead band.
    """

    def __init__(self, sim: MujocoSim) -> None:
        self._model, self._data = sim.model, sim.data
        n = len(sim.robot.cables)
        drives = {int(sim.model.actuator_trnid[i, 0]): i for i in range(sim.model.nu)}
        self._driven = np.array([k for k in range(n) if k in drives], dtype=int)
        self._drive = np.array([drives[k] for k in self._driven], dtype=int)
        self._sprung = np.array([k for k in range(n) if k not in drives], dtype=int)
        self.n = n

    @property
    def stiffness(self) -> np.ndarray:
        """At the rest length [N/m], (cable,)."""
        k = np.zeros(self.n)
        k[self._driven] = -self._model.actuator_biasprm[self._drive, 1]
        k[self._sprung] = self._model.tendon_stiffness.ravel()[self._sprung]
        return k

    @property
    def tension(self) -> np.ndarray:
        """In MuJoCo's last step, without sensor tendons [N], (cable,)."""
        pull = np.zeros(self.n)
        pull[self._driven] = -self._data.actuator_force[self._drive]
        stretch = np.maximum(self._data.ten_length - self._model.tendon_lengthspring[:, 1], 0.0)[self._sprung]
        pull[self._sprung] = self._model.tendon_stiffness.ravel()[self._sprung] * stretch
        return pull

    @property
    def rate(self) -> np.ndarray:
        """Rate of length in MuJoCo's last step [m/s], (cable,)."""
        return np.array(self._data.ten_velocity[: self.n])

    def lengthen(self, by: np.ndarray) -> None:
        """Make the rest lengths longer by `by` [m], (cable,)."""
        k = -self._model.actuator_biasprm[self._drive, 1]
        self._model.actuator_biasprm[self._drive, 0] += k * by[self._driven]
        self._model.tendon_lengthspring[self._sprung, 1] += by[self._sprung]

    def stiffen(self, factor: np.ndarray) -> None:
        """Multiply the force laws, (cable,)."""
        f = factor[self._driven]
        self._model.actuator_gainprm[self._drive, 0] *= f
        self._model.actuator_biasprm[self._drive, 0] *= f
        self._model.actuator_biasprm[self._drive, 1] *= f
        self._model.tendon_stiffness[self._sprung] = (
            self._model.tendon_stiffness[self._sprung].T * factor[self._sprung]
        ).T

    def tear(self, cable: int) -> None:
        """From now on the cable does not pull."""
        if cable in self._sprung:
            self._model.tendon_stiffness[cable] = 0.0
            self._model.tendon_stiffnesspoly[cable] = 0.0
            self._model.tendon_damping[cable] = 0.0
        for i in self._drive[self._driven == cable]:
            self._model.actuator_forcerange[i] = 0.0


class TendonStiffness(EffectSection):
    """Cables are softer or stiffer than `robot.toml` says."""

    factors: tuple[Factor, ...]
    """One a cable; missing ones are 1."""

    def law(self, scene: Scene) -> Law:
        """Gains of MuJoCo's actuators, for good."""
        Cords(scene.sim).stiffen(per(self.factors, len(scene.robot.cables), 1.0))
        return Law()


class TendonSet(EffectSection):
    """Cables have become longer for good: as soon as a tension first reaches `slip_n`, a knot gives way."""

    lengths_m: tuple[Shift, ...]
    """By how much [m], one a cable; missing ones are 0."""
    slip_n: NonNegative = 0.0
    """Tension at which it happens [N]; 0: long ago."""

    def law(self, scene: Scene) -> Law:
        """All at once, where the catalogue has a constant."""
        return _Slip(self, Cords(scene.sim))


class _Slip(Law):
    def __init__(self, p: TendonSet, cords: Cords) -> None:
        self._cords, self._slip_n = cords, p.slip_n
        self._left = per(p.lengths_m, cords.n, 0.0)
        if p.slip_n == 0.0:
            cords.lengthen(self._left)
            self._left = np.zeros(cords.n)

    def force(self, t: float) -> None:
        if self._left.any():
            now = np.where(self._cords.tension >= self._slip_n, self._left, 0.0)
            if now.any():
                self._cords.lengthen(now)
                self._left = self._left - now


class TendonRelaxation(EffectSection):
    """Cables creep under tension and draw back without it: one part quickly, one slowly."""

    fast_share: Share = 0.05
    """Creep of the quick part, as a part of the stretch of a passive cable with this tension."""
    slow_share: Share = 0.15
    """The same of the slow part."""
    fast_s: Positive = 1.0
    """Time constant of the quick part [s]."""
    slow_s: Positive = 20.0
    """Of the slow part [s]."""
    winched: bool = False
    """Whether the winched cables creep as well, by the same length for the same tension."""

    def law(self, scene: Scene) -> Law:
        """Two Kelvin elements in series with the cable, where the catalogue has one Maxwell branch beside it."""
        return _Creep(self, scene)


class _Creep(Law):
    def __init__(self, p: TendonRelaxation, scene: Scene) -> None:
        self._cords, self._dt = Cords(scene.sim), scene.sim.model.opt.timestep
        passive = np.array([cable.kind == "passive" for cable in scene.robot.cables])
        k = self._cords.stiffness
        soft = k[passive].mean() if passive.any() else k.mean()
        self._give = (passive | p.winched) / soft
        self._share = np.array([[p.fast_share], [p.slow_share]])
        self._step = 1.0 - np.exp(-self._dt / np.array([[p.fast_s], [p.slow_s]]))
        self._creep = np.zeros((2, self._cords.n))

    def force(self, t: float) -> None:
        change = self._step * (self._share * self._give * self._cords.tension - self._creep)
        self._creep = self._creep + change
        self._cords.lengthen(change.sum(axis=0))


class TendonHysteresis(EffectSection):
    """Inner friction of the passive cables: they pull harder while they lengthen than while they shorten."""

    force_n: NonNegative = 0.3
    """Largest friction [N]."""
    length_m: Positive = 0.004
    """Change of length over which it turns round [m]."""

    def law(self, scene: Scene) -> Law:
        """Dahl's friction, where the catalogue has Bouc and Wen's."""
        return _Dahl(self, scene)


class _Dahl(Law):
    def __init__(self, p: TendonHysteresis, scene: Scene) -> None:
        self._p, self._cords, self._dt = p, Cords(scene.sim), scene.sim.model.opt.timestep
        self._passive = np.array([cable.kind == "passive" for cable in scene.robot.cables])
        self._x = np.zeros(self._cords.n)

    def force(self, t: float) -> None:
        # x = force / force_n; x' = (v - |v| x) / length, exact over a step of constant v.
        v = np.where(self._passive, self._cords.rate, 0.0)
        decay = np.exp(-np.abs(v) * self._dt / self._p.length_m)
        x = np.sign(v) + (self._x - np.sign(v)) * decay
        self._cords.lengthen(-(x - self._x) * self._p.force_n / self._cords.stiffness)
        self._x = x


class CapstanFriction(EffectSection):
    """Winched cables rub where they leave their winch: part of the tension stays there."""

    wrap: Angle = 0.2
    """Friction coefficient times wrap angle; exp(-wrap) of the tension gets through [rad]."""
    length_m: Positive = 0.002
    """Motion of the cable over which the friction turns round [m]."""

    def law(self, scene: Scene) -> Law:
        """Euler and Eytelwein's law by what the winch moves, where the catalogue goes by the cable's length; Dahl's
        transition between both directions, where the catalogue has Bouc and Wen's."""
        return _Rub(self, scene)


class _Rub(Law):
    def __init__(self, p: CapstanFriction, scene: Scene) -> None:
        self._p, self._cords = p, Cords(scene.sim)
        self._winched = np.array(scene.robot.actuated, dtype=int)
        self._k = self._cords.stiffness[self._winched]
        self._way, self._by = np.zeros(len(self._winched)), np.zeros(len(self._winched))
        self._rest: np.ndarray | None = None

    def rest(self, dt: float, rest: np.ndarray, tension: np.ndarray) -> np.ndarray:
        # Reeling in (+1) the robot gets less than the winch pulls, letting out more.
        step = np.zeros(len(rest)) if self._rest is None else self._rest - rest
        self._rest = rest.copy()
        decay = np.exp(-np.abs(step) / self._p.length_m)
        self._way = np.sign(step) + (self._way - np.sign(step)) * decay
        pulled = tension + self._k * self._by
        self._by = pulled * -np.expm1(-self._p.wrap * self._way) / self._k
        return rest + self._by
