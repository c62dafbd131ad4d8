"""Sensors that are off in a way that no law of the catalogue has.

A free-form rival without a simulator: every sensor has an offset of its own. Laws of the catalogue say what these have
in common: one sensor is off, all are by the same, or all by a share of what they read. What two of them together leave
is no error of the comparison where it is many times the errors of the offsets: sensors that talk across shift some of
their neighbours, and neither one nor all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Element, Finding

LEAST, LEAST_SD = 36.0, 3.5
"""Sum of squares [sd^2] that two laws must leave, and the largest of these offsets [sd]: many small ones are a camera
that sees all cables a little wrong. In `blind-b-13` and `-14` they leave 60 to 103 and 6.0 to 9.3 of sensors that talk
across (3 sets), 16 and 2.4 at most of everything else (174 sets)."""
LOUD_SD = 5.0
"""Of offsets that are told one by one."""
FEWEST = 4
"""Sensors: with fewer two laws explain anything."""


@dataclass(frozen=True)
class Stranger:
    """What the logs show that the catalogue has no law for. channel: where; element: of what kind; left: sum of squares
    that its laws leave [sd^2]; what: in words."""

    channel: str
    element: Element
    left: float
    what: str


def stranger(findings: Sequence[Finding], about: np.ndarray) -> Stranger | None:
    """Of the offsets of all sensors (findings `sensor_bias`), taken at lengths `about` (cable,) [m]; None where two
    laws explain them, or too few are known."""
    offsets = [one for one in findings if one.check == "sensor_bias" and one.element.index is not None]
    if len(offsets) < FEWEST:
        return None
    size = np.array([one.value - one.expected for one in offsets])
    sd = np.array([np.hypot(one.sd, one.expected_sd) for one in offsets])
    cables = [one.element.index or 0 for one in offsets]
    laws = np.concatenate([np.eye(len(size)), np.ones((1, len(size))), np.nan_to_num(about[cables])[None]])
    left = _left(size / sd, laws / sd)
    total = float(left @ left)
    if total < LEAST or np.abs(left).max() < LEAST_SD:
        return None
    loud = [k for k in np.argsort(-np.abs(size / sd)) if np.abs(size[k] / sd[k]) >= LOUD_SD]
    each = ", ".join(f"sensor {cables[k]} by {1e3 * size[k]:+.0f} mm" for k in sorted(loud, key=lambda k: cables[k]))
    what = f"off against the camera are {each}, neither one nor all alike: no effect of the catalogue is that"
    return Stranger("sensing", Element("sensor"), total, what)


def _left(y: np.ndarray, laws: np.ndarray) -> np.ndarray:
    """What the best two of some laws (law, n) leave of y (n,), both in sd."""
    best = y
    for pair in combinations(range(len(laws)), 2):
        own = laws[list(pair)].T
        left = y - own @ np.linalg.lstsq(own, y, rcond=None)[0]
        if left @ left < best @ best:
            best = left
    return best
