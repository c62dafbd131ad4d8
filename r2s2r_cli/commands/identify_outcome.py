"""What `identify` shows of its report: the files beside the artifact, what the terminal says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from r2s2r_cli.console import Console

if TYPE_CHECKING:
    from collections.abc import Iterator

    from r2s2r_cli.artifact import ArtifactData
    from schemas.results_identify import IdentifyReport


@dataclass(frozen=True)
class Outcome:
    """number: of the iteration. typed: the options as given."""

    number: int
    typed: tuple[str, ...] = ()

    def pictures(self, data: ArtifactData, report: IdentifyReport) -> Iterator[tuple[str, bytes]]:
        """The pictures and the page."""
        from r2s2r_cli.views.identify import draw_identification
        from r2s2r_cli.views.identify_page import identify_page

        drawn = []
        for name, title, png in draw_identification(data):
            yield f"-{name}.png", png
            drawn.append((title, png))
        yield ".html", identify_page(report, data, drawn, self._whether_there(report))

    def show(self, report: IdentifyReport, console: Console) -> None:
        """Tables, verdict and doubts."""
        from r2s2r_cli.views.identify_page import report_tables, verdict

        for table in report_tables(report):
            console.table(table.title, table.columns, table.rows)
        console.data(verdict(report))
        for text in report.warnings:
            console.warn(text)
        if report.computed_by == "torch":
            console.warn("computed in plain torch, some hundred times slower: `r2s2r doctor` says what is missing")
        asked = self._whether_there(report)
        if asked is not None:
            sentence, command = asked
            console.data(f"{sentence}.")
            console.hint(command)

    def _whether_there(self, report: IdentifyReport) -> tuple[str, str] | None:
        from r2s2r_cli.commands.identify_presence import whether_there
        from r2s2r_cli.stages.effects import all_effects

        ids = [effect.name for effect in all_effects()]
        return whether_there(report.parameters, ids, self.number, self.typed)
