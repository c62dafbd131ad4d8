"""What `diagnose` gives once it has an answer: the document, the files beside the artifact, what the terminal says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from r2s2r_cli.console import Console
from r2s2r_cli.reached import reached

if TYPE_CHECKING:
    from r2s2r_cli.artifact import ArtifactData
    from schemas.config import LinkSettings
    from schemas.results_diagnose import DiagnoseReport, DiagnoseResult

NEXT = "-next.toml"
"""What is added to the artifact's name for the policy that should be run next."""


def answer(result: Any, report: DiagnoseReport | None) -> DiagnoseResult:
    """The document: what every stage says, and what was found at the top."""
    from schemas.results_diagnose import DiagnoseResult

    shared: dict[str, Any] = result.model_dump(exclude={"schema_"})
    if report is None:
        return DiagnoseResult(**shared)
    names = ("verdict", "effects", "probability", "set90", "ranking", "where", "shrinkage", "not_testable",
             "confusable", "next_gait")  # fmt: skip
    return DiagnoseResult(**shared, **{name: getattr(report, name) for name in names})


def pictures(
    data: ArtifactData,
    report: DiagnoseReport,
    asked: Sequence[str] = (),
    *,
    only: bool = False,
    link: LinkSettings | None = None,
) -> Iterator[tuple[str, bytes]]:
    """What lies beside the artifact: the policy to run next, pictures and the page. asked: of `--effect`; only: no
    others were looked for. link: of the project."""
    from r2s2r_cli.views.diagnose import draw_diagnosis
    from r2s2r_cli.views.diagnose_page import diagnose_page

    if report.next_gait is not None:
        yield NEXT, _policy(report)
    drawn = []
    for name, title, png in draw_diagnosis(data, report, asked):
        yield f"-{name}.png", png
        drawn.append((title, png))
    yield ".html", diagnose_page(report, drawn, reached(link), only=only)


def _policy(report: DiagnoseReport) -> bytes:
    """The next gait as a policy file."""
    import tomlkit

    from schemas.results_diagnose import IN_WORDS

    one = report.next_gait
    assert one is not None  # noqa: S101 - asked by the caller
    names = ", ".join(IN_WORDS.get(name, name) for name in one.candidates)
    what_for = f"to tell apart what diagnose could not ({names})" if names else "to narrow the bound of no_gap"
    head = {
        "schema_version": 1, "robot": report.robot, "name": "next-gait",
        "description": f"{one.name}: {what_for}",
        "steps": [{"target": list(target)} for target in one.targets],
    }  # fmt: skip
    return tomlkit.dumps(head).encode()


def show(
    report: DiagnoseReport, console: Console, asked: Sequence[str] = (), *, only: bool = False,
    link: LinkSettings | None = None,
) -> None:  # fmt: skip
    """The tables, the verdict, what to type next and what is warned of. asked: of `--effect`; only: no others were
    looked for. link: of the project."""
    from r2s2r_cli.views.diagnose_commands import diagnose_commands
    from r2s2r_cli.views.diagnose_page import diagnose_tables
    from r2s2r_cli.views.diagnose_words import loud_words, verdict_words

    for table in diagnose_tables(report, brief=True, asked=asked, only=only):
        console.table(table.title, table.columns, table.rows)
    console.data(f"verdict {verdict_words(report, only=only)}")
    console.data(report.sentence)
    if loud := loud_words(report):
        console.data(loud)
    for what, command in diagnose_commands(report, reached(link)):
        console.data(f"{what}: {command}")
    for text in report.warnings:
        console.warn(text)
