"""Whether the gap begins with a target interval: what speaks for a cause before it and from it on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity.knocks import Knock
from r2s2r_cli.stages.diagnose.where.found import Onset, SegmentGap
from r2s2r_cli.stages.diagnose.where.place import TOUCHES_M

DRAWS = 999
LEVEL = 0.02
QUIET = 0.3
"""Before the beginning the gap is at most this share of what it is afterwards."""
SLIDES = 0.02
"""[m/s] A cap that is slower stands: the floor under it says nothing."""
SURE = 2.0
"""Standard deviations of its smoothed speed by which it must be faster than standing still."""


@dataclass(frozen=True)
class Steps:
    """Target intervals in the order of the evidence: one segment of each, and the log density that it gains by the
    cause [nats], (interval,)."""

    segments: tuple[SegmentGap, ...]
    gain: np.ndarray


def by_interval(segments: Sequence[SegmentGap], gain: np.ndarray) -> Steps:
    """Gains of segments (segment,), which may be pieces of target intervals, summed over each interval."""
    first: dict[int, SegmentGap] = {}
    total: dict[int, float] = {}
    for one, nats in zip(segments, gain, strict=True):
        first.setdefault(one.order, one)
        total[one.order] = total.get(one.order, 0.0) + float(nats)
    orders = sorted(first)
    return Steps(tuple(first[k] for k in orders), np.array([total[k] for k in orders]))


def onset(segments: Sequence[SegmentGap], gain: np.ndarray, seed: int) -> Onset | None:
    """None where the gap is there from the first interval on, or nowhere, or no order of intervals is unusual.

    gain: log density of every segment with the cause over that without, (segment,) [nats]. The interval is that of the
    largest cumulative sum (Page 1954); the chance is that of one as large in intervals in another order.
    """
    made = by_interval(segments, gain)
    gain = made.gain
    if len(gain) < 4 or np.ptp(gain) == 0:
        return None
    steps = _steps(gain[None])[0]
    place = int(np.argmax(steps)) + 1
    rng = np.random.default_rng(seed)
    drawn = _steps(rng.permuted(np.tile(gain, (DRAWS, 1)), axis=1)).max(axis=1)
    p = float((1 + np.sum(drawn >= steps.max())) / (DRAWS + 1))
    before, after = float(gain[:place].mean()), float(gain[place:].mean())
    if p > LEVEL or before > QUIET * after:
        return None
    one = made.segments[place]
    return Onset(one.order, one.run, one.interval, (after - max(before, 0.0)) * (len(gain) - place), p)


def reached(
    runs: Sequence[Run], xy_m: tuple[float, float], within_m: float, cap_radius: np.ndarray, gain: float,
    judged: Collection[tuple[str, int]] = (),
) -> Onset | None:  # fmt: skip
    """The target interval in which a cap first slides over a place (x, y) on the floor [m]: what sits there begins with
    it. within_m: of its middle; cap_radius (cap,) [m]; gain: what speaks for the place [nats]; judged: intervals (run
    and number) that are not looked at. None: none ever does."""
    before = 0
    for run in runs:
        caps = run.caps
        low = caps.p_WE[..., 2] - cap_radius < TOUCHES_M
        near = np.linalg.norm(caps.p_WE[..., :2] - np.array(xy_m), axis=-1) < within_m
        speed, sd = np.linalg.norm(caps.v_WE, axis=-1), np.sqrt(np.mean(caps.sd_v**2, axis=-1))
        over = low & near & (speed > np.maximum(SLIDES, SURE * sd))
        frames = np.flatnonzero(over.any(axis=1))
        slid = np.unique(np.searchsorted(caps.intervals.first, frames, side="right")).tolist()
        interval = next((k for k in slid if k and (caps.name, k) not in judged), None)
        if interval is not None:
            return Onset(before + interval - 1, caps.name, interval, gain, 0.0)
        before += len(caps.intervals)
    return None


def knocked(runs: Sequence[Run], knock: Knock, gain: float) -> Onset | None:
    """The target interval in which the camera was knocked. gain: what speaks for it [nats]. None: before the first."""
    before = 0
    for run in runs:
        if run.caps.name == knock.run:
            frame = int(np.searchsorted(run.caps.t, knock.t))
            interval = int(np.searchsorted(run.caps.intervals.first, frame, side="right"))
            return Onset(before + interval - 1, knock.run, interval, gain, 0.0) if interval else None
        before += len(run.caps.intervals)
    return None


def _steps(gain: np.ndarray) -> np.ndarray:
    """Standardised steps up of the mean of gains (draw, n) before each interval but the first, (draw, n - 1)."""
    n = gain.shape[1]
    k = np.arange(1, n)
    after = np.cumsum(gain[:, ::-1], axis=1)[:, ::-1][:, 1:]
    before = gain.sum(axis=1, keepdims=True) - after
    return np.asarray((after / (n - k) - before / k) * np.sqrt(k * (n - k) / n))
