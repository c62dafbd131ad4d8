"""What `record` itself had to say about its runs: it stands in the recording, and is said again."""

from __future__ import annotations

from collections.abc import Iterator

from r2s2r_cli.checks.base import Found, check
from r2s2r_cli.checks.subjects import Links


@check(
    "warning",
    Links,
    kinds=("recording",),
    what="`record` had nothing to warn of: runs to their end, lines that arrived, clocks and pictures that went on",
    why="targets that were given up, lost samples or a frozen camera look like the robot's own doing later on",
    fix="r2s2r inspect {file}",
)
def recorded_without_warning(links: Links) -> Iterator[Found]:
    """The warnings of the report that the recording was sealed with."""
    report = links.header.provenance.report
    runs = report.get("runs") if isinstance(report, dict) else None
    for run in runs if isinstance(runs, list) else ():
        if not isinstance(run, dict) or not isinstance(run.get("warnings"), list):
            continue
        for text in run["warnings"]:
            yield Found(f"runs/{run.get('run')}", "the recording warns of this run", "no warning", str(text))
