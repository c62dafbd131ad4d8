"""What happens to messages on their way, from `[wire]` of the world file. One `Channel` for each direction."""

from __future__ import annotations

import heapq

import numpy as np

from r2s2r_cli.rig.world import Wire

_GARBAGE = (1, 40)
"""Least and most bytes of garbage."""
_HELD_S = 0.1
"""A message that shall arrive after the next one waits no longer than this."""

Piece = tuple[float, int, bytes, int | None]


class Channel:
    """Messages in, bytes out, each at its time. Equal seeds and messages give equal bytes.

    stream: bytes keep their order, and a message may come in two parts; else each is a datagram of its own.
    still: time stands still within a message (lock-step), so there is no pause within a split one.
    """

    def __init__(self, wire: Wire, rng: np.random.Generator, *, stream: bool, still: bool = False) -> None:
        self._wire, self._rng, self._stream = wire, rng, stream
        self._pause = 0.0 if still else wire.pause_s
        self._heap: list[Piece] = []
        self._count = 0
        self._held: tuple[bytes, int | None, float] | None = None
        self._last_due = 0.0
        self._open = False
        self._clean = not any(getattr(wire, name) for name in type(wire).model_fields if name != "pause_s")

    def put(self, data: bytes, board: int | None, t: float, *, safe: bool = False) -> None:
        """A message sets out at time t [s]. safe: it arrives at once and whole, whatever the world file says."""
        if safe or self._clean:
            self._push(t, data, board)
            return
        wire = self._wire
        lost, swapped = self._rng.random() < wire.lost, self._rng.random() < wire.reorder
        if lost:
            return
        if swapped and self._held is None:
            self._held = (data, board, t)
            return
        self._deform(data, board, t)
        if self._held is not None:
            late, at, _ = self._held
            self._held = None
            self._deform(late, at, t)

    def take(self, t: float) -> list[tuple[bytes, int | None]]:
        """What has arrived by time t [s], in order."""
        if self._held is not None and t - self._held[2] >= _HELD_S:
            late, at, _ = self._held
            self._held = None
            self._deform(late, at, t)
        arrived = []
        while self._heap and self._heap[0][0] <= t:
            _, _, data, board = heapq.heappop(self._heap)
            arrived.append((data, board))
        return arrived

    def whole(self, data: bytes) -> bytes:
        """A safe message as it must be sent now: on a line of its own, whatever came before it."""
        return b"\n" + data if self._open else data

    def sent(self, data: bytes) -> None:
        """Note what was sent last: whether a line stands open in the stream."""
        self._open = self._stream and not data.endswith(b"\n")

    def clear(self) -> None:
        """The link was cut: what was on its way is lost."""
        self._heap.clear()
        self._held, self._last_due, self._open = None, 0.0, False

    def _deform(self, data: bytes, board: int | None, t: float) -> None:
        wire, rng = self._wire, self._rng
        flip, split, garbage, twice = rng.random(4) < (wire.bit_flip, wire.split, wire.garbage, wire.duplicate)
        due = t + wire.delay_s + (rng.exponential(wire.delay_jitter_s) if wire.delay_jitter_s > 0 else 0.0)
        if self._stream:
            due = self._last_due = max(due, self._last_due)
        if garbage:
            self._push(due, rng.bytes(int(rng.integers(*_GARBAGE, endpoint=True))), board)
        for _ in range(1 + int(twice)):
            self._push_split(due, self._flipped(data) if flip else data, board, split=bool(split))

    def _push_split(self, due: float, data: bytes, board: int | None, *, split: bool) -> None:
        due = max(due, self._last_due) if self._stream else due
        if not split or len(data) < 2:
            self._push(due, data, board)
            return
        at = int(self._rng.integers(1, len(data)))
        self._push(due, data[:at], board)
        if self._stream:
            self._last_due = due + self._pause
            self._push(self._last_due, data[at:], board)

    def _flipped(self, data: bytes) -> bytes:
        turned = bytearray(data)
        bit = int(self._rng.integers(8 * len(turned)))
        turned[bit // 8] ^= 1 << bit % 8
        return bytes(turned)

    def _push(self, due: float, data: bytes, board: int | None) -> None:
        self._count += 1
        heapq.heappush(self._heap, (due, self._count, data, board))
