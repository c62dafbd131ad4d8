"""What is counted while a run is recorded: rate, gaps, clocks, silent sensors, the link's own statistics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.devices.link import LinkStatistics, Sample

JUMP_S = 1.0
"""A board's clock that went back, or leapt by more than this against the host's between two of its samples, was set."""
LATE = 1.5
"""Periods after the last control tick beyond which one is late."""


@dataclass
class Tally:
    """Counts of one run, updated sample by sample; memory does not grow with the run.

    period: of the control ticks [s]. before: the link's statistics when the run began. unturned: for how long at most
    each motor was driven both ways without any change of its encoder [s], the shorter of both, (actuated,): one that is
    held by its load, or at the end of its travel, turns the other way.
    """

    period: float
    before: LinkStatistics
    sensors: int
    samples: int = 0
    ticks: int = 0
    late: int = 0
    held: int = 0
    doubts: dict[str, None] = field(default_factory=dict)
    gap_max: float = 0.0
    jumps: int = 0
    silent: np.ndarray = field(init=False)
    unturned: np.ndarray = field(default_factory=lambda: np.zeros(0))
    voltage_first: float | None = None
    voltage_last: float | None = None
    _t_sample: float | None = None
    _t_tick: float | None = None
    _first_tick: float | None = None
    _encoder: np.ndarray = field(default_factory=lambda: np.zeros(0))
    _driven: np.ndarray = field(default_factory=lambda: np.zeros(0))
    _clocks: dict[int, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.silent = np.zeros(self.sensors, dtype=np.int64)

    def sample(self, t: float, sample: Sample) -> None:
        """A sample at t [s]."""
        self.samples += 1
        if self._t_sample is not None:
            self.gap_max = max(self.gap_max, t - self._t_sample)
        self._t_sample = t
        if sample.voltage is not None:
            self.voltage_first = sample.voltage if self.voltage_first is None else self.voltage_first
            self.voltage_last = sample.voltage
        if math.isfinite(sample.t_board):
            board = self._clocks.get(sample.board)
            if board is not None:
                step, own = t - board[0], sample.t_board - board[1]
                self.jumps += own < 0 or abs(own - step) > JUMP_S
            self._clocks[sample.board] = (t, sample.t_board)

    def tick(self, t: float, length: np.ndarray, doubt: str = "") -> None:
        """A control tick at t [s] with the lengths of all sensors [m], (sensor,), NaN: no reading.

        doubt: why the motors were held in it.
        """
        self.ticks += 1
        if doubt:
            self.held += 1
            self.doubts[doubt] = None
        self._first_tick = t if self._first_tick is None else self._first_tick
        if self._t_tick is not None:
            self.late += t - self._t_tick > LATE * self.period
        self._t_tick = t
        self.silent += ~np.isfinite(length)

    def turned(self, control: np.ndarray, encoder: np.ndarray) -> None:
        """After a tick's command: speeds and the latest encoder counts, both (actuated,); NaN: no encoder."""
        if not len(self.unturned):
            self._encoder, self._driven, self.unturned = encoder, np.zeros((2, len(control))), np.zeros(len(control))
        still = np.isfinite(encoder) & (encoder == self._encoder)
        self._driven = np.where(still, self._driven + self.period * np.array([control > 0, control < 0]), 0.0)
        self.unturned = np.maximum(self.unturned, self._driven.min(axis=0))
        self._encoder = encoder

    @property
    def rate(self) -> float | None:
        """Control ticks a second; None for fewer than two."""
        if self._t_tick is None or self._first_tick is None or self._t_tick <= self._first_tick:
            return None
        return (self.ticks - 1) / (self._t_tick - self._first_tick)

    def link_row(self, t: float, now: LinkStatistics) -> dict[str, float | int]:
        """A row of the stream `link`."""
        latency = float("nan") if now.latency_median is None else now.latency_median
        return {
            "t": t, "received": now.received - self.before.received, "lost": self.since("lost", now) or 0,
            "repeated": self.since("repeated", now) or 0, "corrupt": now.corrupt - self.before.corrupt,
            "late": self.late, "latency": latency,
        }  # fmt: skip

    def since(self, name: str, now: LinkStatistics) -> int | None:
        """How much a count of the link grew in this run; None: the protocol cannot tell."""
        value, before = getattr(now, name), getattr(self.before, name)
        return None if value is None else value - (before or 0)
