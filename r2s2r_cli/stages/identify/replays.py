"""Replayed intervals as what is written down: their end caps, and whether their residuals are white."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.found import FreeRunFound, SegmentFound
from r2s2r_cli.stages.identify.judged import Replayed
from r2s2r_cli.stages.identify.trust.whiteness import whiteness
from r2s2r_cli.stages.measures.steps import chains


def segments_found(made: Replayed, *, seed: int = 0) -> tuple[SegmentFound, ...]:
    """The steps with their end caps, and whether the residuals of each cap are white along each of them."""
    if not made.steps:
        return ()
    caps = made.steps[0].p_WE.shape[1]
    residual = [simulated - step.p_WE for step, simulated in zip(made.steps, made.simulated, strict=True)]
    rows = np.concatenate([one.reshape(-1, 3) for one in residual])
    series = np.concatenate([np.tile(k * caps + np.arange(caps), len(one)) for k, one in enumerate(residual)])
    t = np.concatenate([np.repeat(step.t, caps) for step in made.steps])
    judged = whiteness(rows, series, t, seed=seed)
    lag1, white = judged.lag1.reshape(-1, caps), judged.white.reshape(-1, caps)
    return tuple(
        SegmentFound(step, simulated, lag1[k], white[k])
        for k, (step, simulated) in enumerate(zip(made.steps, made.simulated, strict=True))
    )


def free_runs_found(made: Replayed) -> tuple[FreeRunFound, ...]:
    """The free runs, chain by chain."""
    return tuple(
        FreeRunFound(
            run=chain[0].run,
            t=np.concatenate([step.t for step in chain]),
            observed=np.concatenate([step.p_WE for step in chain]),
            simulated=simulated,
        )
        for chain, simulated in zip(chains(made.steps), made.free, strict=True)
    )
