"""What a link counts about itself: losses by number, answers by time, the board's clock against ours."""

from __future__ import annotations

from collections import deque

import numpy as np

from r2s2r_cli.devices.link import LinkStatistics

_NUMBERS = 65536
_HALF = 32768
_KEPT = 1024
"""Numbers that are remembered, to tell a repeated line from a late one."""
_PENDING = 512
"""Lines of ours whose answer may still come."""
_LATENCIES = 4096
_POINTS = 2048
"""Points of the clock comparison; then every other one is dropped."""
JUMP = 1.0
"""[s] by which a board's clock goes otherwise than ours from one message to the next, when it is said to have jumped.
More than a host is ever held up: then messages come late all together."""
_WINDOW = 1.0
"""[s] of which the quickest answer is kept: it says most about the clocks."""


class Numbers:
    """The sequence numbers of what comes in. lost, repeated, reordered: so far."""

    def __init__(self) -> None:
        self.lost = self.repeated = self.reordered = 0
        self.restart()

    def restart(self) -> None:
        """The other side counts anew."""
        self._last: int | None = None
        self._of_board: dict[int, int] = {}
        self._order: deque[int] = deque()
        self._seen: set[int] = set()

    def new(self, seq: int, board: int | None = None) -> bool:
        """Whether this line is to be used: it is newer than all before it, or than all of its board.

        Datagrams of two boards may overtake each other; that is counted, and does no harm.
        """
        if seq in self._seen:
            self.repeated += 1
            return False
        newest_of_board = board is not None and (seq - self._of_board.get(board, seq - 1)) % _NUMBERS < _HALF
        if board is not None and newest_of_board:
            self._of_board[board] = seq
        step = 1 if self._last is None else (seq - self._last) % _NUMBERS
        if step >= _HALF:
            self.reordered += 1
            self.lost = max(0, self.lost - 1)  # it was counted when it was missed
            self._remember(seq)
            return newest_of_board
        self.lost += step - 1
        self._last = seq
        self._remember(seq)
        return True

    def greeted(self, seq: int) -> None:
        """A greeting: in lock-step it may carry the number of the line before it, and is counted once at most."""
        if seq not in self._seen:
            self.new(seq)

    def _remember(self, seq: int) -> None:
        self._seen.add(seq)
        self._order.append(seq)
        if len(self._order) > _KEPT:
            self._seen.discard(self._order.popleft())


class Clocks:
    """The board's clock against ours, from answers: (sent + received) / 2 on ours is the board's stamp."""

    def __init__(self) -> None:
        self._points: list[tuple[float, float]] = []
        self._best = (float("inf"), 0.0, 0.0)
        self._end = -float("inf")
        self._last: float | None = None

    def answer(self, sent: float, received: float, t_board: float) -> None:
        """One question and its answer [s]."""
        round_trip, middle = received - sent, (sent + received) / 2
        if self._last is not None and abs(middle - t_board - self._last) > JUMP:
            # From here on it is another clock.
            self._points, self._best = [], (float("inf"), 0.0, 0.0)
        self._last = middle - t_board
        if received > self._end and np.isfinite(self._best[0]):
            self._points.append(self._best[1:])
            if len(self._points) > _POINTS:
                self._points = self._points[::2]
            self._best = (float("inf"), 0.0, 0.0)
        if not np.isfinite(self._best[0]):
            self._end = received + _WINDOW
        if round_trip < self._best[0]:
            self._best = (round_trip, middle, middle - t_board)

    def fit(self) -> tuple[float | None, float | None]:
        """Latest offset, ours minus the board's [s], and its drift [1]; None where nothing is known."""
        points = [*self._points, *([self._best[1:]] if np.isfinite(self._best[0]) else [])]
        if not points:
            return None, None
        t, offset = np.array(points).T
        if len(points) < 3:
            return float(offset[-1]), None
        t = t - t[-1]
        slope, last = np.polyfit(t, offset, 1)
        return float(last), float(slope)


class Tally:
    """All counters of one link, over its reconnections. What a protocol does not tell stays None."""

    def __init__(self, *, numbered: bool) -> None:
        self.numbers = Numbers() if numbered else None
        self.received = self.sent = self.corrupt = self.other = self.reconnects = self.refused = self.held = 0
        self.device_corrupt: int | None = None
        self.device_lost: int | None = None
        self.last_status = ""
        self.gap_max = 0.0
        self._last_t: float | None = None
        self._pending: dict[int, float] = {}
        self._latency: deque[float] = deque(maxlen=_LATENCIES)
        self._clocks = Clocks()
        self._stamps: dict[int, tuple[float, float]] = {}
        self.clock_jumps = 0

    def restart(self) -> None:
        """The port was opened again: numbers, clocks and silences begin anew, counts go on."""
        if self.numbers:
            self.numbers.restart()
        self._pending.clear()
        self._clocks = Clocks()
        self._stamps.clear()
        self._last_t = None

    def heard(self, t: float) -> None:
        """Something came at t [s]."""
        if self._last_t is not None:
            self.gap_max = max(self.gap_max, t - self._last_t)
        self._last_t = t

    def stamped(self, board: int, t: float, t_board: float) -> None:
        """A board's message came at t with its own stamp [s], NaN: none."""
        if t_board != t_board:
            return
        before, self._stamps[board] = self._stamps.get(board), (t, t_board)
        if before is not None and abs((t_board - before[1]) - (t - before[0])) > JUMP:
            self.clock_jumps += 1

    def silent(self, t: float) -> float:
        """How long nothing has come [s]; counts as a gap. 0 before the first message."""
        gap = 0.0 if self._last_t is None else t - self._last_t
        self.gap_max = max(self.gap_max, gap)
        return gap

    def asked(self, seq: int | None, t: float) -> None:
        """A line was sent, under a number where an answer will come."""
        self.sent += 1
        if seq is not None:
            self._pending.pop(seq, None)
            self._pending[seq] = t
            if len(self._pending) > _PENDING:
                del self._pending[next(iter(self._pending))]

    def answered(self, seq: int, t: float, t_board: float) -> None:
        """An answer came at t."""
        sent = self._pending.pop(seq, None)
        if sent is not None:
            self._latency.append(t - sent)
            self._clocks.answer(sent, t, t_board)

    def snapshot(self, overlong: int, *, clocks: bool = True) -> LinkStatistics:
        """All of it, as of now. clocks: False where the board's time is not that of the wall (lock-step)."""
        latency = np.array(self._latency if clocks else [])
        offset, drift = self._clocks.fit() if clocks else (None, None)
        numbers = self.numbers
        return LinkStatistics(
            received=self.received, sent=self.sent, lost=numbers.lost if numbers else None,
            repeated=numbers.repeated if numbers else None, reordered=numbers.reordered if numbers else None,
            corrupt=self.corrupt, other=self.other, overlong=overlong, reconnects=self.reconnects,
            refused=self.refused if numbers else None, held=self.held if numbers else None,
            device_corrupt=self.device_corrupt, device_lost=self.device_lost,
            latency_median=float(np.median(latency)) if len(latency) else None,
            latency_p99=float(np.percentile(latency, 99)) if len(latency) else None,
            clock_offset=offset, clock_drift=drift, clock_jumps=self.clock_jumps,
            gap_max=self.gap_max, last_status=self.last_status,
        )  # fmt: skip
