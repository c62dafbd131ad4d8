"""Where stretches most likely began, by what is left of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.white import Alone, White, begun, rooted_alone

MOST_SD = 2.5
"""How far from where it is known to be a start may be moved, every coordinate in its sd."""


def likely_start(
    white: Sequence[White], raw: Sequence[np.ndarray] | Mapping[int, np.ndarray], k: int, offsets: int,
    alone: Alone | None = None,
) -> np.ndarray:  # fmt: skip
    """Of the stretch k that leaves raw residuals (hypothesis, n), under the kind of error that explains it best, in sd
    of its start as it was seen, (hypothesis, offset). offsets: how many there are; alone: as `white.rooted_alone`."""
    alone = {} if alone is None else alone
    own = white[k].residual(raw[k])
    squares, starts = [], []
    for c, kind in enumerate(white[k].kinds):
        link = kind.link
        if link is None:
            # Without a link the first kind is the second one.
            rooted = rooted_alone(white, raw, k, alone) if c < 2 else kind.rooted(own)
            start = kind.start(rooted)[:, :offsets]
        else:
            middle = begun(white, raw, k, alone)
            rooted = kind.rooted(own + link.shift(middle))
            start = middle + kind.start(rooted)[:, :offsets] @ link.root.T
        squares.append(np.sum(kind.off_start(rooted) ** 2, axis=1))
        starts.append(start)
    best = np.argmin(np.array(squares) + white[k].logdet[:, None], axis=0)
    return np.clip(np.array(starts)[best, np.arange(len(best))], -MOST_SD, MOST_SD)


def better_of(white: White, first: Sequence[np.ndarray], second: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Of two ways to see a stretch, white under each kind (hypothesis, channel F), for every hypothesis the one that
    costs less."""
    costs = [
        minus_log(np.stack([np.sum(one**2, axis=1) for one in kinds], axis=1), white.logdet, np.array(white.size))
        for kinds in (first, second)
    ]
    better = (costs[1] < costs[0])[:, None]
    return [np.where(better, other, one) for one, other in zip(first, second, strict=True)]
