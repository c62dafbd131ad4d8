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

LEAST, LEAST_SD = 36.0 / 7, 3.5
"""Sum of squares that two laws must leave, for each sensor that they do not fit anyway, and the largest of these [sd]:
many small ones are a camera that sees all cables a little wrong. Of nine sensors in `blind-b-13` and `-14` they
leave 60 to 103 and 6.0 to 9.3 where sensors talk across (3 sets), 16 and 2.4 at most of everything else (174 sets)."""
LAWS = 2
FEWEST = 4
"""Sensors: of fewer there is too little left to say."""
TOLD = 3
"""Offsets that are told, the largest, and every other one of LOUD_SD."""
LOUD_SD = 5.0


@dataclass(frozen=True)
class Stranger:
    """What the logs show that the catalogue has no law for. channel: where; element: of what kind; left: sum of squares
    that its laws leave [sd^2]; what: in words."""

    channel: str
    element: Element
    left: float
    what: str


def stranger(findings: Sequence[Finding], about: np.ndarray) -> Stranger | None:
    """Of the offsets of the sensors since the healthy runs (findings `sensor_bias`), taken at lengths `about` (cable,)
    [m]; None where two laws explain them, or too few are known. Those that no healthy run was compared with do not
    count: sensors that nobody calibrated are each off by their own."""
    offsets = {
        k: one for one in findings
        if one.check == "sensor_bias" and (k := one.element.index) is not None and one.differential
    }  # fmt: skip
    if len(offsets) < FEWEST:
        return None
    cables = list(offsets)
    size = np.array([one.value - one.expected for one in offsets.values()])
    sd = np.array([np.hypot(one.sd, one.expected_sd) for one in offsets.values()])
    laws = np.concatenate([np.eye(len(size)), np.ones((1, len(size))), np.nan_to_num(about[cables])[None]])
    left = _left(size / sd, laws / sd)
    total = float(left @ left)
    if total < LEAST * (len(size) - LAWS) or np.abs(left).max() < LEAST_SD:
        return None
    order = np.argsort(-np.abs(size / sd))
    told = [k for n, k in enumerate(order) if n < TOLD or np.abs(size[k] / sd[k]) >= LOUD_SD]
    each = ", ".join(f"sensor {cables[k]} by {1e3 * size[k]:+.0f} mm" for k in sorted(told, key=lambda k: cables[k]))
    what = f"off against the camera are {each}, neither one nor all alike: no effect of the catalogue is that"
    return Stranger("sensing", Element("sensor"), total, what)


def _left(y: np.ndarray, laws: np.ndarray) -> np.ndarray:
    """What the best two of some laws (law, n) leave of y (n,), both in sd."""
    best = y
    for pair in combinations(range(len(laws)), LAWS):
        own = laws[list(pair)].T
        left = y - own @ np.linalg.lstsq(own, y, rcond=None)[0]
        if left @ left < best @ best:
            best = left
    return best
