"""The diagnosis: where the gap lies, which effect causes it, how far it shrinks. `70-diagnose.h5`."""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column

VERDICTS = ("effect", "pair", "ambiguous", "no_gap", "unknown")

VERDICT = GroupSpec(
    path="verdict",
    description="what was concluded",
    required=True,
    attributes=(
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="verdict", type="str", description="the verdict", choices=VERDICTS),
        AttributeSpec(name="effects", type="str", description="ids it commits to, separated by spaces"),
        AttributeSpec(name="probability", type="float", description="of them"),
        AttributeSpec(name="set90", type="str", description="names that hold the truth with 90 %, separated by spaces"),
        AttributeSpec(name="calibrated", type="str", description="where the probabilities come from"),
        AttributeSpec(name="floor", type="float", unit="m", description="key-frame cap RMSE where nothing is wrong"),
        AttributeSpec(name="floor_from", type="str", description="where the floor comes from"),
        AttributeSpec(name="chance", type="float", description="gain that the best of the catalogue reaches by chance in one of 20 cases [nats]"),
        AttributeSpec(name="within_run", type="bool", description="judged intervals share a run with fitted ones"),
    ),
)  # fmt: skip

RANKING = GroupSpec(
    path="ranking",
    description="names by probability",
    required=True,
    datasets=(
        column("name", "str", ("name",), "1", "effect, none or unknown"),
        column("elpd_gain", "float64", ("name",), "1", "held-out log predictive density over the refit nominal model, a piece 6 nats at most [nats]"),
        column("marginal", "float64", ("name",), "1", "log ratio of marginal likelihoods of all data, a piece 6 nats at most [nats]", nan_means="not fitted, or no effect", required=False),
        column("parity", "float64", ("name",), "1", "what the parity stage says for it [nats]", required=False),
        column("probability", "float64", ("name",), "1", "of the name"),
        column("rmse", "float64", ("name",), "m", "of the caps at the ends of intervals left out", nan_means="not one model"),
        column("element", "str", ("name",), "1", "part that it sits at, in words; empty: none"),
        column("channel", "str", ("name",), "1", "where it acts; empty: none"),
    ),
)  # fmt: skip

SIZES = GroupSpec(
    path="sizes",
    description="fitted numbers of the effects",
    required=True,
    datasets=(
        column("name", "str", ("number",), "1", "EFFECT.PARAMETER or EFFECT.PARAMETER.ELEMENT"),
        column("value", "float64", ("number",), "1", "in its own unit"),
        column("lower", "float64", ("number",), "1", "lower end of the 90 % interval"),
        column("upper", "float64", ("number",), "1", "upper end"),
        column("unit", "str", ("number",), "1", "of the number"),
    ),
)  # fmt: skip

SCREENING = GroupSpec(
    path="screening",
    description="every effect at every element, by its finite response",
    required=True,
    datasets=(
        column("name", "str", ("candidate",), "1", "effect, with its element"),
        column("gain", "float64", ("candidate",), "1", "log likelihood over the refit nominal model, nuisances fitted linearly [nats]", nan_means="no finite response"),
        column("absorbed", "float64", ("candidate",), "1", "share of its response that the nuisances explain"),
        column("seen", "float64", ("candidate",), "1", "size of its response over noise and floor"),
    ),
)  # fmt: skip

SEGMENTS = GroupSpec(
    path="segments",
    description="fitted target intervals, each simulated from its own start and left out of the fit",
    required=True,
    datasets=(
        column("run", "str", ("segment",), "1", "its run"),
        column("interval", "int64", ("segment",), "index", "target interval, 1-based"),
        column("t", "float64", ("segment", "pair"), "s", "start and end"),
        column("refit", "float64", ("segment",), "m", "cap RMSE at the end, refit nominal model", nan_means="not simulated"),
        column("effect", "float64", ("segment",), "m", "the same with the best effect", nan_means="not simulated"),
        column("misfit", "float64", ("segment",), "1", "squares over what noise and floor explain, refit nominal model", nan_means="not simulated"),
        column("gap", "bool", ("segment",), "bool", "it stands out"),
        column("xy", "float64", ("segment", "cap", "pair"), "m", "end caps at its end over the ground", frame="W"),
        column("error", "float64", ("segment", "cap", "xyz"), "m", "simulated minus observed caps at its end, refit nominal model", frame="W", nan_means="not simulated"),
    ),
)  # fmt: skip

JUDGED = GroupSpec(
    path="judged",
    description="judged target intervals, causal starts, nothing fitted to them",
    datasets=(
        column("name", "str", ("judged",), "1", "RUN:N"),
        column("nominal", "float64", ("judged",), "m", "cap RMSE at the key frame, stale nominal model", nan_means="not simulated"),
        column("refit", "float64", ("judged",), "m", "refit nominal model", nan_means="not simulated"),
        column("effect", "float64", ("judged",), "m", "refit with the effect", nan_means="not simulated"),
        column("ceiling", "float64", ("judged",), "m", "refit corrected by a black box", nan_means="not simulated"),
    ),
)  # fmt: skip

ROBOT = GroupSpec(
    path="robot",
    description="for the drawing: the robot at rest",
    required=True,
    datasets=(
        column("p_WE", "float64", ("cap", "xyz"), "m", "end caps", frame="W"),
        column("cable", "int64", ("cable", "pair"), "index", "caps of every cable"),
        column("actuated", "bool", ("cable",), "bool", "it has a winch"),
    ),
)  # fmt: skip

PLACE = GroupSpec(
    path="place",
    description="what the contact probes say of the floor",
    datasets=(
        column("x", "float64", ("x",), "m", "of the grid", frame="W"),
        column("y", "float64", ("y",), "m", "of the grid", frame="W"),
        column("value", "float64", ("y", "x"), "1", "change of friction there", nan_means="nothing was seen"),
        column("weight", "float64", ("y", "x"), "1", "how much was seen there"),
    ),
)  # fmt: skip

DIAGNOSIS = ArtifactSpec(
    kind="diagnosis",
    version=1,
    title="where the gap lies, what causes it, how far it shrinks",
    filename="70-diagnose.h5",
    level="iteration",
    groups=(VERDICT, RANKING, SIZES, SCREENING, SEGMENTS, JUDGED, ROBOT, PLACE),
)
