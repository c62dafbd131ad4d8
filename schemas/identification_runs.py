"""What an identification keeps of each run: observed and simulated end caps, segment by segment and free-running."""

from __future__ import annotations

from schemas.base import AttributeSpec, GroupSpec, column

RUN = GroupSpec(
    path="runs/{run}",
    description="one recorded run that was trained on or tested",
    required=True,
    attributes=(
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="nature", type="str", required=False, description="what the recording is, in words: a measurement, a simulation"),
    ),
)  # fmt: skip

FIT = GroupSpec(
    path="runs/{run}/fit",
    description="every complete target interval, simulated from its own start by command replay; frames in order of time",
    datasets=(
        column("t", "float64", ("frame",), "s", "time since the start of the run"),
        column("interval", "int64", ("frame",), "index", "target interval, 1-based"),
        column("observed", "float64", ("frame", "cap", "xyz"), "m", "end caps as the tracker saw them, ground at z = 0", frame="W",
               nan_means="not observed"),
        column("simulated", "float64", ("frame", "cap", "xyz"), "m", "end caps of the simulation", frame="W"),
    ),
)  # fmt: skip

FREE_RUN = GroupSpec(
    path="runs/{run}/free_run",
    description="one start at the first test frame and no more: command replay to the end of the test intervals that follow",
    datasets=(
        column("t", "float64", ("free_frame",), "s", "time since the start of the run"),
        column("chain", "int64", ("free_frame",), "count", "number of the start: test intervals that do not follow each other start anew"),
        column("observed", "float64", ("free_frame", "cap", "xyz"), "m", "end caps as the tracker saw them, ground at z = 0", frame="W",
               nan_means="not observed"),
        column("simulated", "float64", ("free_frame", "cap", "xyz"), "m", "end caps of the simulation", frame="W"),
        column("closed_loop", "float64", ("free_frame", "cap", "xyz"), "m", "the same with the controller in the loop", frame="W",
               required=False, nan_means="the simulation had ended"),
    ),
)  # fmt: skip
