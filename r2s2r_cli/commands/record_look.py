"""`record --dry-run`: the plan and what the sensors say, before anything moves."""

from __future__ import annotations

import time

from r2s2r_cli.commands.record_wish import Wish, guarded, remarks
from r2s2r_cli.console import Console

LOOK_S = 1.0
"""How long --dry-run looks at the sensors."""


def look(wish: Wish, console: Console) -> None:
    """--dry-run: the plan, and with a port what the sensors say; no motor moves, nothing is written.

    What would be refused without --dry-run is said, not raised; a port is left alone while somebody records. Raises
    HardwareError for a port that cannot be read.
    """
    from r2s2r_cli.views.record_page import look_tables, plan_table
    from schemas.results import StageResult

    recording = wish.recording()
    refusal = recording.refusal(force=wish.force)
    busy = recording.writer()
    tables = [plan_table(wish.runs, wish.robot)]
    if wish.port and busy is not None:  # opening its port would disturb it
        console.warn(f"the sensors are not looked at: {busy} is recording")
    elif wish.port:
        with guarded(wish, dry_run=True) as link:
            end, sample = time.monotonic() + LOOK_S, None
            while time.monotonic() < end:
                sample = link.read(0.05) or sample
            remarks(link.facts, console)
            tables += look_tables(link.facts, link.statistics, sample, wish.robot)
    for table in tables:
        console.table(table.title, table.columns, table.rows)
    console.document(
        StageResult(
            stage=wish.stage, state="dry_run", artifact=wish.project.relative(recording.target), content_sha256=None,
            reasons=("it was asked for",), inputs=(),
        )
    )  # fmt: skip
    if refusal is None:
        console.say(f"would write {wish.project.relative(recording.target)}; nothing moved")
        return
    console.say("nothing moved")
    console.warn(f"without --dry-run this would be refused: {refusal.what} ({refusal.where})")
    console.hint(refusal.hint)
