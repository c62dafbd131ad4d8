"""The table of a diagnosis that ranks effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from r2s2r_cli.views.diagnose_words import LEFT_OUT, RIVALS, pool
from r2s2r_cli.views.page import PageTable
from schemas.people import plain_name, read_in, rounded
from schemas.results_diagnose import BY_CHANCE

if TYPE_CHECKING:
    from schemas.results_diagnose import DiagnoseReport, ElementFound, RankedName

NOWHERE = -1e8
"""[nats] Below which a gain stands for one that was not asked for, or broke off."""
_REMARKS = {
    "none": "nothing is wrong: the refit nominal model; weighs the same in every diagnosis",
    "unknown": "a cause that is none of {pool}; the gain is of errors larger than the floor, its probability is not"
    " from it (none and unknown, below)",
}
_NO_REPLAY = "not fitted: it changes nothing that is simulated, so the logs alone speak"
COLUMNS = (
    "name", "where", "all data: gain [nats]", "left out: gain +- sd [nats]", "logs: parity [nats]", "probability",
    "size (90 % interval)",
)  # fmt: skip


def ranking_table(
    report: DiagnoseReport, *, brief: bool = False, asked: Sequence[str] = (), only: bool = False
) -> PageTable:
    """Every name, most probable first. brief: those that are worth a row; the others in one. only: no others than
    those asked for were looked for."""
    shown = worth_a_row(report, asked) if brief else list(report.ranking)
    rows = [_ranked(one, report, pool(only=only)) for one in shown]
    others = [one for one in report.ranking if one not in shown]
    if others:
        most = max(one.probability for one in others)
        seen_by_logs = [one.effect for one in others if not replayed(one)]
        beside = f", or change nothing that is simulated ({', '.join(seen_by_logs)})" if seen_by_logs else ""
        told = f"not fitted: they promised too little{beside}; all with --json"
        rows.append([f"{len(others)} others", "", "", "-", "", f"<= {most:.2f} each", "", "", told])
    error = f"{LEFT_OUT} [mm], floor {1e3 * report.floor_m:.1f}"
    title = f"what explains the gap, beside a floor of {1e3 * report.floor_m:.1f} mm ({report.floor_from})"
    return PageTable(title, [*COLUMNS, error, "remarks"], rows)


def element_words(element: ElementFound | None) -> str:
    """`cable 3`, `all sensors`, `the world`."""
    if element is None:
        return ""
    if element.xy_m is not None:
        return f"the place ({element.xy_m[0]:.2f}, {element.xy_m[1]:.2f}) m"
    if element.kind in ("world", "camera", "place"):
        return f"the {element.kind}"
    return f"all {element.kind}s" if element.index is None else f"{element.kind} {element.index}"


def worth_a_row(report: DiagnoseReport, asked: Sequence[str] = ()) -> list[RankedName]:
    """Names that were fitted, asked for, are in the 90 % set or have something said for them by the logs alone, in
    their order; a single other takes no more room than a row of others would."""
    others = [one for one in report.ranking if one.effect not in asked and not said(one, report)]
    return [one for one in report.ranking if len(others) < 2 or one not in others]


def said(one: RankedName, report: DiagnoseReport) -> bool:
    """Whether something is known of a name: it was fitted, is in the 90 % set, or the logs speak for it."""
    return one.fitted or one.effect in (*RIVALS, *report.set90, *report.effects) or one.parity_nats >= BY_CHANCE


def replayed(one: RankedName) -> bool:
    """Whether the simulator can show the effect, so that it could have been fitted."""
    return one.fitted or one.seen_sd is not None


def size_words(one: RankedName) -> str:
    """`axial 9.66 (8.26 .. 11.1) mm`, numbers by name; empty where the fit never left its start: it says no size."""
    if not one.moved:
        return ""
    words = []
    for name, value in sorted(one.size.items()):
        unit, factor = read_in(one.units.get(name, "1"))
        low, high = (rounded(factor * end) for end in one.ci90[name])
        words.append(f"{_own(name, one)} {rounded(factor * value)} ({low} .. {high}) {unit}".rstrip())
    return "; ".join(words)


def _own(name: str, one: RankedName) -> str:
    """`axial` of `com_offset.axial_m.1`."""
    return plain_name(name.split(".")[1], one.units.get(name, "1"))


def _ranked(one: RankedName, report: DiagnoseReport, pool: str) -> list[str]:
    remarks = [_REMARKS[one.effect].format(pool=pool)] if one.effect in RIVALS else []
    if not one.fitted:
        remarks.append("not fitted: it promised too little" if replayed(one) else _NO_REPLAY)
    remarks += [] if one.moved else ["never left its start, so no size"]
    remarks += [f"{_own(name, one)} on a bound" for name in one.on_bound]
    where = element_words(one.element) or (f"channel {one.channel}" if one.channel else "")
    sd = "" if one.elpd_gain_sd is None else f" +- {one.elpd_gain_sd:.1f}"
    gain = f"{one.elpd_gain:z.1f}{sd}" if one.fitted else "-"
    whole = f"{one.marginal_nats:z.1f}" if one.fitted and one.size and one.marginal_nats is not None else ""
    parity = f"{one.parity_nats:.1f}"
    if one.effect in RIVALS:
        whole, gain, parity = (f"{one.elpd_gain:z.1f}" if one.elpd_gain > NOWHERE else "-"), "", ""
    return [one.effect, where, whole, gain, parity, f"{one.probability:.2f}", size_words(one), _error(one, report),
            "; ".join(remarks)]  # fmt: skip


def _error(one: RankedName, report: DiagnoseReport) -> str:
    """That of `none` may be of the best intervals alone, beside the floor of as many."""
    if one.rmse_m is None:
        return ""
    part = ""
    if one.effect == "none" and report.refit_kept < 1.0 and report.refit_floor_m is not None:
        part = f" (best {100 * report.refit_kept:.0f} % of intervals, floor {1e3 * report.refit_floor_m:.1f})"
    return f"{1e3 * one.rmse_m:.1f}{part}"
