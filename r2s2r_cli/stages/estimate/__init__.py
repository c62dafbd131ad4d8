"""`estimate`: from observed end caps to the state of the robot at every kept frame.

Trajectory logs (CSV) bring end caps. Runs with images alone need the camera tracker, a later stage: they are left out,
and a recording that has no others is refused.
"""

from __future__ import annotations

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.stages.estimate.groups import run_groups
from r2s2r_cli.stages.estimate.report import run_report
from r2s2r_cli.stages.estimate.run import estimate_run
from schemas.estimate import EstimateSettings
from schemas.results_estimate import EstimateReport
from schemas.robot import Robot

__all__ = ["estimate"]


def estimate(recording: ArtifactData, robot: Robot, settings: EstimateSettings) -> tuple[ArtifactData, EstimateReport]:
    """Estimate every run of a recording that has observed end caps; the layout is that of `schemas/estimate.py`.

    The report of the first estimated run warns of those that were left out. Raises InputError where no run has
    observed end caps, and for a run with fewer than five kept frames, of another robot, or with numbers that are not
    finite; NumericalError where the smoother cannot explain a track.
    """
    if recording.kind != "recording" or not recording.runs():
        raise ArtifactError(
            "there is no run to estimate",
            where=recording.kind,
            expected="a recording with at least one run",
            received=f"kind {recording.kind}, {len(recording.runs())} runs",
            hint="r2s2r import crawl.csv",
        )
    groups: dict[str, Group] = {}
    reports = []
    streams = {run: dict(recording.streams(run)) for run in recording.runs()}
    usable = [run for run in streams if "caps" in streams[run]]
    left_out = tuple(
        f"run {run} of the recording is left out: it holds no observed end caps" for run in streams if run not in usable
    )
    for run in usable or streams:  # none usable: `estimate_run` refuses the first with what it holds
        state = estimate_run(run, streams[run], robot, settings)
        groups.update(run_groups(state))
        reports.append(run_report(state))
    reports[0] = reports[0].model_copy(update={"warnings": (*left_out, *reports[0].warnings)})
    return ArtifactData(kind="estimate", groups=groups), EstimateReport(runs=tuple(reports))
