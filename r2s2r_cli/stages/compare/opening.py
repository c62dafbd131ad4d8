"""Where the policy of a run begins: at the end of the rest that runs open with.

A robot that was put down settles under its tendons, sometimes tips, in the rest shape, before the policy moves it. What
it does then is neither the policy's doing nor repeatable, so real and simulated run start where it is over
(the paper: before each trajectory the robot resets itself to the rest state, and the simulator is set to where it is).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.measures.align import planar
from r2s2r_cli.stages.segments import Intervals
from r2s2r_cli.stages.simulate.policies import Sequence


@dataclass(frozen=True)
class Opening:
    """What came before the policy. intervals: 1 where the run opens in the rest shape (all cables long), else 0.
    duration: of it [s]. moved: how far the caps moved in it, up to a move over the ground, root mean square [m];
    travel: how far the centre of mass came over the ground [m]."""

    intervals: int = 0
    duration: float = 0.0
    moved: float = 0.0
    travel: float = 0.0


def opening_of(walk: Walk) -> Opening:
    """Of a run as it was recorded, with one complete interval or more. Where the first frame is not known the motion is
    counted from the first one that is; NaN where there is none."""
    if not walk.intervals.opens_at_rest:
        return Opening()
    end = int(walk.intervals.last[0])
    known = np.flatnonzero(np.isfinite(walk.p_WE[: end + 1]).all(axis=(1, 2)))
    duration = float(walk.t[end] - walk.t[0])
    if not len(known):
        return Opening(1, duration, float("nan"), float("nan"))
    before, after = walk.p_WE[known[0]], walk.p_WE[known[-1]]
    away = planar(before, after).move(before) - after
    return Opening(
        1, duration, float(np.sqrt(np.mean(np.sum(away**2, axis=-1)))),
        float(np.linalg.norm((walk.share @ (after - before))[:2])),
    )  # fmt: skip


def without_opening(walk: Walk, opening: Opening) -> Walk:
    """The same from the last frame of the opening rest on: the robot still lies there, the next target is given."""
    if not opening.intervals:
        return walk
    begin = int(walk.intervals.last[0])
    kept = {name: value[1:] for name, value in vars(walk.intervals).items()}
    kept |= {name: kept[name] - begin for name in ("first", "last")}
    return replace(walk, t=walk.t[begin:], p_WE=walk.p_WE[begin:], intervals=Intervals(**kept))


def policy_part(targets: Sequence, opening: Opening) -> Sequence:
    """The targets that follow the opening rest."""
    if not opening.intervals:
        return targets
    rest = (targets.target == 1).all(axis=1)
    begin = int(np.argmin(rest))  # 0 where no target but the rest shape was given: such runs have no gait
    return Sequence(targets.target[begin:], targets.hold[begin:], targets.timeout[begin:])
