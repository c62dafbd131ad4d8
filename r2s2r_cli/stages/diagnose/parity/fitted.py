"""The part of a run that may be looked at: nothing of judged intervals before everything else is decided."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence, Run
from r2s2r_cli.stages.segments import Intervals


def fitted_runs(evidence: Evidence) -> tuple[Run, ...]:
    """Runs that are fitted, cut off where their first judged interval begins."""
    found = []
    for run in evidence.only(evidence.fit) or evidence.runs:
        judged = [k for one in evidence.judge if one.run == run.name for k in one.intervals]
        found.append(_until(run, min(judged)) if judged and min(judged) > 1 else run)
    return tuple(found)


def _until(run: Run, interval: int) -> Run:
    """The run before a target interval (1-based, above 1)."""
    caps, end = run.caps, int(run.caps.intervals.first[interval - 1])
    stop, count = float(caps.t[end]), interval - 1
    rows = caps.t_command < stop
    table = Intervals(**{one.name: getattr(caps.intervals, one.name)[:count] for one in fields(Intervals)})
    by_frame = ("t", "observed", "p_WE", "sd_p", "v_WE", "sd_v", "quality")
    cut = replace(
        caps, **{name: getattr(caps, name)[:end] for name in by_frame}, t_command=caps.t_command[rows],
        control=caps.control[rows], target=caps.target[rows], intervals=table,
    )  # fmt: skip
    if run.lengths is None:
        return replace(run, caps=cut)
    heard = run.lengths.t < stop
    length = np.asarray(run.lengths.length[heard])
    return replace(run, caps=cut, lengths=replace(run.lengths, t=run.lengths.t[heard], length=length, intervals=table))
