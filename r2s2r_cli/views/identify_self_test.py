"""The self-test of `identify` as tables: what came back of planted values."""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.views.identify_data import figure_of, millimetres
from r2s2r_cli.views.page import PageTable, counted
from schemas.results_identify import Recovered, SelfTestReport


def self_test_tables(report: SelfTestReport) -> Iterator[PageTable]:
    """One row a parameter."""
    noise, count = millimetres(report.noise_m), counted(len(report.cases), "planted robot")
    yield PageTable(
        f"self-test, simulated: {count}, noise {noise} mm, {report.converged:.0%} converged",
        ["parameter", "unit", "bias", "rms error", "sd reported", "95 % interval holds the truth", "identifiable"],
        [[name, *_row(found)] for name, found in report.parameters.items()],
    )


def _row(found: Recovered) -> list[str]:
    covered = "-" if found.coverage is None else f"{found.coverage:.0%}"
    sizes = [f"{found.bias:+.2g}", figure_of(found.rmse, 2), figure_of(found.sd_reported, 2)]
    return [found.unit, *sizes, covered, f"{found.identifiable:.0%}"]
