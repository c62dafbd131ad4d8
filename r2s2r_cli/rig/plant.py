"""The robot itself: MuJoCo's bodies and cables, winches, and the laws of the world file. No electronics, no clocks."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import mujoco
import numpy as np

from r2s2r_cli.rig.beginning import options_of, require_parts, start_pose
from r2s2r_cli.rig.effects.base import Law, Scene, overrides
from r2s2r_cli.rig.effects.cables import Cords
from r2s2r_cli.rig.effects.contact import cap_geoms
from r2s2r_cli.rig.model.frames import quaternion, rest_pose, rotation, wxyz
from r2s2r_cli.rig.model.mjcf_text import ground_rotation
from r2s2r_cli.rig.model.sim import MujocoSim, Reading
from r2s2r_cli.rig.winches import Winches
from r2s2r_cli.rig.world.faults import CableTorn, MotorDead
from r2s2r_cli.rig.world.file import World
from schemas.robot import Robot

_ROUNDING = 1e-6
"""Part of a step by which a time may miss it: times are sums of rounded numbers."""


@dataclass(frozen=True)
class Truth:
    """What is, as nobody outside the rig may know it; frame W, z against gravity, at one instant.

    t [s]. p_WE: end caps [m], (cap, 3). p_WR, q_WR (xyzw), v_WR, w_R: middles of the rods [m], attitudes, velocities
    [m/s], angular velocities in rod axes [rad/s], (rod, 3 or 4). length: distance of cap centres [m], tension [N],
    (cable,). rest: rest lengths that the winches have set [m], angle: of their shafts [rad], (actuated,). force: of the
    ground on the caps [N], (cap, 3), in the last step. contact: caps that it touches, (cap,). battery: share of its
    voltage.
    """

    t: float
    p_WE: np.ndarray
    p_WR: np.ndarray
    q_WR: np.ndarray
    v_WR: np.ndarray
    w_R: np.ndarray
    length: np.ndarray
    tension: np.ndarray
    rest: np.ndarray
    angle: np.ndarray
    force: np.ndarray
    contact: np.ndarray
    battery: float


class Plant:
    """A robot in its world, at rest at time 0. Same robot, world and duties, same motion, to the last bit.

    Raises InputError for a robot that MuJoCo cannot model, UsageError for a world that names what the robot lacks.
    """

    def __init__(self, robot: Robot, world: World) -> None:
        require_parts(robot, world)
        self.robot, self.world = robot, world
        options = options_of(world)
        self.sim = MujocoSim(robot, options)
        self.winches = Winches(robot)
        self._n = len(robot.actuated)
        self._ends = np.array([cable.caps for cable in robot.cables])
        self._h = float(self.sim.model.opt.timestep)
        self._zero = rest_pose(robot).rest
        self._pose = start_pose(robot, world, options)
        self.sim.reset(self._pose)
        self.laws = self._laws()
        self._force = tuple(law for law in self.laws if overrides(law, "force"))
        self._friction = tuple(law for law in self.laws if overrides(law, "friction"))
        self._sense = tuple(law for law in self.laws if overrides(law, "sense"))
        self.winches.use(self.laws)
        self._ground, self._caps = int(self.sim.model.geom("ground").id), self._cap_geoms()
        ridges = range(len(options.ridges))
        self._floor = {self._ground, *(int(self.sim.model.geom(f"ridge{i}").id) for i in ridges)}
        self._cap_of = {int(geom): i for i, geom in enumerate(self._caps)}
        self._mu = np.full(len(self._caps), self.sim.model.geom_friction[self._ground, 0])
        if self._friction:
            self._own_friction()
        self._hand = np.random.default_rng([world.seed, zlib.crc32(b"put_back")])
        self._R_WG = ground_rotation(options.ground_normal)
        self._dead = [fault for fault in world.faults if isinstance(fault, MotorDead)]
        self._torn = [fault for fault in world.faults if isinstance(fault, CableTorn)]
        mujoco.mj_forward(self.sim.model, self.sim.data)
        self._t = -world.start.settle_s
        """Time of the plant; MuJoCo's own starts at the settling and would be a sum of rounded steps."""
        self._steps, self._begin = 0, self._t
        self.advance(world.start.settle_s, np.zeros(len(robot.motors)))
        self._start = self.sim.read().p_WE

    @property
    def t(self) -> float:
        """The rig's time [s]."""
        return self._t

    def advance(self, dt: float, duty: np.ndarray) -> None:
        """Go on to t + dt, in whole steps: what is left of one is made up for the next time.

        duty: PWM -1 .. 1 with the sign of the wire, (motor,), held. Raises NumericalError as `MujocoSim` does.
        """
        self._t += dt
        wanted = int((self._t - self._begin) / self._h + _ROUNDING)
        for _ in range(wanted - self._steps):
            self._step(self._begin + self._steps * self._h, duty)
            self._steps += 1

    def put_back(self) -> None:
        """Where the world file asks for it: the robot lies at its start again, on the side it lay on then, in the shape
        that its cables have now, at rest, turned at random."""
        if not self.world.start.put_back:
            return
        data, R_WG, seen = self.sim.data, self._R_WG, self.sim.read()
        a = self._hand.uniform(-np.pi, np.pi)
        R_GH = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
        there, middle = self._start.mean(axis=0), seen.p_WE.mean(axis=0)
        turn = R_WG @ R_GH @ R_WG.T @ _turn(seen.p_WE - middle, self._start - there)
        # It is laid down: its lowest cap as high above the floor as the lowest was at first.
        up = R_WG[:, 2]
        there = there + up * (((self._start - there) @ up).min() - ((seen.p_WE - middle) @ turn.T @ up).min())
        pose = data.qpos.reshape(-1, 7)
        pose[:, :3] = (seen.p_WR - middle) @ turn.T + there
        pose[:, 3:] = wxyz(np.array([quaternion(turn @ R) for R in rotation(seen.q_WR)]))
        data.qvel[:] = 0.0
        mujoco.mj_forward(self.sim.model, data)

    def lengths(self) -> np.ndarray:
        """Distances of cap centres [m], (cable,): what the sensors are stretched by, laws of sensing apart."""
        p = self.sim.data.geom_xpos[self._caps]
        return np.asarray(np.linalg.norm(p[self._ends[:, 1]] - p[self._ends[:, 0]], axis=-1))

    def sensed(self) -> np.ndarray:
        """The same with the laws of sensing [m], (cable,)."""
        length = self.lengths()
        for law in self._sense:
            length = law.sense(self._t, length)
        return length

    def truth(self) -> Truth:
        """Everything, now."""
        seen: Reading = self.sim.read()
        return Truth(
            t=self._t, p_WE=seen.p_WE, p_WR=seen.p_WR, q_WR=seen.q_WR, v_WR=seen.v_WR, w_R=seen.w_R, length=seen.length,
            tension=seen.tension, rest=self.winches.rest.copy(), angle=self.winches.angle.copy(),
            force=self._forces(), contact=seen.contact, battery=self.winches.share,
        )  # fmt: skip

    def _step(self, t: float, duty: np.ndarray) -> None:
        data, model = self.sim.data, self.sim.model
        if self._dead:
            stopped = [fault.motor for fault in self._dead if fault.on(t)]
            duty = duty.copy()
            duty[stopped] = 0.0
        for fault in [fault for fault in self._torn if fault.on(t)]:
            Cords(self.sim).tear(fault.cable)
            self._torn.remove(fault)
        if self._force:
            data.xfrc_applied[:] = 0.0
            for law in self._force:
                law.force(t)
        if self._friction:
            mu = self._mu
            for law in self._friction:
                mu = law.friction(mu)
            model.geom_friction[self._caps, 0] = mu
        self.sim.step()
        # As in `MujocoSim.wind`: a step uses the rest lengths at its start; what is wound in it shows in the next.
        tension = -data.actuator_force[: self._n]
        data.ctrl[: self._n] = self._zero - self.winches.turn(t, self._h, duty, tension)

    def _forces(self) -> np.ndarray:
        data, force, six = self.sim.data, np.zeros((len(self._caps), 3)), np.zeros(6)
        for i in range(data.ncon):
            a, b = (int(x) for x in data.contact.geom[i])
            if (a in self._cap_of) == (b in self._cap_of) or data.contact.efc_address[i] < 0:
                continue
            cap, of_cap = (b, 1.0) if b in self._cap_of else (a, -1.0)
            if (a if cap == b else b) not in self._floor:
                continue
            mujoco.mj_contactForce(self.sim.model, data, i, six)
            # The first axis of a contact's frame points from its first geom to its second.
            f = data.contact.frame[i].reshape(3, 3).T @ six[:3]
            force[self._cap_of[cap]] += of_cap * f
        return force

    def _laws(self) -> tuple[Law, ...]:
        laws = []
        for name, effect in self.world.effects.present():
            rng = np.random.default_rng([self.world.seed, zlib.crc32(name.encode())])
            laws.append(effect.law(Scene(self.robot, self.sim, self.winches.r, rng)))
        return tuple(laws)

    def _cap_geoms(self) -> np.ndarray:
        return cap_geoms(self.sim, self.robot.n_caps)

    def _own_friction(self) -> None:
        """From now on the caps decide about friction, not the ground."""
        model = self.sim.model
        model.geom_priority[self._caps] = model.geom_priority[self._ground] + 1
        model.geom_condim[self._caps] = model.geom_condim[self._ground]
        model.geom_friction[self._caps] = model.geom_friction[self._ground]


def _turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) that takes points a (n, 3) nearest to b, both about the origin (Kabsch)."""
    u, _, v = np.linalg.svd(b.T @ a)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)
