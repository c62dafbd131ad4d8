"""Everything that parity measures of a group of runs, by name and element, whatever it is compared with afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity.heights import heights
from r2s2r_cli.stages.diagnose.parity.knocks import Knock, knock
from r2s2r_cli.stages.diagnose.parity.lengths import sensor_parity
from r2s2r_cli.stages.diagnose.parity.rods import lost, rod_scales
from r2s2r_cli.stages.diagnose.parity.series import Measured, Series, combined, series
from r2s2r_cli.stages.diagnose.parity.taut import only, taut
from r2s2r_cli.stages.diagnose.parity.winch import Ramps, ramps
from r2s2r_cli.stages.diagnose.parity.winch_fit import WinchFit, fit_winches
from schemas.robot import Robot

Key = tuple[str, str, int | None]
"""Check, kind of element, its index."""


@dataclass(frozen=True)
class Quantities:
    """of: measured numbers. gain: of every winch law, in nats, over winches that have the
    lag they were said to have. lag: that they have [s]. missing: what could not be looked at. about: length at
    which every sensor's bias was taken [m], (cable,). knock: of the camera."""

    of: dict[Key, Measured]
    gain: dict[str, float]
    lag: float
    missing: tuple[str, ...]
    about: np.ndarray
    knock: Knock | None = None


def quantities(
    runs: Sequence[Run], robot: Robot, speed: float, *, lag: float | None = None, scale: float = 1.0
) -> Quantities:
    """Of runs, all together. speed: nominal, of the winches at full command [m/s]. lag: of healthy winches and sensors
    [s], None: of these runs. scale: of the camera, as it is known already."""
    plain = tuple(series(run, robot) for run in runs)
    found: dict[Key, Measured] = {}
    missing = []
    scales = rod_scales(plain, robot)
    for k, one in enumerate(scales):
        found["rod_length", "rod", k] = one
    shown = combined(scales)
    found["camera_scale", "camera", None] = shown
    found["dropout", "camera", None] = lost(plain)
    all_of = plain if scale == 1.0 else tuple(series(run, robot, scale) for run in runs)
    knocked = knock(all_of)
    if knocked is not None:
        found["knock", "camera", None] = knocked.size
    sensors = sensor_parity(all_of)
    about = np.full(len(robot.cables), np.nan)
    if sensors is None:
        missing.append("cable lengths: no sensor was logged, so commands are compared with cap distances alone")
    else:
        about = sensors.about
        found["camera_delay", "camera", None] = sensors.later
        found["sensor_gain", "sensor", None] = combined(sensors.gain)
        for k in range(len(robot.cables)):
            found["sensor_bias", "sensor", k] = sensors.bias[k]
            found["sensor_gain", "sensor", k] = sensors.gain[k]
            found["sensor_drift", "sensor", k] = sensors.drift[k]
    stand = heights(all_of, robot)
    if stand is None:
        missing.append("cap heights: the caps never stand still long enough")
    else:
        for axis in (0, 1):
            found[f"slope_{'xy'[axis]}", "world", None] = stand.slope[axis]
        found["slope_change", "camera", None] = _change(all_of, robot)
        for k, one in enumerate(stand.cap):
            found["cap_height", "cap", k] = one
    data = _ramps(all_of, robot, speed)
    fitted = None if data is None else fit_winches(data, len(robot.actuated), speed, given={"lag": lag or 0.0})
    own = lag or 0.0
    if data is not None and fitted is not None and lag is None:
        own = max(fitted.laws["lag"].size, 0.0)
        fitted = fit_winches(data, len(robot.actuated), speed, given={"lag": own})
    if fitted is None:
        missing.append("winches: no cable was seen to wind long enough while it was taut")
        return Quantities(found, {}, own, tuple(missing), about, knocked)
    found.update(_rates(fitted, speed))
    for name, law in fitted.laws.items():
        found[name, "motor", None] = Measured(law.size, law.sd)
    return Quantities(found, {name: law.gain for name, law in fitted.laws.items()}, own, tuple(missing), about,
                      knocked)  # fmt: skip


def _ramps(runs: tuple[Series, ...], robot: Robot, speed: float) -> Ramps | None:
    """Of sensors, where there are any, else of cap distances; None without any."""
    rest = np.array([cable.rest_length_m if cable.kind == "passive" else np.nan for cable in robot.cables], dtype=float)
    heard = tuple(one for one in runs if one.has_sensors)
    data = ramps(heard or runs, robot.actuated, rest, seen=not heard)
    return only(data, taut(data, speed)) if len(data) else None


def _rates(fitted: WinchFit, speed: float) -> dict[Key, Measured]:
    """Logarithms of rates over the nominal: of every winch against the median of all, of all, of in over out."""
    made: dict[Key, Measured] = {}
    size, sd = np.log(fitted.rate / speed), fitted.rate_sd / fitted.rate
    own = [combined([Measured(float(a), float(b)) for a, b in zip(*row, strict=True)], least_sd=0.01)
           for row in zip(size, sd, strict=True)]  # fmt: skip
    values = np.array([one.value for one in own])
    if not np.isfinite(values).any():
        return made
    middle = float(np.nanmedian(values))
    made["winch_speed", "motor", None] = Measured(middle, 1.2533 * combined(own).sd)
    for k, one in enumerate(own):
        made["winch_rate", "motor", k] = Measured(one.value - middle, one.sd)
    both = size[:, 0] - size[:, 1]
    ways = [Measured(float(a), float(b)) for a, b in zip(both, np.hypot(sd[:, 0], sd[:, 1]), strict=True)]
    made["in_over_out", "motor", None] = combined(ways, least_sd=0.02)
    return made


def _change(runs: Sequence[Series], robot: Robot) -> Measured:
    """Largest difference of the slope of a run from that of all [rad]; sd: of that run's."""
    if len(runs) < 2:
        return Measured(float("nan"), float("nan"))
    whole = heights(runs, robot)
    found = Measured(0.0, float("nan"))
    for one in runs:
        own = heights([one], robot)
        if own is None or whole is None:
            continue
        for a, b in zip(own.slope, whole.slope, strict=True):
            sd = float(np.hypot(a.sd, b.sd))
            if np.isfinite(sd) and sd > 0 and not abs(a.value - b.value) / sd <= abs(found.value) / (found.sd or 1.0):
                found = Measured(a.value - b.value, sd)
    return found
