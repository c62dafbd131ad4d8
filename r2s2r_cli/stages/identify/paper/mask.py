"""The paper's mask: segments whose duration contradicts that of the whole trajectory do not count."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.identify.paper.key_frames import KeyFrames

SAME = 1e-9
"""[s] durations this near are equal, whatever rounding made of them."""


@dataclass(frozen=True)
class Mask:
    """Which segments count: kept, (pair,), bool; words: what was decided, for people."""

    kept: np.ndarray
    words: str


def direction_mask(keys: KeyFrames, *, closed_loop: bool = True) -> Mask:
    """Keep the segments that agree with the whole trajectory (paper, Key Frame Loss, last paragraph).

    If the whole simulation takes less time than the whole real run, a segment in which it took more would speed it up
    further; it is left out, and the other way round. Segments of equal time contradict nothing. closed_loop False:
    durations are given with the commands, and say nothing. Where none would be left, all are kept.
    """
    every = np.ones(len(keys), dtype=bool)
    if not closed_loop:
        return Mask(every, "not applicable: command replay, durations are given")
    whole = keys.whole_sim - keys.whole_real
    if abs(whole) < SAME:
        return Mask(every, "the simulation takes as long as the real run: all segments kept")
    each = keys.took_sim - keys.took_real
    kept = each * np.sign(whole) > -SAME
    how = "longer" if whole > 0 else "less long"
    head = f"the simulation takes {abs(whole):.2f} s {how} than the real run"
    if not kept.any():
        return Mask(every, f"{head}, and no segment does: all segments kept")
    return Mask(kept, f"{head}: {int(kept.sum())} of {len(kept)} segments kept")
