"""Where stretches begin, what that changes of what is seen of them, and where the next one begins with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.links import FAR, Way, befores, followed
from r2s2r_cli.stages.diagnose.which.looks import Seen
from r2s2r_cli.stages.diagnose.which.stretches import Stretch, begun_at
from r2s2r_cli.stages.identify.offsets import displacement

if TYPE_CHECKING:
    from r2s2r_cli.engine import Structure

LOST_M = 0.25
"""A cap that is simulated so far from where it was is lost, and farther off is not worse."""


class Starting:
    """before: place of the stretch that ends where each begins, None: there is none; by_start: what one sd of each
    offset of its start changes, (offset, channel, F); settled (stretch, offset) [sd]: how far from where it was seen
    each begins; ways: from the stretches before."""

    def __init__(self, structure: Structure, many: Sequence[Stretch]) -> None:
        self.structure, self.before = structure, befores(many)
        self.sd = [one.start_sd for one in many]
        self.lasts = [one.until - one.window.start for one in many]
        self.offsets = next((len(own) for own in self.sd if own is not None), 0)
        self.settled = np.zeros((len(many), self.offsets))
        self.by_start: list[np.ndarray] = []
        self.by_settled: list[np.ndarray] = [np.zeros((1, 1)) for _ in many]
        self.ways: list[Way | None] = [None] * len(many)
        self._through: list[np.ndarray] = []

    def tried(self) -> list[np.ndarray]:
        """Offsets of every stretch that are simulated to learn what they change, none first, (1 + offset, offset)."""
        return [np.concatenate([np.zeros((1, len(own))), np.diag(own)]) for own in self.known]

    def learn(self, seen: Sequence[Seen]) -> None:
        """From what was seen of every stretch at `tried`."""
        self.by_start = [_responses(one) for one in seen]
        self._through = [self._apart(one.end[:1], one.end[1:]) for one in seen]
        self.ways = [self._way(k, np.zeros((0, self.offsets))) for k in range(len(seen))]
        self.by_settled = [np.einsum("o,ocf->cf", *both) for both in zip(self.settled, self.by_start, strict=True)]

    def roughen(self, k: int, rough: np.ndarray) -> None:
        """Adds what straight lines do not tell of the end (draw, offset) [sd] before a stretch."""
        self.ways[k] = self._way(k, np.clip(rough, -FAR, FAR) / np.sqrt(len(rough)))

    def moved(self, many: Sequence[Stretch], away: np.ndarray) -> tuple[Stretch, ...]:
        """The stretches begun so far (stretch, offset) [sd] away from where they did. What is known of the starts stays
        what it was."""
        self.settled = self.settled + away
        return tuple(
            begun_at(self.structure, one, by * own) if by.any() else one
            for one, by, own in zip(many, away, self.known, strict=True)
        )

    def ahead(
        self, k: int, own: Seen, before: Seen, by: np.ndarray | None = None, by_before: np.ndarray | None = None
    ) -> np.ndarray:  # fmt: skip
        """Where the stretch before ends, in sd of this one's start, (hypothesis, offset), along straight lines as if
        both began where they were seen. by, by_before (hypothesis, offset): where they did begin [sd]."""
        return self.led(k, self.apart([(own, before)])[0], by, by_before)

    def apart(self, pairs: Sequence[tuple[Seen, Seen]]) -> list[np.ndarray]:
        """From where each stretch begins to where the one before it ends, (hypothesis, offset) each, in the units of
        `offsets.displaced`."""
        if not pairs:
            return []
        both = [np.concatenate(one) for one in zip(*((own.begin, before.end) for own, before in pairs), strict=True)]
        return np.split(self._apart(*both), np.cumsum([len(own.begin) for own, _ in pairs[:-1]]))

    def led(
        self, k: int, apart: np.ndarray, by: np.ndarray | None = None, by_before: np.ndarray | None = None
    ) -> np.ndarray:  # fmt: skip
        """`ahead` of a stretch that is so far `apart` (hypothesis, offset) from the end of the one before it."""
        j, way = self.before[k], self.ways[k]
        assert j is not None and way is not None  # noqa: S101 - only of linked stretches
        found = apart / way.sd + self.settled[k] + (0.0 if by is None else by)
        behind = self.settled[j] + (0.0 if by_before is None else by_before)
        return followed(found - behind @ way.through.T, way.rods)

    @property
    def known(self) -> list[np.ndarray]:
        """Sd of every start, (offset,) each."""
        known = [own for own in self.sd if own is not None]
        assert len(known) == len(self.sd)  # noqa: S101 - whole intervals are never prepared, only pieces
        return known

    def _way(self, k: int, rough: np.ndarray) -> Way | None:
        j, own, rods = self.before[k], self.sd[k], self.structure.n_rods
        if j is None or own is None:
            return None
        return Way(j, followed(self._through[j] / own, rods).T, rough, self.by_start[k], own, self.lasts[j], rods)

    def _apart(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Offsets between flat states (k, NS), (k, offset), in the units of `offsets.displaced`."""
        import torch

        a, b = torch.as_tensor(one), torch.as_tensor(other)
        return displacement(self.structure, a.expand(len(b), -1), b).numpy()


def clipped(residual: np.ndarray) -> np.ndarray:
    """Residuals [m] of which none is worse than a lost cap."""
    return np.clip(np.nan_to_num(residual, nan=LOST_M), -LOST_M, LOST_M)


def _responses(seen: Seen) -> np.ndarray:
    """What moving a start by one sd changes in all channels, (offset, channel, F), from what was seen without and with
    each offset."""
    caps = seen.caps.reshape(*seen.caps.shape[:2], -1)
    both = np.concatenate([caps, seen.length], axis=-1).transpose(0, 2, 1)
    return clipped(both[1:] - both[:1])
