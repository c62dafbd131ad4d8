"""Where stages leave what they have done, so that an interruption does not cost it: two kinds, which `store` writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np


class Values(Protocol):
    """JSON values, replaced whole; what it loads was left by the same request: a `store.checkpoint.CheckpointFile`."""

    def load(self) -> dict[str, Any] | None:
        """What was saved last, or None."""
        ...

    def save(self, values: Mapping[str, Any]) -> None:
        """Replace what was saved."""


class Answers(Protocol):
    """Arrays, by the question that they answer, in the order of the questions: a
    `store.checkpoint_arrays.ArrayCheckpoint`."""

    def recall(self, digest: bytes) -> Sequence[np.ndarray] | None:
        """What was kept for the next question; None: it must be worked out."""

    def keep(self, digest: bytes, arrays: Sequence[np.ndarray]) -> None:
        """Keep the answer to the question that was not known."""
