"""The gait that narrows the bound of `no_gap` most, where no gait tells candidates apart.

That there is no gap is a claim about a bound on the error at the ends of target intervals, which more intervals narrow;
those that end where the right simulator says they do, whatever its nuisances are within what is known of them. Where
a robot may tip over at one instant or another, even that one errs by decimetres, and the interval is left out of the
best share of them that the test looks at.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from r2s2r_cli.stages.diagnose.imagined import LONGEST, Targets, ends, imagined
from r2s2r_cli.stages.diagnose.next_apart import drawn_nuisances, pieces_at
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit


def narrowest(arena: Arena, base: Fit, gaits: Mapping[str, Targets], floor_m: float) -> tuple[str, int] | None:
    """Of gaits by name the one with most sure target intervals, and how many these are; of several the one whose
    intervals are surest. base: the refit nominal model. None where no gait has a sure one."""
    found = {name: ends_off(arena, base, imagined_targets, name=name) for name, imagined_targets in gaits.items()}
    sure = {name: int(np.sum(off <= floor_m)) for name, off in found.items()}
    best = max(sure, key=lambda name: (sure[name], -float(np.minimum(found[name], floor_m).mean())), default=None)
    return None if best is None or not sure[best] else (best, sure[best])


def ends_off(arena: Arena, base: Fit, targets: Targets, *, name: str) -> np.ndarray:
    """How far target intervals of a policy end from where the refit nominal model has them end, the farthest of some
    draws of its nuisances, each interval from where that model is at its beginning: root mean square over the caps [m],
    (interval,)."""
    policy, like = targets[:LONGEST], arena.many[0]
    whole = imagined(arena, policy, like=like, name=name)
    edges = sorted({min(edge, len(whole.t)) for edge in ends(arena, whole, like, policy)})
    p, drawn = len(arena.engine), drawn_nuisances(arena)
    z = np.repeat(base.z[None], 1 + len(drawn), axis=0)
    z[1:, :p] = np.clip(base.z[:p] + drawn, arena.lower[:p], arena.upper[:p])
    values = Fits(arena).values(base.hypothesis, z, np.repeat(base.x[None], len(z), axis=0))
    many = pieces_at(arena, whole, values[0], edges)
    last = np.array([sight.caps[:, -1] for sight in arena.replayer.seen(many, values)])
    apart = np.sqrt(np.mean(np.sum((last[:, 1:] - last[:, :1]) ** 2, axis=-1), axis=-1))
    return np.asarray(np.nan_to_num(apart, nan=np.inf).max(axis=1))
