"""What one frame says about the caps: centres with covariance, and why one is not seen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

SEEN, COLOR_ONLY, OUT_OF_VIEW, HIDDEN, DOUBTFUL, NO_PICTURE = range(6)
"""Codes of a cap in a frame. SEEN: from colour and depth. COLOR_ONLY: no depth on it, so its direction is measured and
its distance is the predicted one, with 0.1 m. OUT_OF_VIEW: predicted outside of the picture. HIDDEN: nothing of its
colour where it should be. DOUBTFUL: something of its colour that is no sphere of its radius, or too little of one.
NO_PICTURE: no colour picture, or a blank one.
"""


@dataclass(frozen=True)
class Sightings:
    """Caps seen in one frame, independent of the prediction that told where to look.

    p_C: centres in frame C [m], (cap, 3), NaN where not seen. cov_C: their covariance [m^2], (cap, 3, 3), NaN likewise.
    visible: share 0 .. 1 of each cap's disc that is seen in its colour, (cap,). code: uint8 (cap,), see `SEEN`.
    shift_px: where depth shows the caps minus where colour does [px], (2,) along u and v, mean over the caps with
    its covariance (2, 2), beyond the shift that was corrected already; NaN where depth cannot tell.
    """

    p_C: np.ndarray
    cov_C: np.ndarray
    visible: np.ndarray
    code: np.ndarray
    shift_px: np.ndarray = field(default_factory=lambda: np.full(2, np.nan))
    shift_cov_px: np.ndarray = field(default_factory=lambda: np.full((2, 2), np.nan))

    @property
    def seen(self) -> np.ndarray:
        """Caps with a centre, bool (cap,)."""
        return np.isfinite(self.p_C[:, 0])


@dataclass(frozen=True)
class Candidate:
    """A cap of a rod's colour found without prediction; which of the rod's two caps it is, nobody knows yet.

    p_C: centre in frame C [m] (3,). cov_C [m^2] (3, 3). visible: share of its disc that is seen.
    """

    rod: int
    p_C: np.ndarray
    cov_C: np.ndarray
    visible: float
