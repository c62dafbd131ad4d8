"""Noise of the observed caps that the smoother may trust."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.frames import noise_sd
from r2s2r_cli.stages.import_.run import HELD

MIN_NOISE = 1e-5
"""[m] Far below every tracker. Exact (simulated) tracks count as that good, no better: beyond, rounding decides."""


def observation_noise(t: np.ndarray, p_WE: np.ndarray, caps: Group, *, where: str) -> tuple[np.ndarray, np.ndarray]:
    """Noise per cap and axis [m], shape (cap, 3), and which coordinates the source held, bool, same shape.

    t, p_WE: kept frames. The noise is that of the recording (`noise_sd` of `stages/frames.py`), measured here where the
    recording has none. A coordinate far quieter than the others was held by the source (on the real crawl the
    tracker's ground constraint pins the height of cap 5 to 0.1 mm); it is not as good as it is quiet, it says what the
    source assumed. The median of the run stands in for its noise. No noise is below MIN_NOISE.
    Raises NumericalError where the noise cannot be told.
    """
    sd = caps["noise_sd"] if "noise_sd" in caps else noise_sd(t, p_WE)
    if not np.all(np.isfinite(sd)):
        raise NumericalError(
            "the noise of the end caps is not known",
            where=f"{where}/noise_sd",
            expected="a finite standard deviation per cap and axis",
            received=f"{int(np.sum(~np.isfinite(sd)))} of {sd.size} are not finite",
            hint="r2s2r validate 10-record.h5   # says what is wrong with the recording",
        )
    typical = float(np.median(sd))
    held = sd < HELD * typical
    return np.maximum(np.where(held, typical, sd), MIN_NOISE), held
