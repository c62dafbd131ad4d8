"""Pictures and page of a recording, drawn from the sealed artifact."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from r2s2r_cli.store.project import Project
    from schemas.results_record import RecordReport


def drawing_names(target: Path, report: RecordReport) -> list[str]:
    """File names of what `draw_recorded` will write."""
    return [*(f"{target.stem}-{run.run}.png" for run in report.runs if run.samples), f"{target.stem}.html"]


def draw_recorded(project: Project, target: Path, report: RecordReport) -> list[str]:
    """Draw every run and write the page; names relative to the project. Of the frames only those drawn are decoded."""
    from r2s2r_cli.commands.interrupts import whole_items
    from r2s2r_cli.store.atomic import write_bytes
    from r2s2r_cli.store.read import read_artifact
    from r2s2r_cli.views.record_page import record_page
    from r2s2r_cli.views.recording import draw_recording

    _, data = read_artifact(target, "recording", blobs=True)
    pictures = dict(whole_items(draw_recording(data, project.robot().rods[0].cap_radius_m)))
    found = {f"{target.stem}-{run}.png": png for run, png in pictures.items()}
    found[f"{target.stem}.html"] = record_page(report, pictures)
    for name, content in found.items():
        write_bytes(target.with_name(name), content)
    return [project.relative(target.with_name(name)) for name in found]
