"""Robots in the engine, many at once: where they stand, and what became of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True)
class Standing:
    """Robots in the engine, one a row. s: flat states (B, NS); line: commands that are under way, newest last,
    (B, depth, actuated); draw: which drawn numbers each has, (B,); t: time since the start of the run, by which sensors
    drift, (B,) [s]."""

    s: Tensor
    line: Tensor
    draw: Tensor
    t: Tensor

    def __len__(self) -> int:
        return len(self.s)

    def take(self, rows: np.ndarray) -> Standing:
        """The same for some rows, repeats allowed."""
        import torch

        index = torch.as_tensor(np.asarray(rows, dtype=np.int64))
        return Standing(self.s[index], self.line[index], self.draw[index], self.t[index])


def stacked(parts: Sequence[Standing]) -> Standing:
    """Robots of several, one after the other."""
    import torch

    return Standing(*(torch.cat([getattr(part, name) for part in parts]) for name in ("s", "line", "draw", "t")))


@dataclass(frozen=True)
class Track:
    """One environment, tick by tick. s: flat states, the start included, (T + 1, NS); u: commands, (T, actuated);
    index: number of the target, (T,); done: latched after the tick, (T, actuated)."""

    s: Tensor
    u: Tensor
    index: Tensor
    done: Tensor


@dataclass(frozen=True)
class Executed:
    """What became of policies of up to S targets. ends: the robots when each target was left, S of them; ticks: control
    ticks until then, (B, S); given_up: at its timeout, (B, S); failed: the simulation left the finite numbers, (B,);
    counts: targets of each, (B,). What lies behind them is the start, and 0. tracks: where they were asked for."""

    ends: tuple[Standing, ...]
    ticks: np.ndarray
    given_up: np.ndarray
    failed: np.ndarray
    counts: np.ndarray
    tracks: tuple[Track, ...] = ()

    @property
    def last(self) -> Standing:
        """The robots when their last target was left."""
        return self.before_last(0)

    def before_last(self, back: int) -> Standing:
        """The robots so many targets before their last one was left; each has more targets than that."""
        import torch

        row, at = torch.arange(len(self.counts)), torch.as_tensor(self.counts - 1 - back)
        s, line, t = (torch.stack([getattr(end, name) for end in self.ends])[at, row] for name in ("s", "line", "t"))
        return Standing(s, line, self.ends[0].draw, t)

    @property
    def total(self) -> np.ndarray:
        """Ticks until the last target was left, (B,)."""
        return np.asarray(self.ticks[np.arange(len(self.counts)), self.counts - 1])

    @property
    def sound(self) -> np.ndarray:
        """Environments that reached all targets, (B,)."""
        return np.asarray(~self.given_up.any(axis=1) & ~self.failed)


def tracks(start: Tensor, kept: list[tuple[Tensor, ...]]) -> Iterator[Track]:
    """The ticks of every environment, of those of all of them."""
    import torch

    live = torch.cat([rows for rows, *_ in kept])
    columns = [torch.cat([tick[k] for tick in kept]) for k in range(1, 5)]
    for k in range(len(start)):
        s, u, index, done = (column[live == k] for column in columns)
        yield Track(torch.cat([start[k : k + 1], s]), u, index, done)
