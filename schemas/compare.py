"""The comparison: real runs and the same policies in one or several simulators. `60-compare.h5`."""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column

MODELS = GroupSpec(
    path="models",
    description="the simulators, in the order of the axis `model`",
    required=True,
    datasets=(
        column("name", "str", ("model",), "1", "what it is called"),
        column("words", "str", ("model",), "1", "where its numbers come from"),
        column("srcc_com", "float64", ("model",), "1", "Spearman's rank correlation with the robot over gaits: way of the centre of mass",
               nan_means="too few gaits"),
        column("srcc_turn", "float64", ("model",), "1", "the same of the turn", nan_means="too few gaits, or no heading"),
    ),
)  # fmt: skip

FLOOR = GroupSpec(
    path="floor",
    description="what a perfect simulator would be found to be wrong by",
    required=True,
    attributes=(
        AttributeSpec(name="com_end", type="float", unit="m", required=False, description="from repeats of the runs"),
        AttributeSpec(name="heading_end", type="float", unit="rad", required=False, description="from repeats of the runs"),
        AttributeSpec(name="segment", type="float", unit="s", required=False, description="duration of a target interval, from repeats"),
        AttributeSpec(name="keyframe_cap", type="float", unit="m", required=False, description="from repeats of the runs, else from floor.h5"),
        AttributeSpec(name="path", type="float", unit="m", required=False, description="centre of mass along the run, from repeats of the runs"),
        AttributeSpec(name="cap", type="float", unit="m", required=False, description="caps along the run, from repeats of the runs"),
        AttributeSpec(name="gait", type="float", unit="m", required=False,
                      description="caps at the end of an interval, laid on each other at its start, from repeats of the runs"),
    ),
)  # fmt: skip

RUN = GroupSpec(
    path="runs/{run}",
    description="one real run",
    required=True,
    attributes=(
        AttributeSpec(name="policy", type="str", description="name of the policy"),
        AttributeSpec(name="iteration", type="int", required=False, description="in which it was run"),
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="opening", type="float", unit="s", required=False,
                      description="how long the rest shape was that the run opened with; the comparison begins at its end"),
        AttributeSpec(name="opening_moved", type="float", unit="m", required=False,
                      description="how far the caps moved in it, up to a move over the ground, root mean square"),
        AttributeSpec(name="opening_travel", type="float", unit="m", required=False,
                      description="how far the centre of mass came in it over the ground"),
    ),
)  # fmt: skip

REAL = GroupSpec(
    path="runs/{run}/real",
    description="the real run, at equal shares of each target interval",
    required=True,
    datasets=(
        column("target", "float64", ("interval", "actuated"), "1", "target positions, 0 short .. 1 long"),
        column("duration", "float64", ("interval",), "s", "of each target interval"),
        column("p_WE_start", "float64", ("cap", "xyz"), "m", "end caps where the comparison begins: at the end of the opening rest, else at the first frame", frame="W"),
        column("p_WE", "float64", ("interval", "point", "cap", "xyz"), "m", "end caps", frame="W"),
        column("com", "float64", ("interval", "point", "xyz"), "m", "centre of mass", frame="W"),
    ),
)  # fmt: skip

SIMULATED = GroupSpec(
    path="runs/{run}/simulated",
    description="the same policy in every simulator, controller in the loop, laid on the real run where the comparison begins",
    required=True,
    datasets=(
        column("compared", "int64", ("model",), "count", "target intervals that real run and simulation have in common; 0: it could not be simulated"),
        column("trained_on", "bool", ("model",), "bool", "the simulator's numbers were learned from this run"),
        column("p_WE", "float64", ("model", "interval", "point", "cap", "xyz"), "m", "end caps at equal shares of each interval", frame="W",
               nan_means="not compared"),
        column("com", "float64", ("model", "interval", "point", "xyz"), "m", "centre of mass", frame="W", nan_means="not compared"),
        column("duration", "float64", ("model", "interval"), "s", "of each target interval", nan_means="not compared"),
        column("segment_end", "float64", ("model", "interval"), "m", "RMS cap distance to the real run at the end of each interval",
               nan_means="not compared"),
        column("gait", "float64", ("model", "interval"), "m", "the same, both laid on each other at the start of the interval",
               nan_means="not compared"),
        column("keyframe", "float64", ("model", "interval"), "m", "RMS cap distance at the key frame by command replay, each interval from "
               "its own start", nan_means="no motor commands, or not predicted"),
        column("com_end_error", "float64", ("model",), "m", "distance of the centres of mass over the ground at the end", nan_means="not compared"),
        column("heading_end_error", "float64", ("model",), "rad", "difference of how far both turned", nan_means="not compared, or no heading"),
        column("path_error", "float64", ("model",), "m", "RMS distance of the centres of mass over the ground", nan_means="not compared"),
        column("cap_rmse", "float64", ("model",), "m", "RMS distance of the caps", nan_means="not compared"),
    ),
)  # fmt: skip

COMPARISON = ArtifactSpec(
    kind="comparison",
    version=1,
    title="real and simulated runs side by side",
    filename="60-compare.h5",
    level="iteration",
    groups=(MODELS, FLOOR, RUN, REAL, SIMULATED),
)
