"""How far an effect will move the robot on the judged intervals, before anything that was seen there is looked at.

Their targets are inputs, known as soon as the policy is chosen. Another gait says little of what an effect does under
these: a payload counts where the robot tips, a slow motor where that motor runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.diagnose.imagined import ends, imagined, part, targets_of
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.starting import LOST_M


def ahead(
    arena: Arena, targets: np.ndarray, numbers: Sequence[int], truth: np.ndarray, other: np.ndarray, *, name: str = ""
) -> np.ndarray:
    """Caps of `other` minus those of `truth`, values (n,) of the model, at the ends of the target intervals `numbers`
    (1-based) of a run `name` with targets (interval, actuated): (begin, interval, cap, 3) [m], at most LOST_M by axis.

    The run is driven by an ideal controller, with the truth as the robot, from where each fitted run began: where one
    robot tips hangs on millimetres, and nobody knows yet how this one will be put down. At each interval both models
    begin where the truth is then, as start states of judged intervals will be where the robot was seen.
    """
    wanted = targets_of(targets[: max(numbers)])
    begins = list({one.run: one for one in reversed(arena.many)}.values())
    parts, before = [], []
    for like in begins:
        whole = imagined(arena, wanted, like=like, name=name)
        edges = ends(arena, whole, like, wanted)
        for number in numbers:
            before.append(part(whole, 0, max(edges[number - 1], 1)))
            parts.append(replace(part(whole, edges[number - 1], edges[number]), interval=number))
    states = arena.replayer.finals(before, truth)
    for k, one in enumerate(parts):
        if one.window.first:
            parts[k] = replace(one, window=replace(one.window, state=states.select(k)))
    seen = arena.replayer.seen(parts, np.stack([truth, other]))
    truly, otherwise = (np.array([one.caps[k, -1] for one in seen]) for k in (0, 1))
    # Where the truth itself breaks off nothing is foretold: the other one errs by no more than it does.
    apart = np.where(np.isfinite(truly), np.nan_to_num(otherwise - truly, nan=LOST_M), 0.0)
    apart = np.clip(apart, -LOST_M, LOST_M)
    return np.asarray(apart.reshape(len(begins), len(numbers), *apart.shape[1:]))
