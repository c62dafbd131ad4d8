"""Stage 1 whole: innovations of the refit nominal model, probes, onset, readings, place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.parity.finding import Element, discoveries
from r2s2r_cli.stages.diagnose.where.channels import explained, fitted, gains, held_out, sizes
from r2s2r_cli.stages.diagnose.where.columns import Design, design
from r2s2r_cli.stages.diagnose.where.found import PlaceMap, ProbeGain, SegmentGap, Where
from r2s2r_cli.stages.diagnose.where.onset import onset
from r2s2r_cli.stages.diagnose.where.place import place_map
from r2s2r_cli.stages.diagnose.where.readings import readings
from r2s2r_cli.stages.diagnose.which.arena import Arena

CHANNELS = ("command", "motor", "cable", "mass", "contact", "world", "sensing", "observation")
ALL = "all"
"""Name of the probe of all channels together: the free-form rival."""
LEAST_GAIN = 2.0
"""[nats] over all intervals: a channel below explains nothing."""

Told = Callable[[str, int, int], None]


def silent(part: str, done: int, total: int) -> None:
    """No progress."""


def where(
    evidence: Evidence, arena: Arena, z: np.ndarray, *, level: float = 0.05, seed: int = 0,
    cache_dir: Path | None = None, threads: int = 2, told: Told = silent,
) -> Where:  # fmt: skip
    """Where the gap of the refit nominal model lies. arena: at the nuisances z (p + q,), prepared there.

    level: false discovery rate of the intervals that stand out. Raises NumericalError where nothing can be simulated.
    """
    told("where", 0, 3)
    made = design(evidence.model, arena, z, cache_dir=cache_dir, threads=threads)
    told("where", 1, 3)
    groups, missing = _groups(arena, made)
    segments = _segments(evidence, arena, made, level)
    plain = held_out(made, np.zeros(0, dtype=int), groups)
    probes = []
    by_channel: dict[str, np.ndarray] = {}
    for channel in (*CHANNELS, ALL):
        places = np.arange(len(made.columns)) if channel == ALL else made.of(channel)
        if len(places):
            by_channel[channel] = gains(made, places, groups, plain)
            probes.append(_probe(made, channel, places, by_channel[channel], groups, plain))
    probes.sort(key=lambda one: -one.gain)
    told("where", 2, 3)
    single = [one for one in probes if one.probe != ALL]
    best = single[0] if single and single[0].gain * len(segments) > LEAST_GAIN else None
    place = place_map(arena, made)
    if place is None:
        missing.append("place: no interval says how well the caps grip")
    if not arena.sensors:
        missing.append("sensing: no cable lengths were logged")
    told("where", 3, 3)
    return Where(
        segments=segments,
        onset=None if best is None else onset(segments, by_channel[best.probe], seed),
        readings=readings(arena, made, seed),
        probes=tuple(probes),
        channel=None if best is None else best.channel,
        element=_element(best, place),
        place=place,
        missing=tuple(missing),
        residual=np.concatenate(made.innovation),
        t=np.concatenate([one.t for one in arena.many]),
        segment=np.concatenate([np.full(len(one.t), k) for k, one in enumerate(arena.many)]),
    )


def _groups(arena: Arena, made: Design) -> tuple[np.ndarray, list[str]]:
    """What is left out together: gaits; of one gait alone its halves, of one interval nothing."""
    if len(np.unique(made.gait)) > 1:
        return made.gait, []
    count = len(arena.many)
    said = "several gaits: parts of one run are left out instead, so what is constant over it helps every probe"
    return np.arange(count) * min(count, 3) // max(count, 1), [said]


def _segments(evidence: Evidence, arena: Arena, made: Design, level: float) -> tuple[SegmentGap, ...]:
    from scipy.stats import chi2

    square = made.gram[:, -1, -1]
    p = chi2.sf(square, made.size)
    gap = discoveries(p, level)
    found = []
    for k, one in enumerate(arena.many):
        error = made.caps[k][-1] - one.caps[-1]
        middle = np.nanmean(one.caps[..., :2], axis=(0, 1))
        found.append(SegmentGap(
            run=one.run, gait=one.gait, interval=one.interval, order=_order(evidence, one.run, one.interval),
            t=(float(one.window.start), float(one.t[-1])), nis=float(square[k] / made.size[k]),
            dof=float(made.size[k]), p=float(p[k]), gap=bool(gap[k]),
            rmse=float(np.sqrt(np.nanmean(np.sum(error**2, axis=-1)))), xy_m=(float(middle[0]), float(middle[1])),
        ))  # fmt: skip
    return tuple(found)


def _order(evidence: Evidence, run: str, interval: int) -> int:
    """Number of an interval, from 0, through all intervals of all runs."""
    before = 0
    for one in evidence.runs:
        if one.name == run:
            break
        before += len(one.caps.intervals)
    return before + interval - 1


def _probe(
    made: Design, channel: str, places: np.ndarray, gain: np.ndarray, groups: np.ndarray, plain: np.ndarray
) -> ProbeGain:
    """One channel with its elements: each alone, as far as a gait that was left out confirms it."""
    rows = np.arange(len(made.gram))
    spread = fitted(made, places, rows)
    numbers, _ = sizes(made, places, spread)
    elements = list(dict.fromkeys(made.columns[k].element for k in places))
    columns = np.array([elements.index(made.columns[k].element) for k in places])
    units = list(dict.fromkeys(made.columns[k].unit for k in places))
    scores = np.zeros(len(elements))
    if channel != ALL and len(elements) > 1:
        for i in range(len(elements)):
            own = places[columns == i]
            scores[i] = float(gains(made, own, groups, plain).sum())
    return ProbeGain(
        probe=channel, channel=channel if channel != ALL else "", gain=float(gain.mean()),
        gain_sd=float(gain.std() / np.sqrt(max(len(gain) - 1, 1))), share=explained(made, places.tolist(), spread),
        elements=tuple(elements), scores=scores, sizes=numbers, columns=columns, unit=", ".join(units),
    )  # fmt: skip


def _element(best: ProbeGain | None, place: PlaceMap | None) -> Element | None:
    if best is None:
        return None
    if best.channel == "contact" and place is not None and place.xy_m is not None:
        follows = max(place.r2, key=lambda name: place.r2[name])
        if follows == "place" and place.r2["place"] > 0:
            return Element("place", None, place.xy_m)
    if len(best.elements) > 1 and best.scores.max() <= 0:
        return None
    return best.element
