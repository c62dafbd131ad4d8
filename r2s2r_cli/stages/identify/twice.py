"""Runs that `--online` would learn from a second time: what they say would count twice, and intervals be too narrow."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify.data import RunData, Selection

_TRAIN = 1
"""Code of schemas/identification.py for a segment that was trained on."""


def learned_twice(before: ArtifactData, runs: Sequence[RunData], train: Sequence[Selection]) -> tuple[str, ...]:
    """Names of the selected runs with a frame in their training intervals that an earlier identification was fitted to.

    Frames are the same where stamp and observed end caps are, whatever the run was called: another estimate of the same
    recording, with other settings, is not noticed.
    """
    known: set[bytes] = set()
    segments = before.groups.get("segments")
    if segments is None:
        return ()
    for run in dict.fromkeys(segments["run"].tolist()):
        group = before.groups[f"runs/{run.decode()}/fit"]
        fitted = segments["interval"][(segments["run"] == run) & (segments["role"] == _TRAIN)]
        rows = np.isin(group["interval"], fitted)
        known |= _frames(group["t"][rows], group["observed"][rows])
    named = {run.name: run for run in runs}
    return tuple(one.run for one in train if known & _selected(named[one.run], one.intervals))


def _selected(run: RunData, intervals: Sequence[int]) -> set[bytes]:
    spans = [np.arange(run.intervals.first[k - 1], run.intervals.last[k - 1] + 1) for k in intervals]
    rows = np.concatenate(spans)
    return _frames(run.t[rows], run.observed[rows])


def _frames(t: np.ndarray, observed: np.ndarray) -> set[bytes]:
    """Each frame, all its bits."""
    table = np.concatenate([t[:, None], observed.reshape(len(t), -1)], axis=1)
    return {row.tobytes() for row in table}
