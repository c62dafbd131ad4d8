"""Whether a robot stands in its rest shape where the policy of a run begins.

A robot that was put down with a cable too short or too long may fall flat while it comes to rest: a policy that was
planned from rest means nothing then, and where a heap of rods goes no simulator can say.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from r2s2r_cli.stages.model import cap_distances
from r2s2r_cli.stages.segments import Intervals
from schemas.robot import Robot

FALLEN_M = 0.06
"""By so much a cable differs from its length at rest: several times what controller and sensors leave (20 mm)."""


def not_at_rest(p_WE: np.ndarray, intervals: Intervals, robot: Robot) -> str:
    """What is wrong at the end of the rest that a run opens with, in words; empty where nothing is, or where it opens
    with something else. p_WE: end caps of the run [m], (frame, cap, 3)."""
    if not intervals.opens_at_rest:
        return ""
    rest, now = cap_distances(robot), cap_distances(robot, p_WE[int(intervals.last[0])])
    off = np.nan_to_num(np.abs(now - rest))
    worst = int(np.argmax(off))
    if off[worst] < FALLEN_M:
        return ""
    return (
        "the robot did not stand as at rest when its policy began "
        f"(cable {worst} measures {1e3 * now[worst]:.0f} mm, {1e3 * rest[worst]:.0f} mm at rest)"
    )


def fallen(told: Mapping[str, str]) -> dict[str, str]:
    """The runs among these, by name, of which `not_at_rest` says something. None where it does of all: then robot.toml
    is wrong about its rest."""
    found = {run: words for run, words in told.items() if words}
    return {} if len(found) == len(told) else found
