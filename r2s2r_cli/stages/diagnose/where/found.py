"""Where the gap lies: time, channel, element, place, and the numbers behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Element


@dataclass(frozen=True)
class SegmentGap:
    """One window of a target interval, simulated by the refit nominal model from its own start.

    interval: 1-based. order: 0, 1, ... through the evidence (runs in their order), which onset counts. t: of its start
    and end in the run [s]. nis: normalised innovation squared per degree of freedom, 1 where noise and floor explain
    it; dof: degrees of freedom; p: chance of it; gap: whether it stands out (false discovery rate). rmse: at the key
    frame [m]. xy_m: of the robot's middle [m].
    """

    run: str
    gait: str
    interval: int
    order: int
    t: tuple[float, float]
    nis: float
    dof: float
    p: float
    gap: bool
    rmse: float
    xy_m: tuple[float, float]


@dataclass(frozen=True)
class Onset:
    """That the gap begins with a segment. order: of the first segment with it (`SegmentGap.order`). gain: log
    likelihood of a beginning there over none and over always [nats]; p: chance of it where nothing begins."""

    order: int
    run: str
    interval: int
    gain: float
    p: float


@dataclass(frozen=True)
class Reading:
    """What innovations follow. follows: command | place | hold | time | cap | phase. r2: share of their variance that
    it explains out of sample; p: chance of it by shuffling; what: in words."""

    follows: str
    r2: float
    p: float
    what: str


@dataclass(frozen=True)
class ProbeGain:
    """A channel probe: free numbers, constant over each segment, where an effect of the channel would act.

    probe: the channel, or `all`, the free-form rival of every named effect. channel: of the design. gain: held-out log
    density over the refit nominal, leave-one-gait-out, per segment [nats]: the mean of what the channel gains alone and
    beside all others, since channels explain each other's gaps; gain_sd: of its mean over segments.
    share: of the whitened innovations that it explains where it was fitted. elements: what it is made of, with
    `scores` (element,): share of the explained part (group-sparse). sizes: fitted numbers (segment, number) in `unit`;
    columns: element of each, (number,).
    """

    probe: str
    channel: str
    gain: float
    gain_sd: float
    share: float
    elements: tuple[Element, ...]
    scores: np.ndarray
    sizes: np.ndarray
    columns: np.ndarray
    unit: str

    @property
    def element(self) -> Element | None:
        """The one that explains most."""
        return self.elements[int(np.argmax(self.scores))] if len(self.elements) else None


@dataclass(frozen=True)
class PlaceMap:
    """The contact probe over the floor. x, y: of the grid [m], (i,), (j,). value: kernel mean of the force against the
    slip over the load, (j, i) [1]: a change of friction; weight: how much was seen there, (j, i). r2: share of the
    probe that place, cap and gait phase explain out of sample. xy_m: where it is largest."""

    x: np.ndarray
    y: np.ndarray
    value: np.ndarray
    weight: np.ndarray
    r2: dict[str, float]
    xy_m: tuple[float, float] | None


@dataclass(frozen=True)
class Where:
    """segments: in the order of the evidence. readings: best first. probes: best first. channel: of the probe that
    explains most on held-out gaits, None where none does. element: of it. onset: None where the gap does not begin
    anywhere. place: None where contacts say nothing. missing: what could not be looked at, and why. residual: whitened
    innovations (frame, cap, 3), t [s] and segment (frame,) of each, for pictures."""

    segments: tuple[SegmentGap, ...]
    onset: Onset | None
    readings: tuple[Reading, ...]
    probes: tuple[ProbeGain, ...]
    channel: str | None
    element: Element | None
    place: PlaceMap | None
    missing: tuple[str, ...]
    residual: np.ndarray
    t: np.ndarray
    segment: np.ndarray

    @property
    def gaps(self) -> tuple[SegmentGap, ...]:
        """Segments that stand out."""
        return tuple(one for one in self.segments if one.gap)
