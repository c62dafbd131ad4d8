"""What a comparison says, in sentences."""

from __future__ import annotations

from collections.abc import Mapping

from r2s2r_cli.views.compare_tables import MEASURES
from r2s2r_cli.views.page import counted
from schemas.results_compare import CompareMeasure, CompareReport

FEW = 6
"""Of fewer runs a 95 % interval holds what it should in 73 to 85 % (docs/concepts/measures.md)."""


def verdict(report: CompareReport) -> str:
    """What the last simulator is worth beside the first, in sentences: of runs that none was trained on, if any."""
    first, last = report.models[0], report.models[-1]
    held = bool(last.heldout)
    a, b = (side.heldout if held else side.runs for side in (first, last))
    if "com_end_m" not in a or "com_end_m" not in b:
        return f"{counted(len({run.run for run in report.runs}), 'run')}: not every simulator could be run."
    one, two = a["com_end_m"], b["com_end_m"]
    runs = counted(two.runs, "run") + f" of iteration {report.iteration}" + _in_part(report)
    floor = "" if two.floor is None else f"; a perfect simulator would be found up to {1e3 * two.floor:.0f} mm away"
    if first.model == last.model:
        return f"{runs}: the simulated centre of mass ends {1e3 * one.rms:.0f} mm from the real one{floor}."
    seen = "from which no simulator learned" if held else "ALL trained on: no claim of accuracy rests on them"
    ends = (
        f"{runs}, {seen}: the simulated centre of mass ends {1e3 * two.rms:.0f} mm from the real one with "
        f"{last.model}, {1e3 * one.rms:.0f} mm with {first.model}{floor}."
    )
    words = [ends, _against(first.model, last.model, b)]
    if len(report.models) > 2:
        before = report.models[-2]
        words.append(_beside(before.model, before.heldout if held else before.runs, b))
    return " ".join(word for word in words if word)


def _in_part(report: CompareReport) -> str:
    """How much of the last simulator's runs is compared, in brackets; nothing where it is all."""
    name = report.models[-1].model
    mine = [run for run in report.runs if run.model == name and run.iteration == report.iteration]
    done, of = sum(run.intervals for run in mine), sum(run.of_intervals for run in mine)
    cut = sum(run.intervals < run.of_intervals for run in mine)
    return f" ({done} of {of} target intervals: {counted(cut, 'run')} in part)" if cut else ""


def _beside(before: str, side: Mapping[str, CompareMeasure], now: Mapping[str, CompareMeasure]) -> str:
    """What the last simulator is beside the one named before it: with an effect and without, say."""
    both = {name: (scale * side[name].rms, scale * now[name].rms, text) for name, (text, scale) in MEASURES.items()
            if name in side and name in now}  # fmt: skip
    better = [name for name, (old, new, _) in both.items() if new < old]
    told = []
    for name, (old, new, text) in both.items():
        if name in ("com_end_m", "keyframe_cap_m") and new > old:
            what, unit = text.removesuffix("]").split(" [")
            told.append(f"{what} {new:.3g} against {old:.3g} {unit}")
    worse = f"; worse: {', '.join(told)}" if told else ""
    return f"Beside {before} it is better in {len(better)} of {counted(len(both), 'measure')}{worse}." if both else ""


def _against(first: str, last: str, side: Mapping[str, CompareMeasure]) -> str:
    """Where the last simulator is worse than the first, and whether the runs can tell."""
    worse = {name: one for name, one in side.items() if one.change is not None and one.change > 0}
    sure = {name for name, one in side.items() if one.change_upper is not None and one.change_upper < 0}
    better = [name for name, one in side.items() if one.change is not None and name not in worse]
    words = []
    if better:
        fewest = min(one.runs for one in side.values())
        rather = ", which of so few runs holds less often" if fewest < FEW else ""
        part = f", in {len(sure)} beyond its 95 % interval{rather}" if sure else ""
        words.append(
            f"Of {counted(len(better) + len(worse), 'measure')} {last} is better than {first} in {len(better)}{part}."
        )
    if worse:
        parts = []
        for name, one in worse.items():
            text, scale = MEASURES[name]
            what, unit = text.removesuffix("]").split(" [")
            told = one.change_lower is not None and one.change_lower > 0
            before = scale * (one.rms - (one.change or 0.0))
            doubt = "" if told else ", which so few or so different runs do not prove"
            parts.append(f"{what} ({scale * one.rms:.3g} against {before:.3g} {unit}{doubt})")
        words.append(f"It is WORSE than {first} in: {'; '.join(parts)}.")
    return " ".join(words)
