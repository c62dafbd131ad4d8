"""What speaks for each effect of a diagnosis: gains on all data and left out, what the logs say, probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from r2s2r_cli.views.diagnose_ranking import NOWHERE, element_words, worth_a_row
from r2s2r_cli.views.diagnose_words import RIVALS
from r2s2r_cli.views.figure import BLUE, PURPLE, RED, legend_below, new_figure, png_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from schemas.results_diagnose import DiagnoseReport, RankedName

NINETY = 1.645
"""Sd to either side of a 90 % interval."""
NAMED, GAIN, LOGS, RIVAL = RED, BLUE, PURPLE, "#444f5e"


def drawn_rows(report: DiagnoseReport, asked: Sequence[str] = ()) -> list[RankedName]:
    """Effects of which something is known or that were asked for, most probable first, then `none` and `unknown`."""
    known = [one for one in worth_a_row(report, asked) if one.effect not in RIVALS]
    return [*known, *(one for one in report.ranking if one.effect in RIVALS)]


def ranking_picture(report: DiagnoseReport, asked: Sequence[str] = ()) -> bytes:
    """PNG: nats on the left, probabilities on the right."""
    rows = drawn_rows(report, asked)
    figure = new_figure(10.5, 1.8 + 0.4 * len(rows))
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.6, 1])
    for y, one in enumerate(rows):
        color = NAMED if one.effect in report.effects else RIVAL if one.effect in RIVALS else GAIN
        _nats(left, y, one, color)
        right.barh(y, one.probability, color=color, height=0.6)
        right.annotate(f"{one.probability:.2f}", (one.probability, y), xytext=(4, 0), textcoords="offset points",
                       va="center", fontsize=8)  # fmt: skip
    left.axvline(report.chance_nats, color="#111111", lw=1, ls=":", label="reached left out by chance in 1 case of 20")
    left.axvline(0.0, color="#111111", lw=0.8)
    left.set_yticks(range(len(rows)), [_name(one) for one in rows], fontsize=8)
    left.invert_yaxis()
    left.set_xlabel("what speaks for it [nats]", fontsize=8)
    right.set(xlim=(0, 1.15))
    right.set_xlabel("probability", fontsize=8)  # where it comes from is in the table "how"
    more = len(report.ranking) - len(rows)
    if more:
        left.set_title(f"{more} others, of which little is known: in the table", fontsize=8, loc="left")
    _legend(left, report)
    legend_below(figure, [left], columns=2)
    return png_bytes(figure)


def _nats(axes: Axes, y: int, one: RankedName, color: str) -> None:
    if one.effect in RIVALS:
        if one.elpd_gain > NOWHERE:
            axes.barh(y - 0.15, one.elpd_gain, color=color, height=0.3)
        return
    axes.barh(y + 0.2, one.parity_nats, color=LOGS, height=0.22)
    if one.fitted and one.elpd_gain > NOWHERE:
        wide = None if one.elpd_gain_sd is None else NINETY * one.elpd_gain_sd
        axes.barh(y - 0.15, one.marginal_nats or 0.0, color=color, height=0.38)
        axes.errorbar(one.elpd_gain, y - 0.15, xerr=wide, fmt="D", ms=4, mfc="white", color="#111111", capsize=3, lw=1)


def _name(one: RankedName) -> str:
    where = "" if one.element is None else f", {element_words(one.element)}"
    return f"{one.effect}{where}{'' if one.fitted else ' (not fitted)'}"


def _legend(axes: Axes, report: DiagnoseReport) -> None:
    """Entries for every kind of mark, whether a row happens to have one or not."""
    axes.bar(0, 0, color=GAIN, label="gain on all data")
    if report.effects:
        axes.bar(0, 0, color=NAMED, label="gain on all data, named by the verdict")
    axes.bar(0, 0, color=LOGS, label="what the logs alone say (parity)")
    if any(one.effect == "unknown" for one in report.ranking):
        axes.bar(0, 0, color=RIVAL, label="unknown: gain of errors larger than the floor")
    axes.errorbar([], [], xerr=[], fmt="D", ms=4, mfc="white", color="#111111", capsize=3, lw=1,
                  label="gain left out, with 90 % interval")  # fmt: skip
