"""`floor`: what is left of any gap when nothing is wrong: noise, repeatability, numerics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.floor.lengths import LengthRepeats, length_repeats
from r2s2r_cli.stages.floor.numerics import Numerics
from r2s2r_cli.stages.floor.runs import SeenRun, SensedRun, seen_run, sensed_run
from r2s2r_cli.stages.measures.floor import Floor, aligned_keys, floor_of, same_phase_groups
from r2s2r_cli.stages.measures.steps import Step, steps_of
from schemas.floor import BASES
from schemas.results_floor import CableFloor, CapFloor, FloorReport, LengthFloor, NumericsFloor

__all__ = ["Numerics", "SeenRun", "SensedRun", "floor", "seen_run", "sensed_run"]

REPEATS = 3
"""Fewer repeats of a policy than this are no basis of their own (docs/concepts/measures.md)."""
APART = 1.5
"""Floor over all iterations to that within each beyond which the report warns."""
FEW = 6
"""Contrasts below which the report warns: see docs/concepts/measures.md, section 4."""
_SETS = ("ramps", "holds", "reversals", "repeats")
"""Policies of `record --excite`."""

Phases = Sequence[Sequence[tuple[str, int]]]


def floor(
    seen: Sequence[SeenRun],
    sensed: Sequence[SensedRun],
    *,
    policies: Mapping[str, str],
    numerics: Numerics | None = None,
    by: Literal["pose", "displacement"] = "pose",
) -> tuple[ArtifactData, FloorReport]:
    """The floor of all that repeats itself in these runs; the layout is that of `schemas/floor.py`.

    policies: of each run by its name, to tell repeats of one policy. by: see `stages.measures.floor`. Raises InputError
    where nothing repeats itself and numerics is None.
    """
    steps = [step for run in seen for step in _complete(run)]
    caps = floor_of(steps, by=by)
    lengths = length_repeats(sensed) if sensed else None
    if caps is None and lengths is None and numerics is None:
        names = ", ".join(_names(seen, sensed)) or "no run with target intervals"
        raise InputError(
            "nothing repeats itself in these runs", where="r2s2r floor", received=names,
            expected="two or more intervals of one phase: 3 repeats of a policy, say",
            hint="r2s2r record gait.toml --repeats 3 --port /dev/ttyUSB0",
        )  # fmt: skip
    groups: dict[str, Group] = {}
    if caps is not None:
        groups["caps"] = _caps(caps, steps, policies, by)
    if lengths is not None:
        groups["lengths"] = _lengths(lengths, sensed, policies)
    if numerics is not None:
        groups["numerics"] = numerics.to_group()
    report = FloorReport(
        runs=_names(seen, sensed),
        used=_used(caps.phases if caps else (), lengths.phases if lengths else ()),
        given_up=max(sum(run.given_up for run in seen), sum(run.given_up for run in sensed)),
        caps=_cap_report(caps, groups["caps"]) if caps is not None else None,
        lengths=_length_report(lengths, groups["lengths"]) if lengths is not None else None,
        numerics=_numerics_report(numerics) if numerics is not None else None,
    )
    return ArtifactData("floor", groups), report.model_copy(update={"warnings": tuple(_warnings(report, seen, sensed))})


def basis(phases: Phases, policies: Mapping[str, str]) -> str:
    """What was compared: at least three runs of one policy, runs of the excitation sets, or steps within runs."""
    runs = {run for phase in phases for run, _ in phase}
    of: dict[str, int] = {}
    for run in runs:
        of[policies.get(run, run)] = of.get(policies.get(run, run), 0) + 1
    if max(of.values(), default=0) >= REPEATS:
        return BASES[0]
    return BASES[1] if runs and all(policies.get(run, run) in _SETS for run in runs) else BASES[2]


def _names(seen: Sequence[SeenRun], sensed: Sequence[SensedRun]) -> tuple[str, ...]:
    """Each run once."""
    return tuple(dict.fromkeys([*(run.name for run in seen), *(run.name for run in sensed)]))


def _used(*phases: Phases) -> tuple[str, ...]:
    """Runs that something was compared of, in their order."""
    return tuple(dict.fromkeys(run for part in phases for phase in part for run, _ in phase))


def _complete(run: SeenRun) -> tuple[Step, ...]:
    """Without the step after a target that was given up as well: it starts from another shape than its phase says."""
    table = run.intervals
    begun = np.append(True, table.complete[:-1] | (table.first[1:] != table.last[:-1] + 1))
    return steps_of(run, (np.flatnonzero(table.complete & begun) + 1).tolist())


def _caps(
    found: Floor, steps: Sequence[Step], policies: Mapping[str, str], by: Literal["pose", "displacement"]
) -> Group:
    rows: list[tuple[str, int, int, np.ndarray]] = []
    for phase, group in enumerate(same_phase_groups(steps)):
        keys = aligned_keys(group, by)
        away = np.sqrt(np.sum((keys - keys.mean(axis=0)) ** 2, axis=-1))
        rows += [(step.run, step.interval, phase, cap) for step, cap in zip(group, away, strict=True)]
    runs, intervals, phases, caps = zip(*rows, strict=True)
    attributes: dict[str, Scalar] = {
        "floor": found.floor_m, "sensor": found.sensor_m, "repeatability": found.repeatability_m,
        "contrasts": found.contrasts, "basis": basis(found.phases, policies), "carry": by,
    }  # fmt: skip
    if found.interval is not None:
        attributes |= {"lower": found.interval.lower, "upper": found.interval.upper, "level": found.interval.level}
    text = np.array([name.encode() for name in runs])
    return Group(
        {
            "run": text, "interval": np.array(intervals, dtype=np.int64), "phase": np.array(phases, dtype=np.int64),
            "deviation": np.sqrt(np.mean(np.array(caps) ** 2, axis=1)), "deviation_cap": np.array(caps),
        },
        attributes,
    )  # fmt: skip


def _lengths(found: LengthRepeats, runs: Sequence[SensedRun], policies: Mapping[str, str]) -> Group:
    return Group(
        {"cable": runs[0].cable, "sd": found.sd, "noise": found.noise},
        {"floor": found.floor, "basis": basis(found.phases, policies), "contrasts": found.contrasts},
    )


def _cap_report(found: Floor, group: Group) -> CapFloor:
    span = found.interval
    return CapFloor(
        floor_m=found.floor_m, lower_m=span.lower if span else None, upper_m=span.upper if span else None,
        level=span.level if span else None, sensor_m=found.sensor_m, repeatability_m=found.repeatability_m,
        contrasts=found.contrasts, phases=len(found.phases), repeats=sum(map(len, found.phases)),
        basis=str(group.attributes["basis"]),
    )  # fmt: skip


def _length_report(found: LengthRepeats, group: Group) -> LengthFloor:
    cables = tuple(
        CableFloor(sensor=i, cable=int(cable), sd_m=_known(found.sd[i]), noise_m=_known(found.noise[i]))
        for i, cable in enumerate(group["cable"])
    )
    return LengthFloor(
        floor_m=found.floor, contrasts=found.contrasts, phases=len(found.phases), cables=cables,
        within_m=found.within, basis=str(group.attributes["basis"]),
    )  # fmt: skip


def _numerics_report(found: Numerics) -> NumericsFloor:
    return NumericsFloor(
        floor_m=found.floor, median_m=float(np.median(found.error)), worst_m=float(found.error.max()),
        moved_m=float(np.median(found.way)), gaits=len(found.error),
    )  # fmt: skip


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _warnings(report: FloorReport, seen: Sequence[SeenRun], sensed: Sequence[SensedRun]) -> list[str]:
    found = [
        f"{run.name}: one value throughout from the sensors of cables {', '.join(map(str, run.frozen))}: left out"
        for run in sensed
        if run.frozen
    ]
    if report.given_up:
        found.append(f"intervals left out since their target was given up: {report.given_up}")
    lengths = report.lengths
    if lengths is not None and lengths.within_m is not None and lengths.floor_m > APART * lengths.within_m:
        found.append(
            f"within an iteration the cable lengths repeat to {1e3 * lengths.within_m:.2f} mm, over all of them to "
            f"{1e3 * lengths.floor_m:.2f} mm: other days, calibrations or robots; --iteration N measures one"
        )
    if report.caps is None:
        why = "no phase of a gait comes twice" if seen else "no run has end caps with states (r2s2r estimate)"
        found.append(f"no floor of the end caps: {why}")
    for what, part in (("end caps", report.caps), ("cable lengths", report.lengths)):
        if part is not None and part.contrasts < FEW:
            found.append(f"the floor of the {what} rests on {part.contrasts} comparisons: more repeats make it surer")
        if part is not None and part.basis == BASES[2]:
            found.append(f"the floor of the {what} is from steps of the same phase, not from repeats of a policy: "
                         "slow drift along a run counts in it")  # fmt: skip
    return found
