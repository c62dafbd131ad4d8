"""The page of a comparison: verdict, player, history, the tables, and of each run its pictures."""

from __future__ import annotations

from collections.abc import Mapping

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.views.compare_playback import playback_page
from r2s2r_cli.views.compare_tables import comparison_tables
from r2s2r_cli.views.compare_verdict import verdict
from r2s2r_cli.views.page import Page, Picture
from schemas.results_compare import CompareReport
from schemas.robot import Robot


def comparison_page(
    report: CompareReport, data: ArtifactData, robot: Robot, pictures: Mapping[str, bytes],
    strips: Mapping[str, bytes], history: bytes | None,
) -> bytes:  # fmt: skip
    """HTML. pictures, strips: PNG by run. history: PNG, None with one simulator."""
    page = Page(
        title=f"Real and simulated: {robot.title}", sentence=verdict(report), labels=[*report.stale, *report.warnings],
        tables=list(comparison_tables(report)),
        pictures=[] if history is None else [Picture("Errors over the iterations, beside their floor", history)],
    )  # fmt: skip
    shown = {
        run: (Picture("seen from above, and by interval", png), Picture("frame by frame", strips[run]))
        for run, png in pictures.items()
    }
    return playback_page(page, data, robot, shown)
