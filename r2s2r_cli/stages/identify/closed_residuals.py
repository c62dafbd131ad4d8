"""Key frames and durations with the controller in the loop, as a least-squares problem without derivatives.

A window's targets are given to the simulated controller, which decides itself when each is reached. Real and simulated
target intervals are laid over each other at their starts, and compared at the last real frame that both have (paper,
Key Frame Loss). How long each interval took is an observation as well: the intersection leaves little of a motor's
speed in the positions, and the paper gets it from the durations by its mask. One key frame an interval: the number of
residuals may not depend on the parameters, so an interval in which a motor reverses is not cut there, as
`paper.key_frames` would where both sides reverse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.free.base import values_of
from r2s2r_cli.stages.identify.predict import Predictor, refused
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.solve.secant import secant_jacobian
from r2s2r_cli.stages.identify.trust.information import widths
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from r2s2r_cli.engine.closed_loop import ClosedLoopRun

WIDTHS = (0.05, 0.2)
"""Of the differences, in widths of the priors: some percent. A control tick is some percent of a short interval."""
ROUNDING = 1e-9
"""[s] frames this much beyond an intersection still belong to it."""


class ClosedResiduals(CapResiduals):
    """A `Problem` over the coordinates of the parameters alone: windows start where the filter says, unmoved.

    Residuals: (simulated - observed) / sd of the caps at key frames, window by window, interval by interval, up to a
    tip-over; then (simulated - real) duration of each interval, over the time between two frames: a switch is seen at
    the next frame only.
    """

    def __init__(self, predictor: Predictor, windows: Sequence[Window], *, noise: float = 1e-3) -> None:
        super().__init__(predictor, [replace(one, known=True) for one in windows], noise=noise)
        self._key_sd = np.concatenate([np.tile(np.maximum(w.run.noise, noise), (_count(w), 1, 1)) for w in windows])
        number = np.concatenate([np.full(_count(w), k) for k, w in enumerate(windows)])
        place = np.concatenate([np.arange(_count(w)) for w in windows])
        size = self._key_sd[0].size
        self._time_sd = np.concatenate([np.full(_count(w), np.median(np.diff(w.run.t))) for w in windows])
        self.cluster = np.concatenate([np.repeat(number, size), number])
        self.interval = np.concatenate([np.repeat(place, size), place])
        keys = np.repeat(np.arange(len(number) * size // 3), 3)
        self.block = np.concatenate([keys, keys[-1] + 1 + np.arange(len(number))])
        self._steps = widths(self, self.frees)

    def evaluate(self, z: np.ndarray, *, jacobian: bool = True) -> Evaluation:
        """Residuals at z, their Jacobian by central differences of one batch. Raises NumericalError."""
        if not jacobian:
            return Evaluation(self._differences(z[None])[0], None, self.block)
        near, far = (width * self._steps for width in WIDTHS)
        found = secant_jacobian(self.batch, z, (near, far), lower=self.lower, upper=self.upper)
        return Evaluation(found.residual, found.jacobian, self.block)

    def batch(self, points: np.ndarray) -> np.ndarray:
        """Residuals (k, m) of points (k, n); nan where the simulation is not finite."""
        try:
            return self._differences(points)
        except NumericalError:
            if len(points) == 1:
                return np.full((1, len(self.block)), np.nan)
            return np.concatenate([self.batch(point[None]) for point in points])

    def seconds(self, z: np.ndarray) -> tuple[float, float]:
        """How long all windows took, simulated and real [s], from their first start to their last end."""
        took = real = 0.0
        for window in self.windows:
            run = self._flown(window, z[None])
            took += float(run.duration(self.predictor.mapping.robot.pid.rate_hz**-1)[0])
            real += float(_took(window).sum())
        return took, real

    def _differences(self, points: np.ndarray) -> np.ndarray:
        """All windows, one after the other; the points of a window side by side."""
        parts = [self._compared(window, points) for window in self.windows]
        keys = np.concatenate([caps for caps, _ in parts], axis=1) / self._key_sd
        return np.hstack([keys.reshape(len(points), -1), np.hstack([took for _, took in parts]) / self._time_sd])

    def _compared(self, window: Window, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Simulated minus observed: caps at key frames (k, interval, cap, 3) [m], durations (k, interval) [s]."""
        flown = self._flown(window, points)
        period = self.predictor.mapping.robot.pid.rate_hz**-1
        t, run = window.run.t, window.run
        begin, end, took = _begins(window), _ends(window), _took(window)
        caps = flown.trajectory.end_caps().numpy()
        index, needed = flown.index.numpy(), flown.ticks.numpy()
        found, longer = np.empty((len(points), len(begin), *caps.shape[2:])), np.empty((len(points), len(begin)))
        for b, values in enumerate(self._values(points)):
            up = np.array([0.0, 0.0, self.predictor.mapping.observation(values).ground_height])
            ticks = np.searchsorted(index[b, : needed[b]], np.arange(len(begin) + 1))
            longer[b] = np.diff(ticks) * period - took
            common = np.minimum(end - begin, np.diff(ticks) * period)
            frame = np.searchsorted(t, begin + common + ROUNDING, side="right") - 1
            place = ticks[:-1] + (t[frame] - begin) / period
            low = np.minimum(np.floor(place + 1e-9).astype(int), len(caps[b]) - 1)
            high = np.minimum(low + 1, len(caps[b]) - 1)
            share = np.clip(place - low, 0.0, 1.0)[:, None, None]
            found[b] = (1 - share) * caps[b, low] + share * caps[b, high] + up - run.observed[frame]
        return found, longer

    def _flown(self, window: Window, points: np.ndarray) -> ClosedLoopRun:
        import torch

        from r2s2r_cli.engine import EngineError
        from r2s2r_cli.engine.closed_loop import closed_loop
        from r2s2r_cli.engine.flat import pack_state, unpack_state

        mapping = self.predictor.mapping
        x = torch.as_tensor(self._values(points))
        targets = torch.as_tensor(window.run.intervals.target[np.array(window.intervals[: _count(window)]) - 1])
        none = torch.zeros(len(targets), dtype=torch.float64)
        self.predictor.rollouts += len(points)
        # Where only the controller's numbers are free, nothing else says how many there are.
        structure = self.predictor.structure
        state = unpack_state(structure, pack_state(structure, window.state).expand(len(points), -1))
        try:
            with torch.no_grad():
                return closed_loop(
                    self.predictor.simulator, mapping.theta(x), state, mapping.pid(x), targets, none,
                    none + mapping.robot.pid.step_timeout_s, step=self.predictor.step,
                )  # fmt: skip
        except EngineError as error:
            raise refused(error, self.windows) from error

    def _values(self, points: np.ndarray) -> np.ndarray:
        return np.array([values_of(self.frees, point) for point in points]).reshape(len(points), len(self.frees))


def _count(window: Window) -> int:
    """How many of its intervals have a frame to compare."""
    return int(window.place.max()) + 1


def _begins(window: Window) -> np.ndarray:
    """Time of the first frame of each of them [s]."""
    numbers = np.array(window.intervals[: _count(window)])
    return np.asarray(window.run.t[window.run.intervals.first[numbers - 1]])


def _ends(window: Window) -> np.ndarray:
    """Time of the last frame of each that counts [s]: where the robot tips over, that before."""
    last = np.searchsorted(window.place, np.arange(_count(window)), side="right") - 1
    return np.asarray(window.run.t[window.frames[last]])


def _took(window: Window) -> np.ndarray:
    """How long each of them took [s]: until the next began, the last of a run until its last frame."""
    run = window.run
    following = np.append(run.t[run.intervals.first[1:]], run.t[run.intervals.last[-1]])
    took = following[np.array(window.intervals[: _count(window)]) - 1] - _begins(window)
    took[-1] = min(took[-1], np.inf if _whole(window) else _ends(window)[-1] - _begins(window)[-1])
    return np.asarray(took)


def _whole(window: Window) -> bool:
    """Whether no tip-over cuts its last interval."""
    last = window.intervals[_count(window) - 1]
    return bool(window.frames[-1] == window.run.intervals.last[last - 1])
