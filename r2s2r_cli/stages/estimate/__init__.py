"""`estimate`: from observed end caps to the state of the robot at every kept frame.

Trajectory logs (CSV) bring end caps. Recordings with images alone need the camera tracker, a later stage.
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
    """Estimate every run of a recording; the layout of the result is `schemas/estimate.py`.

    Raises InputError for a run without observed end caps, with fewer than five kept frames, of another robot, or
    with numbers that are not finite; NumericalError where the smoother cannot explain a track.
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
    for run in recording.runs():
        state = estimate_run(run, dict(recording.streams(run)), robot, settings)
        groups.update(run_groups(state))
        reports.append(run_report(state))
    return ArtifactData(kind="estimate", groups=groups), EstimateReport(runs=tuple(reports))
