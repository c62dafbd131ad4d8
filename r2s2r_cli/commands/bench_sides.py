"""The two simulators of `bench engine`, each with the same three jobs: start, run forward, differentiate."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.commands import bench_gait
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.engine.trajectory import Trajectory
    from r2s2r_cli.rig.model.options import Integrator

SETTLE_S = 3.0
"""Both robots come to rest on the ground before anything is measured."""
FRAME_S = 0.02
"""Ours stores a frame so often; MuJoCo's rollout stores every step."""
RELATIVE = 1e-4
"""Relative change of a parameter in a difference quotient."""

Job = Callable[[], None]


class MujocoSide:
    """MuJoCo through `mujoco.rollout`, one thread."""

    def __init__(self, robot: Robot, step_s: float, integrator: Integrator = "Euler") -> None:
        import mujoco
        from mujoco.rollout import Rollout

        from r2s2r_cli.rig.model import Options, rest_pose
        from r2s2r_cli.rig.model.mjcf_text import winch_speed
        from r2s2r_cli.rig.model.sim import MujocoSim

        self.options = Options(timestep_s=step_s, integrator=integrator)
        self.robot, self.step_s, self.speed = robot, step_s, winch_speed(robot)
        sim = MujocoSim(robot, self.options)
        sim.step(count=round(SETTLE_S / step_s))
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        self._start = np.empty(mujoco.mj_stateSize(sim.model, kind))
        mujoco.mj_getState(sim.model, sim.data, self._start, kind)
        self._model, self._data, self._rollout = sim.model, sim.data, Rollout(nthread=0)
        self._rest = rest_pose(robot).rest

    def forward(self, u: np.ndarray) -> Job:
        """A batch of runs with motor commands u (B, tick, actuated)."""
        return self._job([self._model] * len(u), self.controls(u, self.robot))

    def gradient(self, u: np.ndarray) -> Job:
        """One run with u (1, tick, actuated), and one more with each parameter changed: a forward difference each."""
        from r2s2r_cli.rig.model.sim import build

        robots = [self.robot, *(bench_gait.varied(self.robot, name, 1 + RELATIVE) for name in bench_gait.parameters())]
        models = [build(robot, self.options) for robot in robots]
        return self._job(models, np.concatenate([self.controls(u, robot) for robot in robots]))

    def controls(self, u: np.ndarray, robot: Robot) -> np.ndarray:
        """Controls (B, step, nu) that wind u (B, tick, actuated) with the motors of `robot`.

        Winches count from the rest pose of their own robot; all runs start with the same rest lengths.
        """
        from r2s2r_cli.rig.model import rest_pose
        from r2s2r_cli.rig.model.mjcf_text import winch_speed

        reeled = bench_gait.reeled_in(u, winch_speed(robot), self.step_s)
        controls = np.zeros((*reeled.shape[:2], self._model.nu))
        controls[..., : reeled.shape[2]] = rest_pose(robot).rest - (self._rest - reeled)
        return controls

    def rest_lengths(self, u: np.ndarray, robot: Robot) -> np.ndarray:
        """Rest lengths (B, step, actuated) [m] that these controls mean for `robot`."""
        from r2s2r_cli.rig.model import rest_pose

        return np.asarray(rest_pose(robot).rest - self.controls(u, robot)[..., : len(self._rest)])

    def _job(self, models: list, controls: np.ndarray) -> Job:
        start = np.repeat(self._start[None], len(models), axis=0)
        # Handed in, so that no time goes into making it.
        states = np.zeros((*controls.shape[:2], start.shape[1]))

        def job() -> None:
            self._rollout.rollout(models, self._data, start, controls, state=states)
            if not np.isfinite(states[:, -1]).all():
                raise ArithmeticError("MuJoCo's states are not finite")

        return job


class OurSide:
    """The engine through `Simulator`, float64, one thread."""

    def __init__(self, robot: Robot, step_s: float, cache_dir: Path | None = None) -> None:
        import torch

        from r2s2r_cli.engine.rollout import Simulator
        from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of

        torch.set_num_threads(1)
        self.robot, self.step_s = robot, step_s
        self.structure, self.theta = structure_of(robot), parameters_of(robot)
        self.speed = self.theta.speed_in[0].numpy()
        self.simulator = Simulator(self.structure, cache_dir=cache_dir)
        self._hold, self._every = round(bench_gait.TICK_S / step_s), round(FRAME_S / step_s)
        still = torch.zeros(1, round(SETTLE_S / bench_gait.TICK_S), self.structure.n_actuated, dtype=torch.float64)
        self._start = rest_state(robot)
        self.substeps = self.simulator.substeps(self.theta, self._start, step_s)
        settled = self.simulator.rollout(self.theta, self._start, still, step=step_s, hold=self._hold, every=self._hold)
        self._start = settled.at(-1)

    def run(self, u: np.ndarray) -> Trajectory:
        """The runs themselves."""
        rows = self._rows(u)
        return self.simulator.rollout(
            self.theta, self._start, rows, step=self.step_s, hold=self._hold, every=self._every
        )

    def forward(self, u: np.ndarray) -> Job:
        """A batch of runs with motor commands u (B, tick, actuated)."""

        def job() -> None:
            self.run(u)

        return job

    def jacobian(self, u: np.ndarray) -> Job:
        """One run with u (1, tick, actuated) and its tangents along the ten parameters."""
        import torch

        directions, rows = self._directions(), self._rows(u)

        def job() -> None:
            _, tangents = self.simulator.jvp(
                self.theta, self._start, rows, d_parameters=directions, step=self.step_s, hold=self._hold,
                every=self._every,
            )  # fmt: skip
            if not bool(torch.isfinite(tangents).all()):
                raise ArithmeticError("our tangents are not finite")

        return job

    def gradient(self, u: np.ndarray) -> Job:
        """One run with u (1, tick, actuated), and the gradient of one number, the mean square of its end caps, with
        respect to the ten parameters: a forward and a backward pass."""
        import torch

        from r2s2r_cli.engine import pack_parameters, unpack_parameters

        directions, rows = self._directions(), self._rows(u)
        packed = pack_parameters(self.structure, self.theta)

        def job() -> None:
            relative = torch.zeros(directions.shape[1], dtype=torch.float64, requires_grad=True)
            theta = unpack_parameters(self.structure, packed + directions @ relative)
            run = self.simulator.rollout(theta, self._start, rows, step=self.step_s, hold=self._hold, every=self._every)
            (gradient,) = torch.autograd.grad(run.end_caps().square().mean(), relative)
            if not bool(torch.isfinite(gradient).all()):
                raise ArithmeticError("our gradient is not finite")

        return job

    def _directions(self):  # type: ignore[no-untyped-def]
        """Derivatives of the flat parameters by the logarithms of the ten, (NP, 10)."""
        import torch

        from r2s2r_cli.engine import pack_parameters
        from r2s2r_cli.stages.model import parameters_of

        def packed(name: str, factor: float) -> torch.Tensor:
            return pack_parameters(self.structure, parameters_of(bench_gait.varied(self.robot, name, factor)))[0]

        columns = [
            (packed(name, 1 + RELATIVE) - packed(name, 1 - RELATIVE)) / (2 * RELATIVE)
            for name in bench_gait.parameters()
        ]
        return torch.stack(columns, dim=1)

    def _rows(self, u: np.ndarray):  # type: ignore[no-untyped-def]
        import torch

        return torch.as_tensor(u)
