"""What a fit knows of the recorded runs: observations, smoothed states, commands, segments; and what it may use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.segments import Intervals, Segments


@dataclass(frozen=True)
class RunData:
    """One recorded run; frames are the kept frames, frame W has the ground at z = 0.

    t: (frame,) [s]. observed: end caps as the tracker gave them, moved on to the ground [m], (frame, cap, 3); noise:
    their sd [m], (cap, 3); observed_sd: that of each frame, of camera images, where caps may be hidden, (frame, cap,
    3), None: all are alike. p_WE, sd_p, v_WE, sd_v: smoothed end caps [m], [m/s] and sd per axis, (frame, cap, 3): they
    know later frames, so no test segment may start from them. quality: codes of schemas/estimate.py, (frame, cap).
    t_command: (row,) [s]; control, target: (row, actuated), a row holds until the next. intervals, segments: of the
    design. sampled: the rows are what the frames found in force, not the commands as they were sent. nature: what the
    recording is, in words, empty where it does not say. sensor_bias: reading minus length of every cable sensor, mean
    over the run as the camera shows it [m], (sensor,), NaN: dead; sensor_delay: how late they read [s], by the clock of
    the frames, None: not known. Both None where no camera looked. sensor_cable: the cable of each, (sensor,), None:
    those of robot.toml in their order.
    """

    name: str
    t: np.ndarray
    observed: np.ndarray
    noise: np.ndarray
    p_WE: np.ndarray
    sd_p: np.ndarray
    v_WE: np.ndarray
    sd_v: np.ndarray
    quality: np.ndarray
    t_command: np.ndarray
    control: np.ndarray
    target: np.ndarray
    intervals: Intervals
    segments: Segments
    sampled: bool = False
    nature: str = ""
    sensor_bias: np.ndarray | None = None
    sensor_delay: float | None = None
    sensor_cable: np.ndarray | None = None
    observed_sd: np.ndarray | None = None

    def sd_at(self, frames: np.ndarray | int, least: float = 0.0) -> np.ndarray:
        """Sd of the observed caps at some frames (..., cap, 3) [m]: the noise of the run, or what is known of the frame
        where that is more; no less than `least`."""
        run = np.maximum(self.noise, least)
        if self.observed_sd is None:
            return np.broadcast_to(run, (*np.shape(frames), *run.shape))
        return np.maximum(run, self.observed_sd[frames])


@dataclass(frozen=True)
class Selection:
    """Target intervals of one run, 1-based, ascending: `crawl:1-7` is Selection("crawl", (1, ..., 7))."""

    run: str
    intervals: tuple[int, ...]
