"""A replayer that remembers: what was simulated before an interruption is not simulated again.

A diagnosis asks for the same simulations in the same order whenever it begins anew, so that with the results of those
that were done it ends where it would have ended.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.checkpoint import Answers
from r2s2r_cli.stages.diagnose.which.looks import Seen
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.stretches import Stretch

if TYPE_CHECKING:
    from r2s2r_cli.engine import State


class Remembered(Replayer):
    """A `Replayer` that looks into a checkpoint first. rollouts counts what was simulated before as well."""

    def __init__(self, model: Model, checkpoint: Answers, **how: object) -> None:
        super().__init__(model, **how)
        self._checkpoint = checkpoint

    def seen(
        self, many: Sequence[Stretch], values: np.ndarray, by: Sequence[np.ndarray] | None = None
    ) -> list[Seen]:  # fmt: skip
        """As `Replayer`."""
        return self._views("seen", many, [values, *(by or ())], lambda: Replayer.seen(self, many, values, by))

    def around(self, many: Sequence[Stretch], values: np.ndarray, by: Sequence[np.ndarray]) -> list[Seen]:
        """As `Replayer`."""
        return self._views("around", many, [values, *by], lambda: Replayer.around(self, many, values, by))

    def finals(self, many: Sequence[Stretch], values: np.ndarray) -> State:
        """As `Replayer`."""
        import torch

        from r2s2r_cli.engine.flat import pack_state, unpack_state

        def made() -> list[np.ndarray]:
            return [pack_state(self.structure, Replayer.finals(self, many, values)).numpy()]

        (flat,) = self._answer("finals", many, [values], made)
        return unpack_state(self.structure, torch.as_tensor(flat))

    def _views(
        self, question: str, many: Sequence[Stretch], numbers: Sequence[np.ndarray], made: Callable[[], list[Seen]]
    ) -> list[Seen]:
        flat = self._answer(
            question,
            many,
            numbers,
            lambda: [part for one in made() for part in (one.caps, one.length, one.begin, one.end)],
        )
        return [Seen(*flat[k : k + 4]) for k in range(0, len(flat), 4)]

    def _answer(
        self, question: str, many: Sequence[Stretch], numbers: Sequence[np.ndarray],
        made: Callable[[], Sequence[np.ndarray]],
    ) -> list[np.ndarray]:  # fmt: skip
        digest = self._digest(question, many, numbers)
        known = self._checkpoint.recall(digest)
        if known is not None:
            count, *arrays = known
            self.rollouts += int(count)
            return arrays
        before = self.rollouts
        found = [np.asarray(one, order="C") for one in made()]  # sums depend on how numbers lie in memory
        self._checkpoint.keep(digest, [np.array(self.rollouts - before), *found])
        return found

    def _digest(self, question: str, many: Sequence[Stretch], numbers: Sequence[np.ndarray]) -> bytes:
        """Of what is asked: which stretches from which starts, at which numbers."""
        from r2s2r_cli.engine.flat import pack_state

        found = hashlib.sha256(question.encode())
        for one in numbers:
            found.update(repr(np.shape(one)).encode() + np.ascontiguousarray(one).tobytes())
        for stretch in many:
            found.update(repr((stretch.run, stretch.interval, stretch.piece, stretch.margin, stretch.goes_on)).encode())
            found.update(pack_state(self.structure, stretch.window.state).numpy().tobytes())
            found.update(b"" if stretch.taut is None else stretch.taut.tobytes())
        return found.digest()
