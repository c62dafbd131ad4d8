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

REPEATING = GroupSpec(
    path="repeating",
    description="test segments with what the simulator leaves behind in training segments and the robot repeats with the same target "
    "after the same target: a statistical term beside the simulator, not physics",
    datasets=(
        column("run", "str", ("held",), "1", "run"),
        column("interval", "int64", ("held",), "index", "target interval, 1-based"),
        column("repeats", "int64", ("held",), "count", "training segments of the same transition that start on the same caps"),
        column("weight", "float64", ("held",), "1", "what these count beside the simulator at the key frame, 0 to 1; 0: there are none"),
        column("keyframe_error", "float64", ("held", "cap", "xyz"), "m", "predicted minus observed end caps at the key frame", frame="W"),
        column("keyframe_cap_rmse", "float64", ("held",), "m", "root mean square over caps of the distance at the key frame"),
    ),
    attributes=(
        AttributeSpec(name="used", type="bool", description="it is part of the prediction: training segments are predicted better with it"),
        AttributeSpec(name="gap", type="float", unit="m", description="what the simulator is off at training key frames beyond the floor"),
        AttributeSpec(name="floor", type="float", unit="m", description="how far the robot repeats itself in training segments"),
        AttributeSpec(name="contrasts", type="int", description="independent differences that the floor rests on"),
        AttributeSpec(name="dof", type="float", description="independent squares in the error of one segment"),
        AttributeSpec(name="left_out", type="float", unit="m", required=False, description="key-frame error of training segments with the repeats of the others"),
        AttributeSpec(name="left_out_alone", type="float", unit="m", required=False, description="the same, the simulator alone"),
        AttributeSpec(name="left_out_segments", type="int", required=False, description="segments that both rest on"),
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
        column("predicted", "float64", ("free_frame", "cap", "xyz"), "m", "simulated, and what repeats added to it: no physics", frame="W",
               required=False),
    ),
)  # fmt: skip
