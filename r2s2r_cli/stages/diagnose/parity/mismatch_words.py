"""How a mismatch of columns is told."""

from __future__ import annotations

from collections.abc import Iterable

from r2s2r_cli.stages.diagnose.parity.finding import Mismatch

LEAST_ROWS = 20
"""Rows below which nothing is said of an order, a sign or a rate."""


def columns(what: str, order: dict[int, int], by: str) -> Mismatch:
    """Columns of `what` that agree with `by` in another order: column -> what it really is."""
    return Mismatch(
        "order", f"{what} {listed(order)} are exchanged", f"{what} that agree with {by} in their order",
        ", ".join(f"{a} is {b}" for a, b in order.items()),
        f"r2s2r import run.csv   # with the columns of {what} {listed(order)} in their order",
    )  # fmt: skip


def listed(numbers: Iterable[int]) -> str:
    """`2 and 3`, `1, 4 and 5`."""
    names = [str(k) for k in sorted(numbers)]
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
