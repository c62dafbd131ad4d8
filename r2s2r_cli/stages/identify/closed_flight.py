"""A training window flown with the controller inside, and what is compared of it: caps at key frames, and durations.

A window's targets are given to the simulated controller, which decides itself when each is reached. Real and simulated
target intervals are laid over each other at their switches, and compared at the end of what both have (paper, Key
Frame Loss). How long each took is an observation as well: the intersection leaves little of a motor's speed in the
positions, and the paper gets it from the durations by its mask. One key frame an interval: the number of residuals may
not depend on the parameters, so an interval in which a motor reverses is not cut there, as `paper.key_frames` would
where both sides reverse. Between two frames the observed caps are interpolated: else a controller that is done one
tick later would jump to the next frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.identify.closed_clock import Switches, link_between, switches
from r2s2r_cli.stages.identify.predict import Predictor, refused
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine.closed_loop import ClosedLoopRun


@dataclass(frozen=True)
class Compared:
    """Simulated minus observed, of points (k): caps (k, interval, cap, 3) [m], took (k, interval) [s]. moving: velocity
    of the simulated caps there [m/s], as caps. duration: of the whole window, simulated [s], (k,)."""

    caps: np.ndarray
    moving: np.ndarray
    took: np.ndarray
    duration: np.ndarray


class Flight:
    """One window with its log: numbers of the intervals that have a frame to compare, and when each was given."""

    def __init__(self, window: Window) -> None:
        self.window = window
        self.numbers = window.intervals[: int(window.place.max()) + 1]
        self.log: Switches = switches(window.run)
        self.whole = bool(window.frames[-1] == window.run.intervals.last[self.numbers[-1] - 1])
        """Whether no tip-over cuts its last interval."""

    @property
    def count(self) -> int:
        """Its intervals."""
        return len(self.numbers)

    @property
    def given(self) -> np.ndarray:
        """When its targets were given [s]."""
        return np.asarray(self.log.at[np.array(self.numbers) - 1])

    @property
    def took(self) -> np.ndarray:
        """How long they took [s]: the last until a tip-over, if one cuts it."""
        took = self.log.took(self.numbers)
        if not self.whole:
            took[-1] = min(took[-1], float(self.window.run.t[self.window.frames[-1]]) - self.given[-1])
        return took

    def flown(self, predictor: Predictor, values: np.ndarray, start: Tensor) -> ClosedLoopRun:
        """The window with values (k, n) from flat states (k or 1, NS). Raises what the engine has to say, in words."""
        import torch

        from r2s2r_cli.engine import EngineError
        from r2s2r_cli.engine.closed_loop import closed_loop
        from r2s2r_cli.engine.flat import unpack_state

        mapping = predictor.mapping
        x = torch.as_tensor(values)
        seen = [mapping.observation(one) for one in values]
        pid = mapping.pid(x)
        targets = torch.as_tensor(self.window.run.intervals.target[np.array(self.numbers) - 1])
        none = torch.zeros(len(targets), dtype=torch.float64)
        link = link_between(
            self.window.run, self.window.start, float(self.given[0]), period=pid.period,
            command_delay=np.array([one.command_delay for one in seen]),
            camera_delay=np.array([one.camera_delay for one in seen]),
        )  # fmt: skip
        predictor.rollouts += len(values)
        # Where only the controller's numbers are free, nothing else says how many there are.
        state = unpack_state(predictor.structure, start.expand(len(values), -1))
        try:
            with torch.no_grad():
                return closed_loop(
                    predictor.simulator, mapping.theta(x), state, pid, targets, none,
                    none + mapping.robot.pid.step_timeout_s, step=predictor.step, link=link,
                )  # fmt: skip
        except EngineError as error:
            raise refused(error, [self.window]) from error

    def compared(self, predictor: Predictor, values: np.ndarray, start: Tensor) -> Compared:
        """What is left between the simulation of values (k, n) and the run."""
        flown = self.flown(predictor, values, start)
        period = predictor.mapping.robot.pid.rate_hz**-1
        caps, index = flown.trajectory.end_caps().numpy(), flown.index.numpy()
        given, real, last = self.given, self.took, float(self.window.run.t[self.window.frames[-1]])
        shape = (len(values), self.count)
        found, longer = np.empty((*shape, *caps.shape[2:])), np.empty(shape)
        moving = np.empty_like(found)
        for k, one in enumerate(values):
            seen = predictor.mapping.observation(one)
            began = np.searchsorted(index[k], np.arange(self.count + 1)) * period  # on the simulation's clock
            # The first target was given where the log says, be it before the start.
            began[0] = given[0] + seen.camera_delay - self.window.start
            took = np.diff(began)
            longer[k] = took - real
            moment = given + seen.camera_delay + np.minimum(took, real)  # as frames are stamped
            moment = np.clip(moment, self.window.start, last)
            place = np.maximum(began[:-1] + moment - given - seen.camera_delay, 0.0) / period
            up = np.array([0.0, 0.0, seen.ground_height])
            observed = _between(self.window.run.t, self.window.run.observed, moment)
            ticks = np.arange(len(caps[k]))
            found[k] = _between(ticks, caps[k], place) + up - observed
            moving[k] = (_between(ticks, caps[k], place + 1) - _between(ticks, caps[k], place - 1)) / (2 * period)
        return Compared(found, moving, longer, flown.duration(period).numpy())


def _between(t: np.ndarray, p: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Of p (frame, ...) at the moments `at` (n,), linear between the frames t (frame,), not beyond them: (n, ...)."""
    high = np.clip(np.searchsorted(t, at, side="left"), 1, len(t) - 1)
    share = np.clip((at - t[high - 1]) / (t[high] - t[high - 1]), 0.0, 1.0)
    share = share.reshape(-1, *[1] * (p.ndim - 1))
    return np.asarray((1 - share) * p[high - 1] + share * p[high])
