"""Stage 1 whole: innovations of the refit nominal model, probes, onset, readings, place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.parity.finding import Element, Parity, discoveries
from r2s2r_cli.stages.diagnose.where.channels import ENOUGH_NATS, explained, fitted, gains, held_out, sizes
from r2s2r_cli.stages.diagnose.where.columns import Design, design
from r2s2r_cli.stages.diagnose.where.found import Onset, PlaceMap, ProbeGain, SegmentGap, Where
from r2s2r_cli.stages.diagnose.where.onset import knocked, onset, reached
from r2s2r_cli.stages.diagnose.where.place import place_map
from r2s2r_cli.stages.diagnose.where.readings import readings
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.bounded import over_first

if TYPE_CHECKING:
    from r2s2r_cli.stages.diagnose.which.which import Compared

CHANNELS = ("command", "motor", "cable", "mass", "contact", "world", "sensing", "observation")
ALL = "all"
"""Name of the probe of all channels together: the free-form rival."""
LEAST_GAIN = 10.0
"""[nats] over all intervals, of probe and parity together: noise reaches 5 (tests), and the one set of the rig without
an effect that was looked at stays below 0; one with a slippery cap had 19 (development bank)."""

Told = Callable[[str, int, int], None]


def silent(part: str, done: int, total: int) -> None:
    """No progress."""


def where(
    evidence: Evidence, arena: Arena, z: np.ndarray, *, level: float = 0.05, seed: int = 0,
    cache_dir: Path | None = None, threads: int = 2, told: Told = silent, found: Parity | None = None,
    compared: Compared | None = None,
) -> Where:  # fmt: skip
    """Where the gap of the refit nominal model lies. arena: at the nuisances z (p + q,), prepared there.

    level: false discovery rate of the intervals that stand out. found: of the parity stage, which hears of sensing,
    actuation and the camera what end caps do not show; its findings count for their channels. compared: of the effects;
    where a name stands first, the gap begins where that name does, else where the best probe does. Raises
    NumericalError where nothing can be simulated.
    """
    told("where", 0, 3)
    made = design(evidence.model, arena, z, cache_dir=cache_dir, threads=threads)
    told("where", 1, 3)
    groups, missing = _groups(arena, made)
    segments = _segments(evidence, arena, made, level)
    plain = held_out(made, np.zeros(0, dtype=int), groups)
    probes = []
    by_channel: dict[str, np.ndarray] = {}
    whole = np.arange(len(made.columns))
    by_channel[ALL] = gains(made, whole, groups, plain)
    probes.append(_probe(made, ALL, whole, by_channel[ALL], groups, plain))
    for channel in CHANNELS:
        places = made.of(channel)
        if len(places):
            alone = gains(made, places, groups, plain)
            beside = by_channel[ALL] - gains(made, np.setdiff1d(whole, places), groups, plain)
            by_channel[channel] = (alone + beside) / 2
            probes.append(_probe(made, channel, places, by_channel[channel], groups, plain))
    probes.sort(key=lambda one: -one.gain)
    told("where", 2, 3)
    single = [one for one in probes if one.probe != ALL]
    said = _said(found)
    total = {one.probe: one.gain * len(segments) + said.get(one.channel, (0.0, None))[0] for one in single}
    best = max(single, key=lambda one: total[one.probe], default=None)
    if best is not None and total[best.probe] < LEAST_GAIN:
        best = None
    place = place_map(arena, made)
    if place is None:
        missing.append("place: no interval says how well the caps grip")
    if not arena.sensors:
        missing.append("sensing: no cable lengths were logged")
    told("where", 3, 3)
    return Where(
        segments=segments,
        onset=_onset(evidence, segments, None if best is None else by_channel[best.probe], compared, seed, found),
        readings=readings(arena, made, seed),
        probes=tuple(probes),
        channel=None if best is None else best.channel,
        element=_element(best, place, said),
        place=place,
        missing=tuple(missing),
        residual=np.concatenate(made.innovation),
        t=np.concatenate([one.t for one in arena.many]),
        segment=np.concatenate([np.full(len(one.t), k) for k, one in enumerate(arena.many)]),
    )


def _onset(
    evidence: Evidence, segments: tuple[SegmentGap, ...], gain: np.ndarray | None, compared: Compared | None, seed: int,
    found: Parity | None,
) -> Onset | None:  # fmt: skip
    """gain: of the best probe, (segment,) [nats]; None: no probe explains anything."""
    which = None if compared is None else compared.which
    best = None if which is None else which.best
    if compared is None or which is None or best is None or which.verdict == "unknown":
        return None if gain is None else onset(segments, gain, seed)
    if which.verdict == "no_gap":
        return None
    mine = next((k for k, fit in enumerate(compared.fits) if fit.hypothesis.effects == (best.effect,)), None)
    if best.effect == "camera_pose" and found is not None and found.knock is not None:
        return knocked(evidence.runs, found.knock, found.nats()[best.effect].get(None, 0.0))
    if mine is None:
        return None  # what the logs alone show is there throughout
    by_name = _by_name(compared, mine)
    radius = best.size.get("friction_field.patch_radius_m")
    if best.element is not None and best.element.xy_m is not None and radius is not None:
        caps = np.repeat([rod.cap_radius_m for rod in evidence.robot.rods], 2)
        judged = {(one.run, k) for one in evidence.judge for k in one.intervals}
        return reached(evidence.runs, best.element.xy_m, radius, caps, float(np.sum(by_name)), judged)
    return onset(segments, by_name, seed)


def _by_name(compared: Compared, mine: int) -> np.ndarray:
    """What a fit of one effect gains over the refit nominal model at every piece, (segment,) [nats], bounded as in the
    ranking: one fall is worth no more than any other piece that is explained."""
    single = [k for k, fit in enumerate(compared.fits) if len(fit.hypothesis.parts) == 1]
    table = np.array([compared.refit.elpd, *(compared.scores[k].elpd for k in single)])
    return over_first(table)[single.index(mine)]


def _groups(arena: Arena, made: Design) -> tuple[np.ndarray, list[str]]:
    """What is left out together: gaits; of one gait alone its halves, of one interval nothing."""
    if len(np.unique(made.gait)) > 1:
        return made.gait, []
    count = len(arena.many)
    said = "several gaits: parts of one run are left out instead, so what is constant over it helps every probe"
    return np.arange(count) * min(count, 3) // max(count, 1), [said]


def _segments(evidence: Evidence, arena: Arena, made: Design, level: float) -> tuple[SegmentGap, ...]:
    from scipy.stats import chi2

    square = made.gram[:, 0, -1, -1]
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


def _said(found: Parity | None) -> dict[str, tuple[float, Element | None]]:
    """What parity says for each channel: log likelihood ratio of its strongest significant finding [nats], halved for
    what look-alikes share of it, and the element."""
    from r2s2r_cli.effects.known import known_effects

    channel = {effect.name: str(effect.channel) for effect in known_effects()}
    made: dict[str, tuple[float, Element | None]] = {}
    for one in () if found is None else found.significant:
        for suspicion in one.suspicions:
            own = channel.get(suspicion.effect, "")
            nats = one.nats(suspicion)
            if nats > made.get(own, (0.0, None))[0]:
                made[own] = (nats, one.element)
    return made


def _element(
    best: ProbeGain | None, place: PlaceMap | None, said: dict[str, tuple[float, Element | None]]
) -> Element | None:
    if best is None:
        return None
    nats, named = said.get(best.channel, (0.0, None))
    if named is not None and named.index is not None and nats > ENOUGH_NATS:
        return named
    if best.channel == "contact" and place is not None and place.xy_m is not None:
        follows = max(place.r2, key=lambda name: place.r2[name])
        if follows == "place" and place.r2["place"] > 0:
            return Element("place", None, place.xy_m)
    if len(best.elements) > 1 and best.scores.max() <= 0:
        return None
    return best.element
