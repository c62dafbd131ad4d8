"""The gait that narrows the bound of `no_gap` most, where no gait tells candidates apart.

That there is no gap is a claim about a bound on the error at the ends of target intervals, which more intervals narrow:
those that end where the right simulator says they do, whatever its nuisances are within what is known of them. Where
a robot may tip over at one instant or another, even that one errs by decimetres, and the interval is left out of the
best share of them that the test looks at. And those in which the robot moves about as far as it did: where it hardly
moves no simulator is wrong, and the claim would be made about less than it says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.imagined import LONGEST, Targets, ends, imagined
from r2s2r_cli.stages.diagnose.next_apart import drawn_about, pieces_at
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.measures.keyframes import frame_rmse

LEAST_WAY = 0.25
"""Share of the fitted intervals in which the robot moves less than it must in one that counts."""


def narrowest(arena: Arena, base: Fit, gaits: Mapping[str, Targets], floor_m: float) -> tuple[str, int] | None:
    """Of gaits by name the one with most target intervals that count, and how many these are; of several the one whose
    intervals are surest. base: the refit nominal model. None where no gait has one."""
    least = float(np.quantile(ways(arena, base, arena.whole), LEAST_WAY))
    found = {name: ends_off(arena, base, targets, name=name, least_m=least) for name, targets in gaits.items()}
    sure = {name: int(np.sum(off <= floor_m)) for name, off in found.items()}
    best = max(sure, key=lambda name: (sure[name], -float(np.minimum(found[name], floor_m).mean())), default=None)
    return None if best is None or not sure[best] else (best, sure[best])


def ways(arena: Arena, base: Fit, many: Sequence[Stretch]) -> np.ndarray:
    """How far the caps move in stretches, as the refit nominal model has it: root mean square [m], (stretch,)."""
    values = Fits(arena).values(base.hypothesis, base.z[None], base.x[None])
    return _moved([one.caps for one in arena.replayer.seen(many, values)])


def ends_off(arena: Arena, base: Fit, targets: Targets, *, name: str, least_m: float) -> np.ndarray:
    """How far target intervals of a policy end from where the refit nominal model has them end, the farthest of some
    draws of its nuisances, each interval from where that model is at its beginning: root mean square over the caps [m],
    (interval,); infinite where the caps move by less than `least_m`."""
    policy, like = targets[:LONGEST], arena.many[0]
    whole = imagined(arena, policy, like=like, name=name)
    edges = sorted({min(edge, len(whole.t)) for edge in ends(arena, whole, like, policy)})
    drawn = drawn_about(arena, base)
    z = np.concatenate([base.z[None], drawn])
    values = Fits(arena).values(base.hypothesis, z, np.repeat(base.x[None], len(z), axis=0))
    many = pieces_at(arena, whole, values[0], edges)
    caps = [sight.caps for sight in arena.replayer.seen(many, values)]
    last = np.array([one[:, -1] for one in caps])  # (interval, draw, cap, 3), without a draw first
    off = frame_rmse(np.repeat(last[:, :1], len(drawn), axis=1), last[:, 1:])
    off = np.nan_to_num(off, nan=np.inf).max(axis=1)
    return np.where(_moved(caps) >= least_m, off, np.inf)


def _moved(caps: Sequence[np.ndarray]) -> np.ndarray:
    """Of stretches, the first row of each (k, F, cap, 3) [m], (stretch,)."""
    return frame_rmse(np.array([one[0, 0] for one in caps]), np.array([one[0, -1] for one in caps]))
