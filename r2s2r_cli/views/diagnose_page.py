"""The HTML page of a diagnosis and its tables: verdict, ranking, shrinkage, what cannot be told, what to run next."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from r2s2r_cli.reached import ROBOT
from r2s2r_cli.views.diagnose_commands import diagnose_commands, healthy_help
from r2s2r_cli.views.diagnose_ranking import element_words, ranking_table
from r2s2r_cli.views.diagnose_words import (
    HELD_OUT,
    LEFT_OUT,
    NATS,
    NOT_OURS,
    TWO_ERRORS,
    loud_words,
    pool,
    undecided,
    verdict_words,
    why_none,
)
from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.people import plain_name, quantity
from schemas.results_diagnose import IN_WORDS, INDISTINCT

if TYPE_CHECKING:
    from schemas.results_diagnose import DiagnoseReport, NextGaitFound, PairFound, RankedName

AT_FLOOR = "at the floor"
"""Instead of a share, where there is no gap to close."""
BELOW = " (command: below)"
NO_BETTER = 1.1
"""A gait that is worth less than a tenth more than the runs so far is no better than they are."""


def diagnose_tables(
    report: DiagnoseReport, *, brief: bool = False, asked: Sequence[str] = (), only: bool = False
) -> Iterator[PageTable]:
    """What people read first comes first. brief: for a terminal, without effects of which nothing is said and without
    the refitted numbers. asked: effects that stand in it all the same; only: no others were looked for."""
    yield ranking_table(report, brief=brief, asked=asked, only=only)
    if report.pairs:
        alone = {one.effect: one for one in report.ranking}
        yield PageTable(
            "two effects at once: laws mend each other's faults, so a second cause must add more, left out and in all",
            ["effects", "left out: gain [nats]", "more than the first alone [nats]", "all data: more [nats]"],
            [[" + ".join(one.effects), f"{one.elpd_gain:.1f}", *_more(one, alone.get(one.effects[0]))]
             for one in report.pairs],
        )  # fmt: skip
    if report.shrinkage is not None:
        yield _shrinkage(report)
    yield PageTable("where", ["what", "found"], list(_where(report)))
    if report.confusable:
        yield PageTable(
            "how well these runs tell effects of the fitted sizes apart", ["effect", "and", "nats", "meaning"],
            [[a, b, f"{nats:.1f}", "cannot be told apart by these runs" if nats < INDISTINCT else "can be told apart"]
             for a, b, nats in report.confusable],
        )  # fmt: skip
    yield PageTable("what cannot be told, and what to run next", ["what", "found"], list(_limits(report)))
    yield PageTable("how", ["what", "found"], list(_how(report, brief=brief, only=only)))


def diagnose_page(
    report: DiagnoseReport, pictures: Sequence[tuple[str, bytes]], robot: str = ROBOT, *, only: bool = False
) -> bytes:
    """The page, self-contained. robot: how the robot is reached, in commands that are shown. only: no other effects
    than those asked for were looked for."""
    labels = list(report.warnings)
    if report.calibrated.startswith("uncalibrated"):
        labels.insert(0, f"probabilities are {report.calibrated}")
    if report.within_run:
        labels.insert(
            0, "judged intervals are of the same run as fitted ones: what is constant over the run helps both"
        )
    return render(
        Page(
            title=f"Diagnosis of {report.robot}: {report.verdict}", sentence=report.sentence,
            notes=[*filter(None, [loud_words(report)]), f"Verdict {verdict_words(report, only=only)}"], labels=labels,
            tables=list(diagnose_tables(report, only=only)), commands=diagnose_commands(report, robot),
            pictures=[Picture(title, png) for title, png in pictures],
        )
    )  # fmt: skip


def _more(pair: PairFound, first: RankedName | None) -> tuple[str, str]:
    """What the second effect adds to the first, on left-out gaits and on all data."""
    if first is None:
        return "", ""
    both, one = pair.marginal_nats, first.marginal_nats
    return f"{pair.elpd_gain - first.elpd_gain:+.1f}", "" if both is None or one is None else f"{both - one:+.1f}"


def _shrinkage(report: DiagnoseReport) -> PageTable:
    s = report.shrinkage
    assert s is not None  # noqa: S101
    worse = s.ceiling is not None and s.refit is not None and s.ceiling > s.refit
    learned = ", which learned nothing that holds here" if worse else ""
    rows = [
        ["as identified", _mm(s.nominal), ""],
        ["refit", _mm(s.refit), ""],
        *(
            [[f"refit + {' + '.join(s.effects)}", _mm(s.refit_plus_effect),
              "-" if s.refit_plus_effect is None else _share(s.own_share, s.ci90)]]
            if s.effects
            else ()
        ),
        ["refit + a black box" + learned, _mm(s.ceiling), ""],
        ["floor of held-out intervals", _mm(s.floor), ""],
        # Without an effect nothing was foretold of one.
        *(
            [["predicted before it was looked at", "", AT_FLOOR if s.predicted is None else _predicted(s.predicted)]]
            if s.effects
            else ()
        ),
    ]  # fmt: skip
    where = "; within the run that was fitted" if s.within_run else ""
    if s.set_aside:
        where += f"; without {', '.join(s.set_aside)}, as the floor was measured without the worst intervals"
    return PageTable(
        f"how far the gap shrinks, {counted(len(s.judged_on), 'held-out interval')}{where}",
        ["model", f"{HELD_OUT} at the key frame [mm]", "own share of the refit gap above the floor (90 % interval)"],
        rows,
    )  # fmt: skip


def _seat(found: str, report: DiagnoseReport) -> str:
    """Where the cause sits; of a verdict that names none it is no more than a suspicion, and says so."""
    if report.verdict == "no_gap" and found:
        return f"below the floor; likeliest: {found}"
    if report.verdict != "ambiguous":
        return found or "-"
    if not found:
        return "undecided"
    return f"undecided; {'most suspect so far' if undecided(report) else 'were something wrong, likeliest'}: {found}"


def _where(report: DiagnoseReport) -> Iterator[list[str]]:
    where = report.where
    yield ["intervals with a gap", ", ".join(where.segments) or "none stands out"]
    yield [
        "begins with",
        "no beginning stands out"
        if where.onset_segment is None
        else _seat(where.onset or f"interval {where.onset_segment}", report),
    ]
    yield ["channel", _seat(where.channel or "", report)]
    yield ["element", _seat(element_words(where.element), report)]
    for text in report.parity:
        yield ["logs against each other", text]
    for text in report.hidden:
        yield ["hidden so far", text]


def _limits(report: DiagnoseReport) -> Iterator[list[str]]:
    yield ["90 % set", ", ".join(report.set90)]
    yield ["not testable with these runs", ", ".join(report.not_testable) or "none"]
    for text in report.missing:
        yield ["missing", text]
    if report.next_gait is None:
        yield ["run next", f"no gait of the library is likely to decide more{_healthy(report)}{_any(report)}"]
    else:
        yield ["run next", _next(report.next_gait, {one.effect: one.probability for one in report.ranking})]


def _healthy(report: DiagnoseReport) -> str:
    return f"; healthy runs would, of the robot as it was when nothing was wrong{BELOW}" if healthy_help(report) else ""


def _any(report: DiagnoseReport) -> str:
    """What runs of any kind are good for where no gait tells candidates apart: that nothing is wrong is a test of a
    bound, which narrows with them."""
    open_ = report.verdict == "ambiguous" and report.ranking and report.ranking[0].effect == "none"
    return "; more runs of any gait narrow the bound that `no_gap` is judged by" if open_ else ""


def _next(one: NextGaitFound, probability: Mapping[str, float]) -> str:
    """What to run, between how likely candidates, and what it is worth beside the runs so far."""
    how = BELOW if one.file else ""
    if one.narrows is not None:
        more = counted(one.narrows, "target interval")
        return (
            f"{one.name}: no gait tells candidates apart; {more} of it narrow the bound that `no_gap` is judged by{how}"
        )
    if one.now is not None and one.nats <= NO_BETTER * one.now:
        return f"nothing separates the candidates better than these runs; the best of the library is {one.name}{how}"
    beside = "" if one.now is None else f", these runs again {one.now:.1f}"
    enough = "" if one.nats >= INDISTINCT else " (little)"
    names = [IN_WORDS.get(name, name) + (f" ({100 * probability[name]:.0f} %)" if name in probability else "")
             for name in one.candidates]  # fmt: skip
    whom = f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else "the likeliest candidates"
    return f"{one.name}: likeliest to decide between {whom}, worth {one.nats:.1f} nats{enough}{beside}{how}"


def _how(report: DiagnoseReport, *, brief: bool, only: bool) -> Iterator[list[str]]:
    upper = "" if report.refit_upper_m is None else f", upper 90 % bound {1e3 * report.refit_upper_m:.1f} mm"
    floor = "" if report.refit_floor_m is None else f"; floor {1e3 * report.refit_floor_m:.1f} mm"
    part = "" if report.refit_kept == 1.0 else f", all of the best {100 * report.refit_kept:.0f} % of the intervals"
    yield [f"{LEFT_OUT} of the refit", f"{1e3 * report.refit_rmse_m:.1f} mm{upper}{floor}{part}"]
    yield [
        "floor",
        f"{1e3 * report.floor_m:.1f} mm: {report.floor_from}{'' if report.floor_given else ' (estimated)'}; {NOT_OURS}",
    ]
    yield ["left out", report.left_out]
    yield [
        "chance",
        f"the best of {pool(only=only)} gains {report.chance_nats:.1f} nats left out by chance in one case of 20",
    ]
    yield ["probabilities", report.calibrated]
    yield ["nats", NATS]
    yield ["none and unknown", why_none(only=only)]
    yield ["two errors", TWO_ERRORS]
    if brief and report.refit:
        yield ["refit", f"{len(report.refit)} numbers: all with --json"]
    for name, (value, sd) in () if brief else report.refit.items():
        unit = report.refit_units.get(name, "")
        yield [f"refit: {plain_name(name, unit)}", _number(value, sd, unit)]
    took = f", {report.wall_s:.1f} s" if report.wall_s else ""
    yield ["work", f"{report.rollouts} simulated stretches{took}"
           + "".join(f"; {part} {seconds:.1f} s" for part, seconds in report.seconds.items())]  # fmt: skip


def _number(value: float, sd: float, unit: str) -> str:
    """Value and sd; of a factor by how much it differs from 1."""
    if unit == "log":
        return f"{100 * math.expm1(value):+.1f} % +- {100 * math.exp(value) * sd:.1f} % of the identified value"
    return f"{'+' * (value >= 0)}{quantity(value, unit)} +- {quantity(sd, unit, 2)}"


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.1f}"


def _predicted(share: float) -> str:
    """`65 %`; below nothing it is a prediction, too: that the gap grows."""
    return f"{round(100 * share)} %{'' if share >= 0.0 else ' (the gap would grow)'}"


def _share(value: float | None, ends: tuple[float, float] | None) -> str:
    if value is None:
        return AT_FLOOR
    wide = "" if ends is None else f" ({round(100 * ends[0])} .. {round(100 * ends[1])})"
    return f"{round(100 * value)} %{wide}"
