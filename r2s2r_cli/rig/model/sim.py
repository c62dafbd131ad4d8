"""The MuJoCo model at work: reset, step, read. The only module of the model that imports MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from r2s2r_cli.errors import InputError, NumericalError, UsageError
from r2s2r_cli.rig.model.frames import Pose, rest_pose, rotation, wxyz, xyzw
from r2s2r_cli.rig.model.mjcf_text import mjcf, winch_range, winch_speed
from r2s2r_cli.rig.model.options import Options
from schemas.robot import Robot

# MuJoCo would write its warnings into a file in the working directory. They are read from its counters instead.
mujoco.set_mju_user_warning(lambda message: None)
_UNIT = 1e-6
"""How far the length of a quaternion may be from 1."""


@dataclass(frozen=True)
class Reading:
    """The state and what follows from it, all at the same instant; frame W.

    t [s]. p_WR, v_WR: middles of the rods [m], [m/s], (rod, 3). q_WR: xyzw, (rod, 4). w_R: angular velocities in rod
    axes [rad/s], (rod, 3). p_WE: end caps [m], (cap, 3). span: distance between the attachment points of each cable
    [m], length: between its cap centres [m], tension, sensor tendon included [N], all (cable,). rest: of the winched
    cables [m], (actuated,). contact: the ground touches this cap, (cap,). collisions: contacts between rods.
    """

    t: float
    p_WR: np.ndarray
    q_WR: np.ndarray
    v_WR: np.ndarray
    w_R: np.ndarray
    p_WE: np.ndarray
    span: np.ndarray
    length: np.ndarray
    tension: np.ndarray
    rest: np.ndarray
    contact: np.ndarray
    collisions: int


def build(robot: Robot, options: Options | None = None) -> mujoco.MjModel:
    """The compiled model. Raises InputError for a robot that MuJoCo cannot model."""
    text = mjcf(robot, options)
    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise InputError(
            f"MuJoCo does not compile the model of {robot.name}", where="robot.toml", expected="a model that compiles",
            received=str(error).strip().replace("\n", " ")[:200], hint="r2s2r validate robot.toml",
        ) from error  # fmt: skip


class MujocoSim:
    """One robot in MuJoCo. `model` and `data` are MuJoCo's own and may be used directly."""

    def __init__(self, robot: Robot, options: Options | None = None) -> None:
        self.robot = robot
        self.model = build(robot, options)
        self.data = mujoco.MjData(self.model)
        self._scratch = mujoco.MjData(self.model)
        self._speed, self._range = winch_speed(robot), winch_range(robot)
        self._zero = rest_pose(robot).rest
        self._half = np.array([rod.length_m / 2 for rod in robot.rods])
        self._caps = np.array([cable.caps for cable in robot.cables])
        names = [self.model.geom(i).name for i in range(self.model.ngeom)]
        self._ground = {i for i, name in enumerate(names) if name == "ground" or name.startswith("ridge")}
        self._cap_of = {i: int(name[3:]) for i, name in enumerate(names) if name.startswith("cap")}
        self.reset()

    @property
    def t(self) -> float:
        """Time since the last reset [s]."""
        return float(self.data.time)

    @property
    def rest(self) -> np.ndarray:
        """Rest lengths of the winched cables [m], (actuated,)."""
        return self._zero - self.data.ctrl[: len(self._zero)]

    def reset(self, pose: Pose | None = None, v_WR: np.ndarray | None = None, w_R: np.ndarray | None = None) -> None:
        """Start anew from `pose` (default: the rest pose of `robot.toml`), by default at rest.

        v_WR: velocities of the rods' middles, frame W [m/s]; w_R: angular velocities in rod axes [rad/s]; (rod, 3).
        Raises UsageError for wrong shapes and for values that no robot can have.
        """
        pose = pose or rest_pose(self.robot)
        rods, winches = len(self._half), len(self._speed)
        still = np.zeros((rods, 3))
        p_WR = _checked("p_WR", pose.p_WR, (rods, 3))
        q_WR = _checked("q_WR", pose.q_WR, (rods, 4))
        rest = _checked("rest", pose.rest, (winches,))
        v_WR = _checked("v_WR", still if v_WR is None else v_WR, (rods, 3))
        w_R = _checked("w_R", still if w_R is None else w_R, (rods, 3))
        size = np.linalg.norm(q_WR, axis=-1)
        if (np.abs(size - 1) > _UNIT).any():
            raise UsageError("q_WR holds no unit quaternions", where="MujocoSim.reset: q_WR", expected="length 1",
                             received=f"{size[np.argmax(np.abs(size - 1))]:.6g}",
                             hint="divide q_WR by its length")  # fmt: skip
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos = np.concatenate([p_WR, wxyz(q_WR)], axis=1).ravel()
        self.data.qvel = np.concatenate([v_WR, w_R], axis=1).ravel()
        self._set(rest)

    def step(self, rest: np.ndarray | None = None, count: int = 1) -> None:
        """`count` steps with the winches held at the rest lengths `rest` [m], (actuated,); None: where they are.

        Raises NumericalError where MuJoCo's numbers are no longer finite.
        """
        if rest is not None:
            self._set(_checked("rest", rest, self._speed.shape))
        mujoco.mj_step(self.model, self.data, nstep=count)
        self._check()

    def wind(self, u: np.ndarray, count: int = 1) -> None:
        """`count` steps with motor commands u in [-1, 1], (actuated,), +1 reels in at full speed.

        A step uses the rest length at its start; what is wound shows in the next. Raises as `step` does.
        """
        rate = self._speed * np.clip(_checked("u", u, self._speed.shape), -1.0, 1.0)
        for _ in range(count):
            mujoco.mj_step(self.model, self.data)
            self._set(self.rest - rate * self.model.opt.timestep)
        self._check()

    def read(self) -> Reading:
        """The present state. Leaves the simulation alone, to the last bit."""
        scratch = self._scratch
        scratch.time, scratch.qpos, scratch.qvel, scratch.ctrl = (
            self.data.time, self.data.qpos, self.data.qvel, self.data.ctrl,
        )  # fmt: skip
        mujoco.mj_forward(self.model, scratch)
        qpos, qvel = np.array(scratch.qpos).reshape(-1, 7), np.array(scratch.qvel).reshape(-1, 6)
        p_WR, q_WR = qpos[:, :3], xyzw(qpos[:, 3:])
        reach = self._half[:, None] * rotation(q_WR)[..., 2]
        p_WE = np.stack([p_WR - reach, p_WR + reach], axis=1).reshape(-1, 3)
        cables = len(self._caps)
        touching = np.zeros(len(p_WE), dtype=bool)
        collisions = 0
        for a, b in scratch.contact.geom[scratch.contact.efc_address >= 0]:
            if a in self._ground or b in self._ground:
                touching[self._cap_of[int(b if a in self._ground else a)]] = True
            else:
                collisions += 1
        return Reading(
            t=self.t, p_WR=p_WR, q_WR=q_WR, v_WR=qvel[:, :3], w_R=qvel[:, 3:], p_WE=p_WE,
            span=np.array(scratch.ten_length[:cables]),
            length=np.linalg.norm(p_WE[self._caps[:, 1]] - p_WE[self._caps[:, 0]], axis=-1),
            tension=self._tension(scratch), rest=self.rest, contact=touching, collisions=collisions,
        )  # fmt: skip

    def _tension(self, data: mujoco.MjData) -> np.ndarray:
        model, cables = self.model, len(self._caps)
        tension = np.zeros(cables)
        for i in range(model.nu):
            tension[model.actuator_trnid[i, 0]] -= data.actuator_force[i]
        stretch = np.maximum(data.ten_length - model.tendon_lengthspring[:, 1], 0.0)
        power = np.stack([stretch, stretch**2, stretch**3])
        law = np.vstack([model.tendon_stiffness.ravel(), model.tendon_stiffnesspoly.reshape(-1, 2).T])
        spring = (law * power).sum(axis=0) + model.tendon_damping.ravel() * data.ten_velocity
        tension += spring[:cables]
        for i in range(cables, model.ntendon):
            tension[int(model.tendon(i).name.removeprefix("sensor"))] += spring[i]
        return tension

    def _set(self, rest: np.ndarray) -> None:
        self.data.ctrl[: len(rest)] = self._zero - np.clip(rest, *self._range.T)

    def _check(self) -> None:
        # MuJoCo notes a divergence, starts anew from its default pose, and goes on as if nothing had been.
        counts = self.data.warning.number
        if not counts.any():
            return
        kind = int(np.flatnonzero(counts)[0])
        raise NumericalError(
            "MuJoCo's simulation went wrong", where=f"{self.robot.name}, t = {self.t:.3f} s",
            expected="finite numbers", received=mujoco.mju_warningText(kind, self.data.warning[kind].lastinfo).strip(),
            hint="use a smaller timestep_s, or softer cables in robot.toml",
        )  # fmt: skip


def _checked(name: str, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(values, dtype=float)
    if array.shape != shape or not np.isfinite(array).all():
        raise UsageError(
            f"{name} does not fit the robot", where=f"MujocoSim: {name}", expected=f"finite numbers of shape {shape}",
            received=f"shape {array.shape}" if array.shape != shape else "numbers that are not finite",
            hint="the order is that of robot.toml",
        )  # fmt: skip
    return array
