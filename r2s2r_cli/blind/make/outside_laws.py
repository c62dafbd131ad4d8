"""Laws that stand in no catalogue, on the rig's interface: each is its numbers, and what they do in a scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.effects.base import Law, Scene
from r2s2r_cli.rig.effects.cables import Cords
from r2s2r_cli.rig.effects.contact import cap_geoms

GRAVITY = 9.81


@dataclass(frozen=True)
class Cogging:
    """Poles of the motors: the speed ripples with the shaft's angle. share: of the speed; poles a turn."""

    share: float
    poles: float
    channel: str = "motor"

    def law(self, scene: Scene) -> Law:
        """Two harmonics."""
        return _Ripple(self, len(scene.r))


class _Ripple(Law):
    def __init__(self, p: Cogging, n: int) -> None:
        self._p, self._angle = p, np.zeros(n)

    def turn(self, dt: float, w: np.ndarray, tension: np.ndarray) -> np.ndarray:
        a = self._p.poles * self._angle
        w = w * (1.0 - self._p.share * (0.5 + 0.5 * np.sin(a) + 0.3 * np.sin(2 * a)))
        self._angle = self._angle + w * dt
        return w


@dataclass(frozen=True)
class Snag:
    """A winched cable catches for a while. cable: place in the order of the winched ones; when [s]."""

    cable: int
    begin: float
    end: float
    channel: str = "motor"

    def law(self, scene: Scene) -> Law:
        """Its motor stands still meanwhile, however hard it is driven."""
        return _Caught(self)


class _Caught(Law):
    def __init__(self, p: Snag) -> None:
        self._p = p

    def command(self, t: float, u: np.ndarray) -> np.ndarray:
        if not self._p.begin <= t < self._p.end:
            return u
        u = u.copy()
        u[self._p.cable] = 0.0
        return u


@dataclass(frozen=True)
class Push:
    """Somebody leans on a rod. force [N] in W, from `begin` to `end` [s]."""

    rod: int
    force: tuple[float, float, float]
    begin: float
    end: float
    channel: str = "world"

    def law(self, scene: Scene) -> Law:
        """A half sine in time at the rod's middle."""
        return _Hand(self, scene)


class _Hand(Law):
    def __init__(self, p: Push, scene: Scene) -> None:
        self._p, self._data = p, scene.sim.data
        self._body = scene.sim.model.body("rod_" + scene.robot.rods[p.rod].name).id

    def force(self, t: float) -> None:
        if self._p.begin < t < self._p.end:
            share = np.sin(np.pi * (t - self._p.begin) / (self._p.end - self._p.begin))
            self._data.xfrc_applied[self._body, :3] += share * np.array(self._p.force)


@dataclass(frozen=True)
class Bump:
    """A smooth rise of the floor. center, width [m]: of a bell of this height [m]."""

    center: tuple[float, float]
    width: float
    height: float
    stiffness: float = 3000.0
    channel: str = "contact"

    def law(self, scene: Scene) -> Law:
        """A spring along the bell's normal at every cap that would sink into it."""
        return _Bell(self, scene)


class _Bell(Law):
    def __init__(self, p: Bump, scene: Scene) -> None:
        self._p, self._sim = p, scene.sim
        self._geoms = cap_geoms(scene.sim, scene.robot.n_caps)
        self._body = scene.sim.model.geom_bodyid[self._geoms]
        self._r = scene.sim.model.geom_size[self._geoms, 0]

    def force(self, t: float) -> None:
        p, data = self._p, self._sim.data
        centers = data.geom_xpos[self._geoms]
        away = centers[:, :2] - np.array(p.center)
        rise = p.height * np.exp(-0.5 * (away**2).sum(axis=1) / p.width**2)
        for i in np.flatnonzero((centers[:, 2] - self._r < rise) & (rise > 1e-4)):
            normal = np.array([*(rise[i] * away[i] / p.width**2), 1.0])
            f = p.stiffness * (rise[i] - centers[i, 2] + self._r[i]) * normal / np.linalg.norm(normal)
            body = int(self._body[i])
            data.xfrc_applied[body, :3] += f
            data.xfrc_applied[body, 3:] += np.cross(centers[i] - data.xipos[body], f)


@dataclass(frozen=True)
class Bending:
    """Rods give way. compliance [m/N]: how much nearer both caps of a rod come under the cables' pull on it."""

    compliance: float
    channel: str = "cable"

    def law(self, scene: Scene) -> Law:
        """Every cable of a bent rod has so much less to span."""
        return _Bow(self, scene)


class _Bow(Law):
    def __init__(self, p: Bending, scene: Scene) -> None:
        self._cords = Cords(scene.sim)
        ends = np.array([cable.caps for cable in scene.robot.cables])
        touches = np.zeros((len(scene.robot.rods), len(ends)))
        for k, caps in enumerate(ends):
            touches[[cap // 2 for cap in caps], k] = 1.0
        self._give = 0.5 * p.compliance * touches.T @ touches
        self._now = np.zeros(len(ends))
        self._share = 1.0 - np.exp(-scene.sim.model.opt.timestep / 0.02)

    def force(self, t: float) -> None:
        change = self._share * (self._give @ self._cords.tension - self._now)
        self._now = self._now + change
        self._cords.lengthen(change)


@dataclass(frozen=True)
class CrossTalk:
    """Wires of neighbouring sensors run side by side. share: of the neighbour's change of length that shows."""

    share: float
    channel: str = "sensing"

    def law(self, scene: Scene) -> Law:
        """Every sensor hears the one before it."""
        return _Neighbour(self)


class _Neighbour(Law):
    def __init__(self, p: CrossTalk) -> None:
        self._p = p

    def sense(self, t: float, length: np.ndarray) -> np.ndarray:
        return length + self._p.share * (np.roll(length, 1) - 0.15)


@dataclass(frozen=True)
class Magnet:
    """Something under the floor pulls at the motors. place [m]; force [N] on a cap straight above, at `reach` [m]."""

    place: tuple[float, float]
    force: float
    reach: float
    channel: str = "world"

    def law(self, scene: Scene) -> Law:
        """With the fourth power of the distance, at all caps."""
        return _Pull(self, scene)


class _Pull(Law):
    def __init__(self, p: Magnet, scene: Scene) -> None:
        self._p, self._sim = p, scene.sim
        self._geoms = cap_geoms(scene.sim, scene.robot.n_caps)
        self._body = scene.sim.model.geom_bodyid[self._geoms]
        self._from = np.array([*p.place, -p.reach])

    def force(self, t: float) -> None:
        data = self._sim.data
        centers = np.array(data.geom_xpos[self._geoms])
        d = self._from - centers
        away = np.linalg.norm(d, axis=1, keepdims=True)
        pull = self._p.force * (self._p.reach / away) ** 4 * d / away
        for body, p, f in zip(self._body, centers, pull, strict=True):
            data.xfrc_applied[body, :3] += f
            data.xfrc_applied[body, 3:] += np.cross(p - data.xipos[body], f)


@dataclass(frozen=True)
class Sway:
    """The floor sways: gravity tilts to and fro. angle [rad], period [s], direction in the plane."""

    angle: float
    period: float
    way: tuple[float, float]
    channel: str = "world"

    def law(self, scene: Scene) -> Law:
        """A sine, seen from the floor."""
        return _Swing(self, scene)


class _Swing(Law):
    def __init__(self, p: Sway, scene: Scene) -> None:
        self._p, self._opt = p, scene.sim.model.opt

    def force(self, t: float) -> None:
        a = self._p.angle * np.sin(2 * np.pi * t / self._p.period)
        self._opt.gravity[:] = [*(GRAVITY * np.sin(a) * np.array(self._p.way)), -GRAVITY * np.cos(a)]
