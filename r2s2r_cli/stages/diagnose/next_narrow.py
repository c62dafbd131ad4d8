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
from r2s2r_cli.stages.diagnose.next_apart import drawn_nuisances, pieces_at
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.stretches import Stretch

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
    seen = arena.replayer.seen(many, values)
    return np.array([float(_rms(one.caps[0, -1] - one.caps[0, 0])) for one in seen])


def ends_off(arena: Arena, base: Fit, targets: Targets, *, name: str, least_m: float) -> np.ndarray:
    """How far target intervals of a policy end from where the refit nominal model has them end, the farthest of some
    draws of its nuisances, each interval from where that model is at its beginning: root mean square over the caps [m],
    (interval,); infinite where the caps move by less than `least_m`."""
    policy, like = targets[:LONGEST], arena.many[0]
    whole = imagined(arena, policy, like=like, name=name)
    edges = sorted({min(edge, len(whole.t)) for edge in ends(arena, whole, like, policy)})
    p, drawn = len(arena.engine), drawn_nuisances(arena)
    z = np.repeat(base.z[None], 1 + len(drawn), axis=0)
    z[1:, :p] = np.clip(base.z[:p] + drawn, arena.lower[:p], arena.upper[:p])
    values = Fits(arena).values(base.hypothesis, z, np.repeat(base.x[None], len(z), axis=0))
    many = pieces_at(arena, whole, values[0], edges)
    caps = [sight.caps for sight in arena.replayer.seen(many, values)]
    off = np.array([float(np.nan_to_num(_rms(one[1:, -1] - one[:1, -1]), nan=np.inf).max()) for one in caps])
    way = np.array([float(_rms(one[0, -1] - one[0, 0])) for one in caps])
    return np.where(way >= least_m, off, np.inf)


def _rms(way: np.ndarray) -> np.ndarray:
    """Over the caps, of (..., cap, 3)."""
    return np.asarray(np.sqrt(np.mean(np.sum(way**2, axis=-1), axis=-1)))
