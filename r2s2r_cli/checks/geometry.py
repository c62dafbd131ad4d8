"""Observed and estimated end caps: do they make this robot, on this ground?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Run, robot_sizes

ROD_LENGTH_TOLERANCE = 0.05
"""Relative; as the setting `import.rod_length_tolerance`: beyond it is another robot or another unit."""
ROD_LENGTH_SD_M = 0.010
"""Trackers have 1-4 mm of noise per axis, so a distance spreads by at most 6 mm; above 10 mm caps were swapped."""
GROUND_ALLOWANCE_M = 0.010
"""Twice the 4-5 mm by which ground planes of real recordings are off."""
ALLOWANCE_SD = 5.0
"""A coordinate this many standard deviations off is not noise: once in 1.7 million samples."""
SPEED_MAX_M_PER_S = 5.0
"""A cap falling from 1 m reaches 4.4 m/s; a crawling robot stays below 1 m/s."""
_FRAMES = ("recording", "estimate", "simulation")


@check(
    "error",
    Run,
    kinds=_FRAMES,
    what="the run has as many caps, rods and cables as the robot",
    why="index i must mean the same cap or cable everywhere; without it no other comparison with the robot is made",
    fix=f"{AGAIN}   # first set robot in project.toml to the description of this robot",
)
def counts_match_robot(run: Run) -> Iterator[Found]:
    """Axes whose length is not the robot's."""
    if run.project_robot is not None:
        wanted = robot_sizes(run.project_robot)
        for axis, size in run.sizes.items():
            if size != wanted[axis]:
                yield Found(run.at(""), f"the run has another number of {_PLURAL[axis]} than the robot",
                            f"{wanted[axis]} of robot {run.project_robot.name}", str(size))  # fmt: skip


@check(
    "error",
    Run,
    kinds=("recording",),
    what="every cap of every kept frame was observed",
    why="a frame counts only with all its caps; a missing one belongs among the dropped frames",
    fix=f"{AGAIN}   # import marks such frames as dropped",
)
def kept_frames_observed(run: Run) -> Iterator[Found]:
    """NaN in frames that count."""
    if run.p_WE is not None:
        location, p = run.p_WE
        missing = np.isnan(p).any(axis=-1).astype(float)
        if missing.any():
            yield Found(location, "a kept frame has a cap that was not observed", "all caps, or a drop_reason",
                        worst(np.where(missing, np.nan, 0.0), missing, ("kept frame", "cap")))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_FRAMES,
    what="the median distance of the caps of each rod is the robot's rod length within 5 %",
    why="another length is another robot, another unit, or swapped caps",
    fix="compare rods.length_m in robot.toml (cap centre to cap centre) with the robot and with the unit of the source",
)
def rod_length_is_the_robots(run: Run) -> Iterator[Found]:
    """Rods of another length."""
    if run.robot is None or run.p_WE is None or not len(run.p_WE[1]):
        return
    location, p = run.p_WE
    for rod, expected in enumerate(run.robot.rods):
        length = float(np.median(_lengths(p, rod)))
        if abs(length / expected.length_m - 1) > ROD_LENGTH_TOLERANCE:
            yield Found(location, f"rod {rod} ({expected.name}) has another length than in robot.toml",
                        f"{number(expected.length_m, 1e3)} mm within 5 %", f"{number(length, 1e3)} mm")  # fmt: skip


@check(
    "warning",
    Run,
    kinds=("recording",),
    what="the observed length of each rod stays the same within 10 mm (standard deviation)",
    why="rods are rigid: a length that changes is a tracker that confuses caps",
    fix=f"{AGAIN}   # first leave out in the source the frames in which caps were confused",
)
def rods_keep_their_length(run: Run) -> Iterator[Found]:
    """Rods whose length wanders."""
    if run.p_WE is None or len(run.p_WE[1]) < 2:
        return
    location, p = run.p_WE
    for rod in range(p.shape[1] // 2):
        sd = float(np.std(_lengths(p, rod)))
        if sd > ROD_LENGTH_SD_M:
            yield Found(location, f"the length of rod {rod} changes from frame to frame",
                        f"standard deviation of at most {number(ROD_LENGTH_SD_M, 1e3)} mm",
                        f"{number(sd, 1e3)} mm")  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_FRAMES,
    what="the distance of the caps of every cable stays within the robot's limits",
    why="a healthy robot never leaves them: a jump of the tracker, or limits that are not this robot's",
    fix="look at the named frame in the source; if it is right, widen [limits] in robot.toml",
)
def cable_lengths_in_limits(run: Run) -> Iterator[Found]:
    """Cable lengths that the robot cannot have."""
    if run.robot is None or run.p_WE is None:
        return
    location, p = run.p_WE
    limits = run.robot.limits
    for index, cable in enumerate(run.robot.cables):
        length = np.linalg.norm(p[:, cable.caps[1]] - p[:, cable.caps[0]], axis=-1)
        outside = beyond(length, limits.cable_length_min_m, limits.cable_length_max_m)
        if (outside > 0).any():
            low, high = number(limits.cable_length_min_m, 1e3), number(limits.cable_length_max_m, 1e3)
            yield Found(location, f"cable {index} has a length that the robot cannot have", f"{low} .. {high} mm",
                        worst(length, outside, (run.frame,), scale=1e3, unit="mm"))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_FRAMES,
    what="no cap lies below the ground by more than 10 mm and five standard deviations of its noise",
    why="the world frame is not z up with the ground at 0, the heights are of another unit, or the robot sank in",
    fix="give the heights above the ground in the source, z up; what is left is fitted with the states",
)
def caps_above_ground(run: Run) -> Iterator[Found]:
    """Caps in the ground. In a recording the ground is where the lowest caps lie on average."""
    bottom = _bottom_height(run)
    if bottom is not None and run.p_WE is not None:
        below = np.maximum(-bottom - np.maximum(GROUND_ALLOWANCE_M, ALLOWANCE_SD * _height_sd(run, bottom)), 0.0)
        if (below > 0).any():
            yield Found(run.p_WE[0], "a cap lies below the ground", "the lowest point of every cap at 0 mm or above",
                        worst(bottom, below, (run.frame, "cap"), scale=1e3, unit="mm"))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_FRAMES,
    what="no cap is higher above the ground than the robot can lift it",
    why="a tracker that jumped, a height in another unit, or an axis that is not z",
    fix="look at the named frame in the source; if it is right, raise limits.cap_height_max_m in robot.toml",
)
def caps_below_ceiling(run: Run) -> Iterator[Found]:
    """Caps in the air."""
    bottom = _bottom_height(run)
    if bottom is not None and run.robot is not None and run.p_WE is not None:
        centre = bottom + _cap_radius(run)
        limit = run.robot.limits.cap_height_max_m
        above = np.maximum(centre - limit - np.maximum(GROUND_ALLOWANCE_M, ALLOWANCE_SD * _height_sd(run, bottom)), 0.0)
        if (above > 0).any():
            yield Found(run.p_WE[0], "a cap is higher than the robot can lift it",
                        f"at most {number(limit, 1e3)} mm above the ground",
                        worst(centre, above, (run.frame, "cap"), scale=1e3, unit="mm"))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=("recording",),
    what="no cap moves faster than 5 m/s between two kept frames",
    why="the tracker jumped, or the stamps are of another unit",
    fix="look at the named frame in the source; jumps are marked with the states, and not used",
)
def caps_move_like_a_robot(run: Run) -> Iterator[Found]:
    """Jumps between frames."""
    if run.p_WE is None or run.stamps is None or len(run.p_WE[1]) < 2:
        return
    location, p = run.p_WE
    gap = np.diff(run.stamps[1])
    step = np.linalg.norm(np.diff(p, axis=0), axis=-1)
    speed = step / np.where(gap > 0, gap, np.nan)[:, None]
    fast = beyond(speed, 0.0, SPEED_MAX_M_PER_S)
    if (fast > 0).any():
        yield Found(location, "a cap jumps on the way to the next kept frame", f"at most {SPEED_MAX_M_PER_S:g} m/s",
                    worst(speed, fast, (run.frame, "cap"), unit="m/s"))  # fmt: skip


_PLURAL = {"cap": "end caps", "rod": "rods", "cable": "cables", "actuated": "actuated cables"}


def _lengths(p: np.ndarray, rod: int) -> np.ndarray:
    """Distances of the caps of one rod [m] in the frames that have both; one NaN where none has."""
    length = np.linalg.norm(p[:, 2 * rod + 1] - p[:, 2 * rod], axis=-1)
    seen = length[np.isfinite(length)]
    return seen if len(seen) else np.array([np.nan])


def _cap_radius(run: Run) -> np.ndarray:
    robot = run.robot
    return np.zeros(1) if robot is None else np.repeat([rod.cap_radius_m for rod in robot.rods], 2)


def _bottom_height(run: Run) -> np.ndarray | None:
    """Height of the lowest point of every cap above the ground [m], (frame, cap); None without robot or caps."""
    if run.robot is None or run.p_WE is None:
        return None
    offset = run.attribute("caps", "ground_offset") or 0.0
    return np.asarray(run.p_WE[1][..., 2] + offset - _cap_radius(run))


def _height_sd(run: Run, like: np.ndarray) -> np.ndarray:
    """Standard deviation of the heights [m], (frame, cap) or (cap,); 0 where it is not known."""
    noise = run.array("caps", "noise_sd")
    if noise is not None:
        return np.nan_to_num(noise[:, 2])
    covariance = run.array("frames", "cov_p_WE")
    if covariance is not None:
        return np.sqrt(np.maximum(covariance[..., 2, 2], 0.0))
    return np.zeros(like.shape)
