"""What each kind of evidence is worth, as a table."""

from __future__ import annotations

from r2s2r_cli.views.page import PageTable
from schemas.results_blind_worth import BlindWorthResult


def worth_table(result: BlindWorthResult) -> PageTable:
    """One row for each kind that is left out; clear: single effects that can be told."""
    return PageTable(
        f"{result.judged} sets judged by what {result.learned} others taught",
        ["without", "first, clear", "lost, won", "in three", "named", "right", "named, nothing wrong",
         "named, strangers", "log loss [nats]"],
        [[one.without, f"{one.top1}/{one.clear}", f"{one.lost}, {one.won}", f"{one.top3}/{one.clear}",
          f"{one.named}/{one.clear}", f"{one.right}/{one.named}", f"{one.alarms}/{one.none}",
          f"{one.strangers_named}/{one.strangers}", f"{one.log_loss:.2f}"]
         for one in result.rows],
    )  # fmt: skip
