"""The floor: what remains of a gap when nothing is wrong with the simulator. Project level, `floor.h5`."""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column

BASES = ("repeats of a policy", "commissioning runs", "same phase within a run")
"""What the repeats of one phase are, from the strongest evidence to the weakest."""

CAPS = GroupSpec(
    path="caps",
    description="key-frame cap RMSE of a simulator with nothing wrong in it, from how far the robot repeats itself",
    attributes=(
        AttributeSpec(name="floor", type="float", unit="m", description="the floor"),
        AttributeSpec(name="lower", type="float", unit="m", required=False, description="lower end of its interval"),
        AttributeSpec(name="upper", type="float", unit="m", required=False, description="upper end of its interval"),
        AttributeSpec(name="level", type="float", required=False, description="level of the interval"),
        AttributeSpec(name="sensor", type="float", unit="m", description="part of it that the noise of the caps explains"),
        AttributeSpec(name="repeatability", type="float", unit="m", description="what is left of it without that"),
        AttributeSpec(name="contrasts", type="int", description="independent comparisons it rests on"),
        AttributeSpec(name="basis", type="str", description="what was compared", choices=BASES),
        AttributeSpec(name="carry", type="str", description="what of the start is carried over", choices=("pose", "displacement")),
    ),
    datasets=(
        column("run", "str", ("repeat",), "1", "run of each interval that was compared, with its iteration: 1:crawl"),
        column("interval", "int64", ("repeat",), "index", "target interval of that run, 1-based"),
        column("phase", "int64", ("repeat",), "index", "phase it belongs to: intervals of one phase were compared"),
        column("deviation", "float64", ("repeat",), "m", "cap RMSE of its key frame about the mean of its phase"),
        column("deviation_cap", "float64", ("repeat", "cap"), "m", "the same of each cap"),
    ),
)  # fmt: skip

LENGTHS = GroupSpec(
    path="lengths",
    description="how far the cable lengths, as the sensors give them, repeat at the end of target intervals",
    attributes=(
        AttributeSpec(name="floor", type="float", unit="m", description="over all cables with a sensor, root mean square"),
        AttributeSpec(name="basis", type="str", description="what was compared", choices=BASES),
        AttributeSpec(name="contrasts", type="int", description="independent comparisons of each cable"),
    ),
    datasets=(
        column("cable", "int64", ("sensor",), "index", "cable that each sensor measures"),
        column("sd", "float64", ("sensor",), "m", "standard deviation of the length at the end of an interval, about its phase",
          nan_means="the sensor was not heard often enough"),
        column("noise", "float64", ("sensor",), "m", "of it, noise of a single reading, from differences of readings",
          nan_means="the sensor was not heard often enough"),
    ),
)  # fmt: skip

NUMERICS = GroupSpec(
    path="numerics",
    description="engine against the rig's MuJoCo model, all effects off, after a random gait step of 1 s from one state",
    attributes=(
        AttributeSpec(name="floor", type="float", unit="m", description="cap RMSE over all gait steps"),
        AttributeSpec(name="median", type="float", unit="m", description="median of the gait steps"),
        AttributeSpec(name="worst", type="float", unit="m", description="worst gait step"),
        AttributeSpec(name="moved", type="float", unit="m", description="median way of the caps in a gait step"),
        AttributeSpec(name="engine_step", type="float", unit="s", description="step of the engine"),
        AttributeSpec(name="rig_step", type="float", unit="s", description="step of MuJoCo"),
    ),
    datasets=(
        column("seed", "int64", ("gait",), "index", "seed of each gait step"),
        column("error", "float64", ("gait",), "m", "cap RMSE at its end"),
        column("way", "float64", ("gait",), "m", "root mean square way of the caps"),
    ),
)  # fmt: skip

FLOOR = ArtifactSpec(
    kind="floor",
    version=1,
    title="the floor",
    filename="floor.h5",
    level="project",
    groups=(CAPS, LENGTHS, NUMERICS),
)
