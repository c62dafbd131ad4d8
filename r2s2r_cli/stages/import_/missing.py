"""Targets and motor commands that a trajectory CSV leaves out in the middle of a run."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages import frames
from r2s2r_cli.stages.import_.columns import Columns
from r2s2r_cli.stages.import_.table import Table


def missing_commands(table: Table, columns: Columns, reason: np.ndarray, intervals: int) -> list[str]:
    """Warnings about rows without a whole target or motor command, each with the first place.

    reason: why rows are left out, of `frames.keep_frames`. intervals: how many target intervals were found.
    """
    warnings = []
    found = _holes(table, columns.target, np.flatnonzero(reason == frames.KEPT))
    if found is not None:
        warnings.append(
            f"{_rows(found[0])} no whole target, the first at {found[1]}: each ends its target interval there, and "
            f"{intervals} are counted; write the target that held"
        )
    if columns.control is None:
        return warnings
    found = _holes(table, columns.control, np.flatnonzero(frames.in_order(table.values[:, columns.t], reason)))
    if found is not None:
        warnings.append(
            f"{_rows(found[0])} no whole motor command, the first at {found[1]}: what is missing is replayed as 0, a "
            "motor at rest"
        )
    return warnings


def unseen_targets(t: np.ndarray, hidden: np.ndarray) -> list[str]:
    """The warning about targets that came and went in a hole of the kept frames.

    t: stamps of the kept frames [s] since the first, (frame,). hidden: of `segments.hidden_targets`.
    """
    at = np.flatnonzero(hidden)
    if not len(at):
        return []
    longest = int(at[np.argmax(t[at] - t[at - 1])])
    more = f" and {len(at) - 1} times more" if len(at) > 1 else ""
    text = (
        f"{int(hidden.sum())} targets came and went while no frame was kept, from {t[longest - 1]:.2f} to "
        f"{t[longest]:.2f} s{more}: they are no target intervals, and the one before such a hole is not complete"
    )
    return [text]


def _rows(count: int) -> str:
    return "1 row has" if count == 1 else f"{count} rows have"


def _holes(table: Table, columns: np.ndarray, rows: np.ndarray) -> tuple[int, str] | None:
    """Of rows (row,): how many have a NaN in these columns between the first and the last whole one, and where.

    A row in which only some are NaN counts anywhere. None without such rows, and where no row is whole.
    """
    missing = np.isnan(table.values[rows][:, columns])
    whole = np.flatnonzero(~missing.any(axis=1))
    if not len(whole):
        return None
    inside = (np.arange(len(rows)) > whole[0]) & (np.arange(len(rows)) < whole[-1])
    bad = np.flatnonzero(missing.any(axis=1) & (inside | ~missing.all(axis=1)))
    if not len(bad):
        return None
    first = int(bad[0])
    return len(bad), table.place(int(rows[first]), int(columns[np.flatnonzero(missing[first])[0]]))
