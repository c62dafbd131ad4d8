"""What was simulated a moment ago is not simulated again.

A sixth of what fits ask for they have just asked for: a step that changed nothing, starts that are where they were, a
fit's own place among those that it is tried with.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.looks import Seen, joined

MOST_BYTES = 64 * 2**20
"""Of what is kept: all of the last iteration or two of some twenty fits."""


class Recent:
    """Answers of whole batches, the oldest forgotten first. An answer is found by the digest of all that it hangs on
    (`digests`)."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most, self._bytes = most_bytes, 0
        self._places: dict[bytes, tuple[Sequence[Seen], int]] = {}
        self._batches: deque[tuple[list[bytes], int]] = deque()

    def known(self, names: Sequence[bytes]) -> np.ndarray:
        """Which of these answers are kept, (k,). They are until it is asked again."""
        while self._bytes > self._most:
            old, size = self._batches.popleft()
            self._bytes -= size
            for name in old:
                self._places.pop(name, None)
        return np.array([name in self._places for name in names])

    def keep(self, names: Sequence[bytes], seen: Sequence[Seen]) -> None:
        """The answers of new hypotheses, whose names these are; seen: of every stretch."""
        size = sum(part.nbytes for one in seen for part in vars(one).values())
        self._batches.append((list(names), size))
        self._bytes += size
        self._places.update({name: (seen, j) for j, name in enumerate(names)})

    def of(self, names: Sequence[bytes]) -> list[Seen]:
        """Of every stretch what these hypotheses see. All of them are kept."""
        places = [self._places[name] for name in names]
        sources = {id(seen): seen for seen, _ in places}
        first = places[0][0]
        if len(sources) == 1 and [j for _, j in places] == list(range(len(first[0].caps))):
            return list(first)
        rows = {key: [i for i, (seen, _) in enumerate(places) if id(seen) == key] for key in sources}
        picked = [(seen, [places[i][1] for i in rows[key]]) for key, seen in sources.items()]
        order = np.argsort(np.concatenate([rows[key] for key in sources]))
        return [joined([seen[k].of(own) for seen, own in picked]).of(order) for k in range(len(first))]


def digests(about: Sequence[object], *numbers: np.ndarray) -> list[bytes]:
    """Names of the answers to k questions: `about` them all, and the rows of numbers (k, ...)."""
    same = hashlib.blake2b(repr(about).encode(), digest_size=16)
    found = []
    for rows in zip(*numbers, strict=True):
        own = same.copy()
        for row in rows:
            own.update(row.tobytes())
        found.append(own.digest())
    return found
