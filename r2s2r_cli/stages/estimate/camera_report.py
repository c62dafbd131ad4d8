"""What `estimate` reports about a run of camera images."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.estimate.motion.data import SEEN
from schemas.estimate import MODE
from schemas.results_estimate import CameraFigures, CapSight, SensorFigures

if TYPE_CHECKING:
    from r2s2r_cli.stages.estimate.camera_run import CameraFacts
    from r2s2r_cli.stages.estimate.run import RunState

LOST, BLIND, NO_PICTURE = 8, 4, 16
SELDOM = 0.5
"""A cap that was seen in a smaller share of the frames is worth a warning."""
OFF = (0.5, 2.0)
"""Residuals beyond these, in standard deviations, say that the noise is not what it is taken for."""


def camera_figures(state: RunState, facts: CameraFacts) -> CameraFigures:
    """Figures of one run."""
    tracked, swept, ground = facts.tracked, facts.swept, facts.survey.ground
    mode = tracked.mode
    clock = tracked.clock
    return CameraFigures(
        height_m=float(facts.X_WC[2, 3]),
        tilt_rad=float(np.arccos(np.clip(-facts.X_WC[2, 2], -1.0, 1.0))),
        plane_share=None if ground is None else float(ground.share),
        depth_noise_sd_m=None if ground is None else float(ground.noise_sd),
        shift_px=(float(facts.survey.shift_px[0]), float(facts.survey.shift_px[1])),
        noise_scale=(float(tracked.noise_scale[0]), float(tracked.noise_scale[1])),
        begun_t_s=float(state.t[swept.first]),
        searched=int(np.sum(swept.searched)),
        modes={words: int(np.sum(mode & bit > 0)) for bit, words in MODE.items() if np.any(mode & bit)},
        sight=tuple(_sight(state.t, facts, cap) for cap in range(mode_caps(facts))),
        sensors=_sensors(facts),
        delay_s=float(clock.delay_s) if clock.known else None,
        delay_sd_s=float(clock.sd_s) if clock.known else None,
        settled=bool(tracked.settled),
    )


def mode_caps(facts: CameraFacts) -> int:
    """How many caps there are."""
    return int(facts.tracked.quality.shape[1])


def camera_warnings(state: RunState, facts: CameraFacts) -> list[str]:
    """What a person should know, in words."""
    found = list(facts.survey.warnings)
    if facts.left_s is not None:
        found.append(f"the robot left the picture at {facts.left_s:.1f} s and did not come back: the states end there")
    n, mode = len(state.t), facts.tracked.mode
    for bit, words in ((LOST, "some cap is less certain than 30 mm"), (BLIND, "no cap is seen"),
                       (NO_PICTURE, "there is no picture")):  # fmt: skip
        if count := int(np.sum(mode & bit > 0)):
            found.append(f"in {count} of {n} frames {words}: frames/mode marks them")
    for cap in range(mode_caps(facts)):
        seen = float(np.mean(facts.tracked.quality[:, cap] == SEEN))
        if seen < SELDOM:
            found.append(f"end cap {cap} is seen in {seen:.0%} of the frames only")
    score = facts.tracked.score[facts.tracked.quality == SEEN]
    size = float(np.sqrt(np.nanmean(score**2))) if np.isfinite(score).any() else 1.0
    if not OFF[0] <= size <= OFF[1]:
        found.append(f"sightings and smoothed caps differ by {size:.1f} standard deviations: "
                     "the covariances are not right")  # fmt: skip
    dead = np.flatnonzero(facts.tracked.sensor_dead)
    if facts.readings is None:
        found.append(
            "the recording has no cable sensors: hidden caps are guessed from the rods alone, and whether the colours "
            "belong to the rods that robot.toml says cannot be told"
        )
    elif len(dead):
        cables = ", ".join(str(int(facts.readings.cable[i])) for i in dead)
        found.append(f"the sensors of cables {cables} contradict what is seen, or never speak: they are not used")
    if not facts.tracked.settled:
        found.append("the smoother had not settled when it was stopped: the last step still moved the caps")
    return found


def _sight(t: np.ndarray, facts: CameraFacts, cap: int) -> CapSight:
    seen = facts.tracked.quality[:, cap] == SEEN
    score = facts.tracked.score[seen, cap]
    score = score[np.isfinite(score)]
    return CapSight(
        cap=cap, seen=float(np.mean(seen)), rejected=int(np.sum(facts.tracked.quality[:, cap] > SEEN + 1)),
        hidden_longest_s=_longest(t, seen),
        residual_sd=float(np.sqrt(np.mean(score**2))) if len(score) else None,
    )  # fmt: skip


def _longest(t: np.ndarray, seen: np.ndarray) -> float:
    """Longest time between two sightings, or between one and an end of the run [s]; 0 where every frame has one."""
    stops = np.concatenate([[-1], np.flatnonzero(seen), [len(t)]])
    gaps = np.flatnonzero(np.diff(stops) > 1)
    last = len(t) - 1
    return max((float(t[min(stops[i + 1], last)] - t[max(stops[i], 0)]) for i in gaps), default=0.0)


def _sensors(facts: CameraFacts) -> tuple[SensorFigures, ...]:
    if facts.readings is None:
        return ()
    tracked = facts.tracked
    noise = tracked.sensor_noise_sd
    return tuple(
        SensorFigures(
            cable=int(cable), bias_m=float(np.mean(tracked.sensor_bias[:, i])),
            bias_sd_m=float(np.mean(tracked.sensor_bias_sd[:, i])),
            noise_sd_m=float(noise[i]) if np.isfinite(noise[i]) else None, dead=bool(tracked.sensor_dead[i]),
        )
        for i, cable in enumerate(facts.readings.cable)
    )  # fmt: skip
