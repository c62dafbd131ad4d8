"""`estimate`: from observed end caps, or camera images and cable sensors, to the state of the robot at every frame.

Trajectory logs (CSV) bring end caps (`run.py`); recordings of a camera bring pictures, which the tracker turns into
sightings of caps and the smoother into states (`camera_run.py`). A run with neither is left out, and a recording that
has no other is refused.
"""

from __future__ import annotations

from collections.abc import Callable

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import ArtifactError, InputError, NumericalError
from r2s2r_cli.stages.estimate.camera_input import Pictures
from r2s2r_cli.stages.estimate.groups import run_groups
from r2s2r_cli.stages.estimate.report import run_report
from r2s2r_cli.stages.estimate.run import RunState, estimate_run
from schemas.estimate import EstimateSettings
from schemas.results_estimate import EstimateReport
from schemas.robot import Robot

__all__ = ["estimate"]

Show = Callable[[str, int, int, str], None]
"""Progress: part of the work, items done and in all, a word beside them (`Console.parts`)."""


def estimate(
    recording: ArtifactData,
    robot: Robot,
    settings: EstimateSettings,
    *,
    pictures: Pictures | None = None,
    show: Show = lambda part, done, total, word: None,
) -> tuple[ArtifactData, EstimateReport]:
    """Estimate every run of a recording; the layout is that of `schemas/estimate.py`.

    pictures: gives the encoded images of a run (`camera_input.py`); without them only runs with observed end caps can
    be estimated. A run that has both is estimated from its end caps. The report of the first estimated run warns of
    those that were left out, runs of pictures in which the robot cannot be tracked among them.

    Raises InputError where no run can be estimated, for a run with fewer than five kept frames, of another robot, with
    numbers that are not finite, or where no run has pictures in which the robot is found; NumericalError where the
    smoother cannot explain a track.
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
    usable = [run for run in streams if _usable(streams[run], pictures)]
    left_out = [
        f"run {run} of the recording is left out: it holds neither observed end caps nor camera images"
        for run in streams
        if run not in usable
    ]
    refused: InputError | NumericalError | None = None
    for run in usable or streams:  # none usable: `estimate_run` refuses the first with what it holds
        try:
            state = _state(run, streams[run], robot, settings, pictures, show)
        except (InputError, NumericalError) as error:
            if "caps" in streams[run] or run not in usable:
                raise
            # A robot that left the picture in one run says nothing about the others.
            refused = refused or error
            left_out.append(f"run {run} of the recording is left out: {error.what}; received: {error.received}")
            continue
        groups.update(run_groups(state))
        reports.append(run_report(state))
    if not reports and refused is not None:
        raise refused
    reports[0] = reports[0].model_copy(update={"warnings": (*left_out, *reports[0].warnings)})
    return ArtifactData(kind="estimate", groups=groups), EstimateReport(runs=tuple(reports))


def _usable(streams: dict[str, Group], pictures: Pictures | None) -> bool:
    return "caps" in streams or ("camera" in streams and pictures is not None)


def _state(
    run: str,
    streams: dict[str, Group],
    robot: Robot,
    settings: EstimateSettings,
    pictures: Pictures | None,
    show: Show,
) -> RunState:
    if "caps" in streams or "camera" not in streams or pictures is None:
        return estimate_run(run, streams, robot, settings)
    from r2s2r_cli.stages.estimate.camera_run import camera_run

    return camera_run(run, streams, robot, settings, pictures, show)
