"""The report of `calibrate` as tables for the terminal, and as an HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from r2s2r_cli.views.page import Page, PageTable, Picture, counted, render
from schemas.results_calibrate import CalibrationReport, DriftSpread


def report_tables(report: CalibrationReport) -> Iterator[PageTable]:
    """What was fitted, one table a part."""
    for fitted in report.sets:
        loo = _mm(fitted.loo_rms_m)
        title = f"set {fitted.name}: {_mm(fitted.rms_m)} rms over all sensors, {loo} leave-one-out"
        yield PageTable(
            title,
            ["sensor", "state", "slope [pF/mm]", "offset [pF]", "rms [mm]", "worst [mm]", "leave-one-out [mm]"],
            [
                [f"{line.sensor} {line.name}", line.state, f"{1e9 * line.slope_f_per_m:.4f}",
                 f"{1e12 * line.offset_f:.2f}", *(_bare(v) for v in (line.rms_m, line.worst_m, line.loo_rms_m))]
                for line in fitted.lines
            ],
        )  # fmt: skip
    if report.history is not None:
        yield from _history(report)
    if report.tendons is not None:
        yield _tendons(report)
    if report.masses:
        yield PageTable(
            "masses",
            ["rod", "parts", "mass [g]", "centre of mass [mm]", "inertia along [kg mm^2]", "across [kg mm^2]"],
            [
                [rod.rod, str(rod.parts), f"{1e3 * rod.mass_kg:.1f}", f"{1e3 * rod.com_m:+.2f}",
                 f"{1e6 * rod.inertia_axial_kg_m2:.3f}", f"{1e6 * rod.inertia_transverse_kg_m2:.1f}"]
                for rod in report.masses
            ],
        )  # fmt: skip


_TITLES = {
    "drift": "drift: what one and the same capacitance means, calibration after calibration",
    "tendons": "force and stiffness of every tendon over its stretch",
    "masses": "weighed parts and centre of mass of every rod",
}
"""Of pictures: their headings, and what stands for them where they cannot be seen."""


def _title(name: str) -> str:
    return _TITLES.get(name, f"sensor lines and their residuals, set {name.removeprefix('sensors-')}")


def calibration_page(report: CalibrationReport, pictures: Mapping[str, bytes]) -> bytes:
    """The HTML page: tables of this run, pictures of everything in the artifact."""
    sets = f"{counted(len(report.sets), 'set')} of sensor lines"
    parts = [sets if report.sets else "",
             "dated calibrations" if report.history else "",
             counted(len(report.tendons.curves), "tendon curve") if report.tendons else "",
             counted(len(report.masses), "weighed rod") if report.masses else ""]  # fmt: skip
    used = f" Set {report.used} is in robot.toml." if report.used else ""
    return render(
        Page(
            title="Calibration",
            sentence=f"Fitted: {', '.join(part for part in parts if part)}.{used}",
            labels=report.warnings,
            tables=list(report_tables(report)),
            pictures=[Picture(_title(name), png) for name, png in pictures.items()],
        )
    )


def _history(report: CalibrationReport) -> Iterator[PageTable]:
    history = report.history
    if history is None:
        return
    spreads = [("all", history.overall), ("without swaps", history.without_swaps), ("within 2 days", history.short)]
    spreads += [(f"sensor {i}", spread) for i, spread in enumerate(history.per_sensor)]
    yield PageTable(
        f"drift over {history.entries} dated sets, {history.first} to {history.last}",
        ["recalibrations", "number", "swaps", "median [mm]", "90 % below [mm]", "median [mm/day]"],
        [[name, str(s.changes), str(s.swaps), *_spread(s)] for name, s in spreads],
    )
    if history.failed:
        yield PageTable(
            "fits that cannot be used",
            ["date", "sensor", "slope [pF/mm]", "state"],
            [[f.date, str(f.sensor), f"{1e9 * f.slope_f_per_m:.3g}", f.state] for f in history.failed],
        )


def _tendons(report: CalibrationReport) -> PageTable:
    tendons = report.tendons
    if tendons is None:
        raise ValueError("no tendon curves in this report")
    rows = [
        [c.name, str(c.points), f"{c.k1_n_per_m:.1f}", f"{c.k2_n_per_m2:.0f}", f"{c.k3_n_per_m3:.0f}",
         f"{c.rms_n:.3f}", f"{1e3 * c.x_max_m:.0f}", "yes" if c.monotone else "no"]
        for c in tendons.curves
    ]  # fmt: skip
    rows.append(["mean", "", f"{tendons.k1_n_per_m:.1f}", f"{tendons.k2_n_per_m2:.0f}", f"{tendons.k3_n_per_m3:.0f}",
                 "", f"{1e3 * tendons.x_common_m:.0f}", "yes" if tendons.monotone else "no"])  # fmt: skip
    columns = ["curve", "points", "k1 [N/m]", "k2 [N/m^2]", "k3 [N/m^3]", "rms [N]", "range [mm]", "rises throughout"]
    return PageTable("tendon curves, force = k1 x + k2 x^2 + k3 x^3", columns, rows)


def _spread(spread: DriftSpread) -> list[str]:
    return [_bare(spread.median_m), _bare(spread.p90_m), _bare(spread.median_m_per_day, 2)]


def _mm(value: float | None) -> str:
    return "no length" if value is None else f"{1e3 * value:.1f} mm"


def _bare(value: float | None, digits: int = 1) -> str:
    return "-" if value is None else f"{1e3 * value:.{digits}f}"
