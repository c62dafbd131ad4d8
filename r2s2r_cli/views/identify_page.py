"""The report of `identify` as tables for the terminal, and its self-contained page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.identify_data import figure_of, millimetres, near_zero, spread
from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.results_identify import (
    Baseline,
    HeldOut,
    IdentifyReport,
    Measures,
    ParameterFigures,
    RepeatsFigures,
    SegmentFigures,
)

_ALONE = "identified"
"""The simulator with the numbers found, nothing added."""
_STRONG = 0.9
"""Parameters correlated by more cannot be told apart."""
FLOOR_FROM = "repeats among these segments"
"""What the floor was taken from: that of `diagnose` may be of other intervals, or of healthy runs."""


def verdict(report: IdentifyReport) -> str:
    """What the numbers are worth, in two or three sentences."""
    free = [name for name, found in report.parameters.items() if found.trust != "fixed"]
    sure = [name for name in free if report.parameters[name].trust == "identified"]
    others = [report.parameters[name].trust for name in free if name not in sure]
    rest = ", ".join(f"{others.count(trust)} {trust}" for trust in dict.fromkeys(others))
    told = f"The runs determine {len(sure)} of {counted(len(free), 'free parameter')}{f' ({rest})' if rest else ''}."
    if report.method == "paper":
        told = f"The method gives no uncertainty: what {counted(len(free), 'number')} may be worth is not known."
    unseen = [one for one in report.effects if _unseen(one, report)]
    if unseen:
        told += f" The runs show nothing of {' and '.join(unseen)}; to go on without: --with-effect none."
    held = report.heldout
    if held is None:
        return f"{told} Nothing was held out: how well it predicts is not known."
    known = {name: b.keyframe_cap_rmse_m for name, b in held.baselines.items() if b.keyframe_cap_rmse_m is not None}
    rivals = ", ".join(f"{name} {millimetres(error)}{_of_them(name, report)}" for name, error in known.items())
    count = sum(segment.role == "test" for segment in report.segments)
    floor = "not known" if held.floor_m is None else f"{millimetres(held.floor_m)} mm ({FLOOR_FROM})"
    by = "" if held.predictor == "identified" else f" by '{held.predictor}'"
    error = f"{millimetres(held.keyframe_cap_rmse_m)} mm{spread(held.intervals.keyframe_cap_rmse_m)}"
    found = f"{error} at the key frames of {counted(count, 'segment')}{by}, floor {floor}"
    level = [name for name, one in held.baselines.items() if _open(one)]
    more = f" Not decided against: {', '.join(level)}." if level else ""
    return f"{told} Held out: {found}; in mm: {rivals or 'no baseline'}.{more}"


def _unseen(effect: str, report: IdentifyReport) -> bool:
    """Whether no free number of an effect was identifiable."""
    trust = [found.trust for name, found in report.parameters.items() if name.startswith(f"{effect}.")]
    return "not identifiable" in trust and set(trust) <= {"not identifiable", "fixed"}


def report_tables(report: IdentifyReport) -> Iterator[PageTable]:
    """Parameters first, then errors, then what makes them doubtful."""
    yield PageTable(
        "parameters",
        ["parameter", "value", "sd", "95 % interval", "range", "unit", "start", "trust", "why"],
        [_parameter(name, found) for name, found in report.parameters.items()],
    )
    yield _errors(report)
    if report.repeating is not None:
        yield _repeating(report.repeating)
    if report.weak:
        yield PageTable("what the runs hardly tell, before any fit", ["information", "direction"],
                        [[figure_of(one.eigenvalue, 3), one.words] for one in report.weak])  # fmt: skip
    if report.correlations:
        yield PageTable(
            "parameters that move together", ["parameter", "and", "correlation", "meaning"],
            [[c.one, c.other, f"{c.value:+.2f}", _meaning(c.value)] for c in report.correlations],
        )  # fmt: skip
    if report.profiles:
        yield PageTable(
            "profile likelihood of the weakest", ["parameter", "95 % interval of the profile", "beside the covariance"],
            [[p.parameter, f"{figure_of(p.lower)} .. {figure_of(p.upper)}", p.words] for p in report.profiles],
        )  # fmt: skip
    yield _segments(report)
    if report.starts:
        rows = [[s.kind, figure_of(s.cost, 6), str(s.iterations), s.reason] for s in report.starts]
        yield PageTable("fits", ["from", "loss", "iterations", "ended because"], rows)
    yield PageTable("how", ["what", "found"], list(_how(report)))


def identify_page(
    report: IdentifyReport,
    data: ArtifactData,
    pictures: Sequence[tuple[str, bytes]],
    asked: tuple[str, str] | None = None,
) -> bytes:
    """The HTML page: verdict, warnings, tables and pictures; `pictures` are (title, PNG). asked: a doubt that is no
    warning of the fit, and the command that answers it."""
    natures = {run: str(data.groups[f"runs/{run}"].attributes.get("nature", "")) for run in data.runs()}
    labels = [f"{run}: {nature}, not a measurement" for run, nature in natures.items() if nature in _MADE]
    return render(
        Page(
            title=f"Identification of {data.groups['fit'].attributes['robot']}",
            sentence=verdict(report),
            labels=[*labels, *report.warnings, *([asked[0]] if asked else [])],
            tables=list(report_tables(report)),
            commands=[("is the effect there", asked[1])] if asked else [],
            pictures=[Picture(title, png) for title, png in pictures],
        )
    )


_MADE = ("simulated", "kinematic sample")


def _parameter(name: str, found: ParameterFigures) -> list[str]:
    interval = "-" if found.lower is None else f"{figure_of(found.lower)} .. {figure_of(found.upper)}"
    wide = "-" if found.range is None else f"{figure_of(found.range[0])} .. {figure_of(found.range[1])}"
    value = figure_of(near_zero(found.value, *found.bounds))
    numbers = [value, figure_of(found.sd, 2), interval, wide, found.unit, figure_of(found.start)]
    return [name, *numbers, found.trust, found.reason]


def _errors(report: IdentifyReport) -> PageTable:
    columns = [
        "prediction",
        "key frames [mm]",
        "ours minus this [mm]",
        "free run [mm]",
        "free run, PID in the loop [mm]",
    ]
    rows = [["identified, train", millimetres(report.train.keyframe_cap_rmse_m), "-", "-", "-"]]
    held = report.heldout
    if held is not None:
        key, *free = _three(held)
        closed = free.pop()  # of the simulator alone, whoever predicts
        alone = held.predictor == _ALONE
        rows.append([f"{held.predictor}, held out", key, "-", *free, closed if alone else "-"])
        for name, one in held.baselines.items():
            key, *free = _three(one)
            free = [free[0], closed] if name == _ALONE else free
            rows.append([f"{name}, held out{_of_them(name, report)}", key, _against(name, one, report), *free])
        rows.append([f"floor: {FLOOR_FROM}", millimetres(held.floor_m), "-", "-", "-"])
    return PageTable("errors of the end caps (95 % interval by bootstrap over segments)", columns, rows)


def _three(found: HeldOut | Baseline | Measures) -> list[str]:
    names = ("keyframe_cap_rmse_m", "free_run_cap_mean_m", "free_run_closed_loop_cap_mean_m")
    intervals = getattr(found, "intervals", None)
    return [millimetres(getattr(found, name)) + spread(getattr(intervals, name, None)) for name in names]


def _against(name: str, one: Baseline, report: IdentifyReport) -> str:
    """`-36.1 .. -21.0, better in 4 of 4` held-out segments; `undecided` where the interval holds 0."""
    ends = one.difference.keyframe_cap_rmse_m
    if ends is None:
        return "-"
    pairs = [(_own(s), s.baselines.get(name)) for s in report.segments if s.role == "test"]
    known = [(ours, theirs) for ours, theirs in pairs if theirs is not None]
    better = sum(ours < theirs for ours, theirs in known)
    undecided = " (undecided)" if _open(one) else ""
    return f"{millimetres(ends[0])} .. {millimetres(ends[1])}{undecided}, better in {better} of {len(known)}"


def _own(segment: SegmentFigures) -> float:
    """Key-frame error of our prediction [m]."""
    predicted = segment.predicted_cap_rmse_m
    return segment.keyframe_cap_rmse_m if predicted is None else predicted


def _repeating(found: RepeatsFigures) -> PageTable:
    left_out = counted(found.left_out, "interval")
    counts = ", ".join(f"{weight:.2f} ({n})" for weight, n in zip(found.weights, found.repeats, strict=True))
    rows = [
        ["part of the prediction", "yes" if found.used else "no: training intervals are not predicted better with it"],
        ["training intervals, the simulator alone [mm]", millimetres(found.left_out_alone_m)],
        [f"the same with the repeats of the others [mm], {left_out}", millimetres(found.left_out_m)],
        ["simulator beyond the floor, training [mm]", millimetres(found.gap_m)],
        [f"floor [mm], from {counted(found.contrasts, 'difference')}", millimetres(found.floor_m)],
        ["weight (repeats) of each test interval", counts or "-"],
    ]
    return PageTable("what the simulator leaves behind and the robot repeats: no physics", ["what", "found"], rows)


def _of_them(name: str, report: IdentifyReport) -> str:
    """` (1 of 2 segments)` where a rival predicts fewer than were held out; else nothing."""
    held = [segment for segment in report.segments if segment.role == "test"]
    count = sum(segment.baselines.get(name) is not None for segment in held)
    return f" ({count} of {len(held)} segments)" if 0 < count < len(held) else ""


def _open(one: Baseline) -> bool:
    """Whether the interval of the difference holds 0."""
    ends = one.difference.keyframe_cap_rmse_m
    return ends is not None and ends[0] <= 0.0 <= ends[1]


def _segments(report: IdentifyReport) -> PageTable:
    """The simulator alone first, at the key frame and over all frames; then the prediction, where that is another, and
    its rivals, at the key frame."""
    names = list(dict.fromkeys(name for segment in report.segments for name in segment.baselines if name != _ALONE))
    predictor = _ALONE if report.heldout is None else report.heldout.predictor
    more = [] if predictor == _ALONE else [f"{predictor} [mm]"]
    rows = [
        [f"{s.run}:{s.interval}", s.role, millimetres(s.keyframe_cap_rmse_m), millimetres(s.cap_rmse_m),
         *(millimetres(s.predicted_cap_rmse_m) for _ in more),
         *(millimetres(s.baselines.get(name)) for name in names), ", ".join(map(str, s.not_white)) or "none"]
        for s in report.segments
    ]  # fmt: skip
    return PageTable("segments (at their key frames)",
                     ["interval", "role", f"{_ALONE} [mm]", f"{_ALONE}, all frames [mm]", *more,
                      *(f"{name} [mm]" for name in names), "caps not white"], rows)  # fmt: skip


def _meaning(value: float) -> str:
    return "cannot be told apart by these runs" if abs(value) > _STRONG else "partly exchangeable"


def _how(report: IdentifyReport) -> Iterator[list[str]]:
    yield ["method", f"{report.method}, {report.drive}"]
    yield ["loss", report.loss]
    if report.mask is not None:
        yield ["direction mask", report.mask]
    if report.uncertainty:
        yield ["standard deviations", report.uncertainty]
    yield ["effects", ", ".join(report.effects) or "none"]
    ended = "converged" if report.converged else "not converged"
    yield ["ended", report.reason if report.reason.lower().startswith("converged") else f"{ended}: {report.reason}"]
    yield ["residuals", f"{report.residuals}, loss {figure_of(report.cost, 6)}"]
    yield ["work", f"{report.rollouts} rollouts, {report.wall_s:.1f} s"
           + "".join(f"; {part} {seconds:.1f} s" for part, seconds in report.seconds.items())]  # fmt: skip
