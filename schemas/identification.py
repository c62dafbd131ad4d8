"""The identification: which numbers the simulator learned from the runs, how sure they are, and how well they predict.

Numbers of a parameter stand in the unit of its row (`parameters/unit`); their datasets have unit 1 here. Axes called
`parameter` are the rows of `parameters`, axes called `baseline` the rows of `measures/baseline`.
"""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column
from schemas.identification_runs import FIT, FREE_RUN, REPEATING, RUN

COORDINATES = {0: "linear: z = x", 1: "log: z = ln x", 2: "logit: z = ln((x - lower) / (upper - x))"}

TRUST = {
    0: "identified: the runs say it",
    1: "weak: the runs say it, but hardly better than prior and bounds",
    2: "not identifiable: the runs do not say it, its value means nothing",
    3: "on a bound: the runs ask for more than the bound allows",
    4: "fixed: it was not free",
}

NOT_IDENTIFIABLE = 2
"""The code of TRUST for a number that nothing speaks for."""
FIXED_BY_HAND = 4
"""The code of TRUST for a number that was given."""

ROLES = {0: "not used", 1: "train", 2: "test"}

_NO_SD = "the runs do not say it"

FIT_FACTS = GroupSpec(
    path="fit",
    description="how it was fitted",
    required=True,
    attributes=(
        AttributeSpec(name="method", type="str", description="optimiser", choices=("default", "paper", "cma")),
        AttributeSpec(name="drive", type="str", description="what drove the motors", choices=("command replay", "closed loop")),
        AttributeSpec(name="loss", type="str", description="what was made small, in words"),
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="engine", type="str", description="what simulated: name and version"),
        AttributeSpec(name="effects", type="str", description="ids of the effects in the simulator, separated by spaces"),
        AttributeSpec(name="step", type="float", unit="s", description="time step of the engine"),
        AttributeSpec(name="seed", type="int", description="seed of starts, re-drawn noise and bootstrap"),
        AttributeSpec(name="rollouts", type="int", description="simulations of one window, all starts together"),
        AttributeSpec(name="cost", type="float", description="half the sum of the squared scaled residuals, robust loss and priors included"),
        AttributeSpec(name="residuals", type="int", description="number of scaled residuals"),
        AttributeSpec(name="converged", type="bool", description="the best start ended because nothing changed any more"),
        AttributeSpec(name="reason", type="str", description="why the best start ended, in words"),
        AttributeSpec(name="mask", type="str", required=False, description="direction mask of the Key Frame Loss, in words (method paper)"),
    ),
)  # fmt: skip

PARAMETERS = GroupSpec(
    path="parameters",
    description="the parameters, free and fixed by hand",
    required=True,
    datasets=(
        column("name", "str", ("parameter",), "1", "name, as options and --json call it"),
        column("unit", "str", ("parameter",), "1", "unit of its numbers, SI; `1` where there is none"),
        column("what", "str", ("parameter",), "1", "what it is, in words"),
        column("value", "float64", ("parameter",), "1", "value with which the errors were found; where it is not identifiable nothing speaks for it, and it is the start where the runs do not depend on it at all"),
        column("sd", "float64", ("parameter",), "1", "standard deviation", nan_means=_NO_SD),
        column("lower", "float64", ("parameter",), "1", "lower end of the 95 % interval", nan_means=_NO_SD),
        column("upper", "float64", ("parameter",), "1", "upper end of the 95 % interval", nan_means=_NO_SD),
        column("range", "float64", ("parameter", "pair"), "1", "smallest and largest value over starts and re-drawn noise",
               nan_means="no study of the range was made, or the runs do not say it"),
        column("bounds", "float64", ("parameter", "pair"), "1", "smallest and largest allowed value", nan_means="no bound"),
        column("start", "float64", ("parameter",), "1", "value of robot.toml (or of the estimate that was continued), where the fit began"),
        column("prior_mean", "float64", ("parameter",), "1", "mean of the prior", nan_means="flat"),
        column("prior_sd", "float64", ("parameter",), "1", "standard deviation of the prior, in the coordinate (log: a share of the value)",
               nan_means="flat"),
        column("coordinate", "uint8", ("parameter",), "code", "coordinate z it was searched in", codes=COORDINATES),
        column("identifiable", "bool", ("parameter",), "bool", "the runs determine it"),
        column("trust", "uint8", ("parameter",), "code", "what the number is worth", codes=TRUST),
        column("reason", "str", ("parameter",), "1", "why, in words"),
        column("first_mean", "float64", ("parameter",), "1", "mean of the prior before any run (--online)", required=False,
               nan_means="flat"),
        column("first_sd", "float64", ("parameter",), "1", "its standard deviation, in the coordinate", required=False,
               nan_means="flat"),
        column("known", "float64", ("parameter",), "1", "what the next --online goes on from", required=False,
               nan_means="nothing is known"),
        column("known_sd", "float64", ("parameter",), "1", "its standard deviation, in the coordinate", required=False,
               nan_means="nothing is known"),
    ),
)  # fmt: skip

COVARIANCE = GroupSpec(
    path="covariance",
    description="covariance of the coordinates z at the solution, nuisances marginalised",
    datasets=(
        column("covariance", "float64", ("parameter", "parameter2"), "1", "covariance of the coordinates", nan_means=_NO_SD),
        column("correlation", "float64", ("parameter", "parameter2"), "1", "correlation of the coordinates", nan_means=_NO_SD),
    ),
)  # fmt: skip

IDENTIFIABILITY = GroupSpec(
    path="identifiability",
    description="what the runs can say, before any fit: spectrum of the normal matrix, each column scaled by the width of its prior "
    "or range",
    datasets=(
        column("column_norm", "float64", ("parameter",), "1", "size of the change of all scaled residuals for one width of the parameter; "
               "0: the runs do not depend on it, or it was fixed"),
        column("eigenvalue", "float64", ("direction",), "1", "information about each direction; below the threshold the prior or range says more, rising"),
        column("eigenvector", "float64", ("direction", "parameter"), "1", "the directions, in scaled coordinates, rows of length 1"),
        column("weak", "bool", ("direction",), "bool", "the eigenvalue lies below the threshold"),
        column("words", "str", ("direction",), "1", "the direction in words: which parameters move together"),
    ),
    attributes=(
        AttributeSpec(name="threshold", type="float", description="eigenvalue below which a direction is weak"),
        AttributeSpec(name="condition", type="float", description="largest over smallest eigenvalue that is not 0"),
    ),
)  # fmt: skip

TRACE = GroupSpec(
    path="trace",
    description="every accepted step of every start, in order",
    datasets=(
        column("start", "int64", ("step",), "index", "row of group `starts`"),
        column("stage", "str", ("step",), "1", "part of the fit, such as the horizon"),
        column("iteration", "int64", ("step",), "count", "iterations of this start in this stage"),
        column("cost", "float64", ("step",), "1", "cost; comparable within one stage"),
        column("value", "float64", ("step", "parameter"), "1", "values of the parameters", required=False),
    ),
)  # fmt: skip

STARTS = GroupSpec(
    path="starts",
    description="the fits from other starts, and from observations with noise drawn anew",
    datasets=(
        column("kind", "uint8", ("start",), "code", "what differs from the first", codes={0: "start", 1: "noise drawn anew"}),
        column("first", "float64", ("start", "parameter"), "1", "values at the beginning"),
        column("last", "float64", ("start", "parameter"), "1", "values at the end"),
        column("cost", "float64", ("start",), "1", "cost at the end"),
        column("reason", "str", ("start",), "1", "why it ended, in words"),
    ),
)  # fmt: skip

PROFILES = GroupSpec(
    path="profiles",
    description="profile likelihood: one parameter held on a grid, all others fitted again",
    datasets=(
        column("parameter", "int64", ("profile",), "index", "row of group `parameters`"),
        column("value", "float64", ("profile", "point"), "1", "grid of the parameter, rising", nan_means="fewer points than the longest profile"),
        column("cost", "float64", ("profile", "point"), "1", "cost with all others fitted, minus that of the solution", nan_means="as value"),
        column("interval", "float64", ("profile", "pair"), "1", "where the cost reaches the threshold: the 95 % interval of the profile",
               nan_means="it does not rise that far within the grid"),
        column("threshold", "float64", ("profile",), "1", "rise of the cost at the ends of the interval: 1.92 for many windows whose residuals are as large as the noise; times the inflation of the variance where they are larger, and more where windows are few"),
        column("words", "str", ("profile",), "1", "how the interval differs from that of the covariance"),
    ),
)  # fmt: skip

WINDOWS = GroupSpec(
    path="windows",
    description="the training windows and their start states, fitted along as nuisances",
    datasets=(
        column("run", "str", ("window",), "1", "run"),
        column("interval", "int64", ("window",), "index", "first target interval, 1-based"),
        column("t_first", "float64", ("window",), "s", "time of the start"),
        column("t_last", "float64", ("window",), "s", "time of the last key frame"),
        column("p_WE", "float64", ("window", "cap", "xyz"), "m", "end caps of the start state", frame="W"),
        column(
            "v_WE", "float64", ("window", "cap", "xyz"), "m/s", "velocity of the end caps of the start state", frame="W"
        ),
        column("shift", "float64", ("window", "cap", "xyz"), "m", "start state minus estimated state", frame="W"),
    ),
)

SEGMENTS = GroupSpec(
    path="segments",
    description="every complete target interval, simulated from its own start by command replay: how far the end caps are off",
    datasets=(
        column("run", "str", ("segment",), "1", "run"),
        column("interval", "int64", ("segment",), "index", "target interval, 1-based"),
        column("role", "uint8", ("segment",), "code", "what it was used for", codes=ROLES),
        column("t_first", "float64", ("segment",), "s", "time of its start"),
        column("t_last", "float64", ("segment",), "s", "time of its key frame"),
        column("keyframe_error", "float64", ("segment", "cap", "xyz"), "m", "simulated minus observed end caps at the key frame", frame="W"),
        column("keyframe_cap_rmse", "float64", ("segment",), "m", "root mean square over caps of the distance at the key frame"),
        column("cap_rmse", "float64", ("segment",), "m", "the same over all frames of the segment"),
        column("baseline_cap_rmse", "float64", ("segment", "baseline"), "m", "keyframe_cap_rmse of the baselines",
               nan_means="the baseline has nothing to say here"),
        column("lag1", "float64", ("segment", "cap"), "1", "correlation of neighbouring residuals along the segment; 0 where they are white",
               nan_means="too few frames"),
        column("white", "bool", ("segment", "cap"), "bool", "that correlation lies within 2 standard deviations of 0"),
    ),
)  # fmt: skip

MEASURES = GroupSpec(
    path="measures",
    description="the measures of the design over train and test segments, beside baselines and floor",
    required=True,
    datasets=(
        column("role", "uint8", ("measure",), "code", "over which segments", codes=ROLES),
        column("metric", "str", ("measure",), "1", "name: keyframe_cap_rmse, free_run_cap_mean, free_run_closed_loop_cap_mean"),
        column("value", "float64", ("measure",), "m", "of the predictor", nan_means="it does not exist for these segments"),
        column("interval", "float64", ("measure", "pair"), "m", "95 % interval by bootstrap over segments", nan_means="fewer than two segments"),
        column("floor", "float64", ("measure",), "m", "what remains when nothing is wrong", nan_means="not known"),
        column("baseline", "str", ("baseline",), "1", "name of each baseline"),
        column("baseline_value", "float64", ("measure", "baseline"), "m", "the same measure of each baseline",
               nan_means="the baseline has nothing to say here"),
        column("baseline_interval", "float64", ("measure", "baseline", "pair"), "m", "its 95 % interval", nan_means="as baseline_value"),
    ),
    attributes=(
        AttributeSpec(name="predictor", type="str", required=False, description="whose errors `value` holds over test segments: the simulator with the identified numbers, or that with what repeats; over training segments it is the simulator"),
    ),
)  # fmt: skip

SITES = GroupSpec(
    path="sites",
    description="attachment points of the cables after identification",
    datasets=(
        column("p_RS", "float64", ("cable", "pair", "xyz"), "m", "both attachment points of every cable", frame="R"),
    ),
)

SENSING = GroupSpec(
    path="sensing",
    description="what the robot's controller reads, measured where it saw cables arrive in the training intervals: simulations with "
    "the controller in the loop read the same",
    attributes=(
        AttributeSpec(name="camera_delay", type="float", unit="s", description="a frame stamped t shows what the controller read so much earlier (below 0: later)"),
        AttributeSpec(name="command_delay", type="float", unit="s", description="how late its commands reach the winches"),
        AttributeSpec(name="arrivals", type="int", description="of cables at their targets, on which it rests"),
        AttributeSpec(name="by_camera", type="bool", description="the camera showed how the sensors err (runs/RUN/sensor_fit of the estimate); else the arrivals did"),
    ),
    datasets=(
        column("bias", "float64", ("actuated",), "m", "reading minus distance of the cap centres, sensor of each winched cable"),
    ),
)  # fmt: skip

HISTORY = GroupSpec(
    path="history",
    description="--online: the estimate after each run, in the order in which they came",
    datasets=(
        column("run", "str", ("update",), "1", "run that was added"),
        column("value", "float64", ("update", "parameter"), "1", "value after it"),
        column("sd", "float64", ("update", "parameter"), "1", "standard deviation after it", nan_means=_NO_SD),
    ),
)

IDENTIFICATION = ArtifactSpec(
    kind="identification",
    version=1,
    title="identified parameters",
    filename="30-identify.h5",
    level="iteration",
    groups=(
        FIT_FACTS, PARAMETERS, COVARIANCE, IDENTIFIABILITY, TRACE, STARTS, PROFILES, WINDOWS, SEGMENTS, MEASURES, REPEATING, SITES,
        SENSING, HISTORY, RUN, FIT, FREE_RUN,
    ),
)  # fmt: skip
