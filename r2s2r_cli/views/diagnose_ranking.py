"""The table of a diagnosis that ranks effects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.views.page import PageTable
from schemas.results_diagnose import BY_CHANCE

if TYPE_CHECKING:
    from schemas.results_diagnose import DiagnoseReport, ElementFound, RankedName

NOWHERE = -1e8
"""[nats] Below which a gain stands for one that was not asked for, or broke off."""
_RIVALS = {
    "none": "the refit nominal model; counts as much in every diagnosis",
    "unknown": "a cause that the catalogue lacks; gain: of errors larger than the floor",
}
COLUMNS = (
    "name", "where", "all data: gain [nats]", "left out: gain +- sd [nats]", "parity [nats]", "probability",
    "size (90 % interval)", "left-out error [mm]", "remarks",
)  # fmt: skip


def ranking_table(report: DiagnoseReport, *, brief: bool = False) -> PageTable:
    """Every name, most probable first. brief: those that were fitted, are in the 90 % set or have something said for
    them by the logs alone; the others in one row."""
    shown = [one for one in report.ranking if not brief or _said(one, report)]
    rows = [_ranked(one) for one in shown]
    others = [one for one in report.ranking if one not in shown]
    if others:
        most = max(one.probability for one in others)
        told = "not fitted: they promised too little; all with --json"
        rows.append([f"{len(others)} others", "", "", "-", "", f"<= {most:.2f} each", "", "", told])
    return PageTable("what explains the gap", list(COLUMNS), rows)


def element_words(element: ElementFound | None) -> str:
    """`cable 3`, `all sensors`, `the world`."""
    if element is None:
        return ""
    if element.xy_m is not None:
        return f"the place ({element.xy_m[0]:.2f}, {element.xy_m[1]:.2f}) m"
    if element.kind in ("world", "camera", "place"):
        return f"the {element.kind}"
    return f"all {element.kind}s" if element.index is None else f"{element.kind} {element.index}"


def _said(one: RankedName, report: DiagnoseReport) -> bool:
    return one.fitted or one.effect in (*_RIVALS, *report.set90, *report.effects) or one.parity_nats >= BY_CHANCE


def _ranked(one: RankedName) -> list[str]:
    sizes = []
    for name, value in one.size.items():
        unit = "" if one.units.get(name, "1") == "1" else f" {one.units[name]}"
        low, high = one.ci90[name]
        sizes.append(f"{name.split('.')[1]} {value:.3g} ({low:.3g} .. {high:.3g}){unit}")
    remarks = [_RIVALS[one.effect]] if one.effect in _RIVALS else []
    remarks += [] if one.fitted else ["not fitted: it promised too little"]
    remarks += [] if one.moved else ["never left its start"]
    remarks += [f"{name.split('.', 1)[1]} on a bound" for name in one.on_bound]
    rmse = "" if one.rmse_m is None else f"{1e3 * one.rmse_m:.1f}"
    where = element_words(one.element) or (f"channel {one.channel}" if one.channel else "")
    sd = "" if one.elpd_gain_sd is None else f" +- {one.elpd_gain_sd:.1f}"
    gain = f"{one.elpd_gain:.1f}{sd}" if one.fitted else "-"
    whole = f"{one.marginal_nats:.1f}" if one.fitted and one.size and one.marginal_nats is not None else ""
    parity = f"{one.parity_nats:.1f}"
    if one.effect in _RIVALS:
        whole, gain, parity = (f"{one.elpd_gain:.1f}" if one.elpd_gain > NOWHERE else "-"), "", ""
    return [one.effect, where, whole, gain, parity, f"{one.probability:.2f}", "; ".join(sizes), rmse,
            "; ".join(remarks)]  # fmt: skip
