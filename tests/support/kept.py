"""A checkpoint of arrays in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np


@dataclass
class Kept:
    """Forgets from the first question that differs, as the one on disk."""

    answers: list[tuple[bytes, list[np.ndarray]]] = field(default_factory=list)
    at: int = 0

    def recall(self, digest: bytes) -> Sequence[np.ndarray] | None:
        """The next answer, if it is to this question."""
        if self.at < len(self.answers) and self.answers[self.at][0] == digest:
            self.at += 1
            return self.answers[self.at - 1][1]
        del self.answers[self.at :]
        return None

    def keep(self, digest: bytes, arrays: Sequence[np.ndarray]) -> None:
        """Append it."""
        self.answers.append((digest, [np.array(one) for one in arrays]))
        self.at += 1

    def after(self, count: int) -> Kept:
        """What a process finds that begins anew after one that died with so many answers."""
        return Kept(self.answers[:count])

    def again(self) -> Kept:
        """What it finds after one that died with all of them."""
        return self.after(len(self.answers))
