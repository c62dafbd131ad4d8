"""Replayed intervals as what is written down: their end caps, and whether their residuals are white."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.found import FreeRunFound, SegmentFound
from r2s2r_cli.stages.identify.judged import Replayed
from r2s2r_cli.stages.identify.repeating import Repeats
from r2s2r_cli.stages.identify.trust.whiteness import whiteness
from r2s2r_cli.stages.measures.replay import observed_run
from r2s2r_cli.stages.measures.steps import chains


def segments_found(made: Replayed, *, seed: int = 0) -> tuple[SegmentFound, ...]:
    """The steps with their end caps, and whether the residuals of each cap are white along each of them.

    The frame of the start takes no part in that: its simulated caps were filtered with it. A cap of a step with too few
    frames behind it has lag1 NaN and counts as white.
    """
    if not made.steps:
        return ()
    caps = made.steps[0].p_WE.shape[1]
    residual = [(path - step.p_WE)[1:] for step, path in zip(made.steps, made.simulated, strict=True)]
    rows = np.concatenate([one.reshape(-1, 3) for one in residual])
    series = np.concatenate([np.tile(k * caps + np.arange(caps), len(one)) for k, one in enumerate(residual)])
    t = np.concatenate([np.repeat(step.t[1:], caps) for step in made.steps])
    judged = whiteness(rows, series, t, seed=seed)
    lag1 = np.full((len(made.steps), caps), np.nan)
    white = np.ones((len(made.steps), caps), dtype=bool)
    # A step of one frame has no series.
    lag1.flat[judged.series], white.flat[judged.series] = judged.lag1, judged.white
    return tuple(
        SegmentFound(step, simulated, lag1[k], white[k])
        for k, (step, simulated) in enumerate(zip(made.steps, made.simulated, strict=True))
    )


def free_runs_found(
    made: Replayed, closed: tuple[np.ndarray, ...] = (), repeats: Repeats | None = None
) -> tuple[FreeRunFound, ...]:
    """The free runs, chain by chain. closed: the same with the controller in the loop, (frame, cap, 3) [m] of every
    chain, or none. repeats: the same with what repeats."""
    found = []
    predicted = () if repeats is None or repeats.made is None else repeats.made.predicted.free
    for k, (chain, simulated) in enumerate(zip(chains(made.steps), made.free, strict=True)):
        t, observed = observed_run(chain)
        found.append(FreeRunFound(chain[0].run, t, observed, simulated, closed[k] if closed else None,
                                  predicted[k] if predicted else None))  # fmt: skip
    return tuple(found)
