"""`mujoco.sysid` on a case of `bench identify`: its data from MuJoCo, its fit, its intervals."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from r2s2r_cli.commands import bench_gait
from r2s2r_cli.commands.bench_identify_case import FRAME_S, NUMBERS, Case, Fit
from r2s2r_cli.commands.bench_sides import SETTLE_S
from schemas.robot import Robot

HORIZONS = (1, 2, 4, 7, 10)
"""Seconds of a growing fit; those beyond the run are left out, its length is the last."""
Edit = Callable[[Any, float, Robot], None]
"""Writes a value into an MjSpec; the robot as in robot.toml is at hand."""
MORE = 2
"""Rows of the controls beyond the last observation, so that it lies within whatever roundings say."""
WINCH, PASSIVE = "winch", "passive"
"""How the names of the actuators begin in the twin."""


class SysidSide:
    """A case as `mujoco.sysid` takes it. The twin of robot.toml is simulated with the planted values, and observed by
    the toolbox itself, so that its residual at the planted values is the noise and nothing else.

    A motor speed is no number of a MuJoCo model, whose controls are lengths: it scales the gain of the controls.
    """

    def __init__(self, case: Case, step_s: float) -> None:
        import mujoco
        from mujoco import sysid

        from r2s2r_cli.rig.model import Options, mjcf
        from r2s2r_cli.rig.model.mjcf_text import winch_speed
        from r2s2r_cli.rig.model.sim import MujocoSim

        self.case = case
        options = Options(timestep_s=step_s)
        sim = MujocoSim(case.robot(case.truth), options)
        sim.step(count=round(SETTLE_S / step_s))
        self._spec = mujoco.MjSpec.from_string(mjcf(case.nominal, options))
        caps = 2 * len(case.nominal.rods)
        for cap in range(caps):
            self._spec.add_sensor(name=f"cap{cap}", type=mujoco.mjtSensor.mjSENS_FRAMEPOS,
                                  objtype=mujoco.mjtObj.mjOBJ_SITE, objname=f"centre{cap}")  # fmt: skip
        model = self._spec.compile()
        self._model, self._caps = model, [f"cap{cap}" for cap in range(caps)]
        self._start = sysid.create_initial_state(model, np.array(sim.data.qpos), np.array(sim.data.qvel))
        reeled = bench_gait.reeled_in(case.u[None], winch_speed(case.nominal), step_s)[0]
        rows = np.concatenate([reeled, *[reeled[-1:]] * MORE])
        self._control = np.zeros((len(rows), model.nu))
        self._control[:, : rows.shape[1]] = rows
        self._step_s = step_s
        blank = self._residual_of(np.ones((len(case.t), 3 * caps)))
        _, ((clean,),), _ = blank(case.truth, self._parameters(case.truth))
        self.observed = clean.data + case.noise.reshape(len(case.t), -1)
        self._residual = self._residual_of(self.observed)
        self._spent = 0.0

    def rms(self, values: np.ndarray) -> float:
        """Root mean square of what the simulation with these values leaves of the observed coordinates [m]."""
        _, ((seen,),), ((told,),) = self._residual(values, self._parameters(values))
        return float(np.sqrt(np.mean((seen.data - told.data) ** 2)))

    def fit(self, **settings: Any) -> Fit:
        """`sysid.optimize` with its default optimiser and `calculate_intervals`; settings: of the optimiser."""
        return self._fitted((len(self.case.t),), settings)

    def fit_growing(self, **settings: Any) -> Fit:
        """The same over the first second, then more, each from the values found before: what the toolbox lacks."""
        frames = [round(horizon * bench_gait.TARGET_S / FRAME_S) for horizon in HORIZONS]
        return self._fitted((*(n for n in frames if n < len(self.case.t)), len(self.case.t)), settings)

    def _fitted(self, horizons: tuple[int, ...], settings: dict[str, Any]) -> Fit:
        from mujoco import sysid

        self._spent = 0.0
        clock = time.process_time()
        best: Any = self._parameters(self.case.start)
        result: Any = None
        for frames in horizons:
            counted = self._counted(frames)
            # It prints every iteration unless it is given somewhere else to print.
            best, result = sysid.optimize(
                initial_params=best, residual_fn=counted, verbose=False, output=io.StringIO(), **settings
            )
        x = best.as_vector()
        residual, _, _ = counted(x, best)
        with np.errstate(all="ignore"):  # it divides by flat directions, whose intervals are infinite
            _, half = sysid.calculate_intervals([np.ravel(one) for one in residual], result.jac)
        return Fit(estimate=x, low=x - half, high=x + half, cpu_s=time.process_time() - clock, rollouts=self._spent,
                   rms_m=self.rms(x))  # fmt: skip

    def _residual_of(self, observed: np.ndarray) -> Any:
        """The toolbox's residual function for the first len(observed) frames of end caps (frame, 3 cap)."""
        from mujoco import sysid

        rows = round(self.case.t[len(observed) - 1] / self._step_s) + MORE
        t = self._step_s * np.arange(rows)
        control = sysid.TimeSeries.from_control_names(t, self._control[:rows], self._model)
        seen = sysid.TimeSeries.from_names(self.case.t[: len(observed)], observed, self._model, names=self._caps)
        made = sysid.ModelSequences("robot", self._spec, "gait", self._start, control, seen)
        return sysid.build_residual_fn(models_sequences=[made], n_threads=1)

    def _counted(self, frames: int) -> Any:
        residual = self._residual_of(self.observed[:frames])

        def counted(x: np.ndarray, params: Any) -> Any:
            self._spent += (1 if x.ndim == 1 else x.shape[1]) * frames / len(self.case.t)
            return residual(x, params)

        return counted

    def _parameters(self, values: np.ndarray) -> Any:
        """The free numbers with bounds, and what each changes in the specification of the model."""
        from mujoco import sysid

        case, made = self.case, sysid.ParameterDict()
        # The toolbox applies them in this order: the motor speed comes after the stiffness that it scales.
        for name, low, high, value in zip(NUMBERS, case.lower, case.upper, values, strict=True):
            made.add(sysid.Parameter(name, value, low, high, modifier=_modifier(_EDITS[name], case.nominal)))
        return made


def _modifier(edit: Edit, nominal: Robot) -> Callable[[Any, Any], None]:
    return lambda spec, parameter: edit(spec, float(parameter.value[0]), nominal)


def _friction(spec: Any, value: float, nominal: Robot) -> None:
    spec.geom("ground").friction[0] = value


def _cables(spec: Any, kind: str) -> list[Any]:
    return [actuator for actuator in spec.actuators if actuator.name.startswith(kind)]


def _stiffness(kind: str, spec: Any, value: float, nominal: Robot) -> None:
    for actuator in _cables(spec, kind):
        rest = -actuator.biasprm[0] / actuator.biasprm[1]
        actuator.biasprm[0], actuator.biasprm[1] = value * rest, -value
        if kind == WINCH:
            actuator.gainprm[0] = -value


def _damping(spec: Any, value: float, nominal: Robot) -> None:
    for actuator in _cables(spec, WINCH):
        actuator.biasprm[2] = -value


def _speed(spec: Any, value: float, nominal: Robot) -> None:
    """Controls are lengths that winches of the nominal speed reel in."""
    for actuator in _cables(spec, WINCH):
        actuator.gainprm[0] = actuator.biasprm[1] * value / NUMBERS["motor_speed"].read(nominal)


_EDITS: dict[str, Edit] = {
    "friction": _friction,
    "stiffness_actuated": partial(_stiffness, WINCH),
    "stiffness_passive": partial(_stiffness, PASSIVE),
    "damping_actuated": _damping,
    "motor_speed": _speed,
}
