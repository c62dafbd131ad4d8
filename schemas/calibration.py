"""The calibration: what was measured offline, on the bench, beside the robot (paper, "Offline Robot Measurements")."""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column

LINE_STATES = {
    0: "good",
    1: "dead: the slope cannot be told from zero",
    2: "falling: the capacitance falls with the length",
}

HISTORY_STATES = {
    0: "good",
    1: "failed fit: the slope is zero",
    2: "failed fit: the slope is negative",
    3: "suspect: the slope is far from the median of this sensor",
}

CHANGE_STATES = {
    0: "recalibrated",
    1: "carried over: the same line as before, nothing was measured",
    2: "swap: the change is too large for a drift, sensor or robot was exchanged",
}

POINTS = GroupSpec(
    path="points",
    description="the table of length and capacitance, every row of the source, with its residuals",
    datasets=(
        column("set", "int64", ("point",), "index", "set of the point, row of group `lines`"),
        column("sensor", "int64", ("point",), "index", "sensor, position in robot.toml"),
        column("length", "float64", ("point",), "m", "length, measured with a rule"),
        column("capacitance", "float64", ("point",), "F", "capacitance at that length"),
        column("residual", "float64", ("point",), "m", "length read from the line minus the measured length",
          nan_means="the sensor is dead"),
        column("loo_residual", "float64", ("point",), "m", "the same, from the line fitted without this point",
          nan_means="the sensor is dead"),
        column("source_row", "int64", ("point",), "index", "line of the source file, 1-based"),
    ),
)  # fmt: skip

LINES = GroupSpec(
    path="lines",
    description="capacitance [F] = slope length + offset, per set and sensor; least squares in the capacitance",
    datasets=(
        column("name", "str", ("set",), "1", "name of the set"),
        column("rms_set", "float64", ("set",), "m", "residual rms in length over all points of the set's live sensors",
          nan_means="no live sensor"),
        column("slope", "float64", ("set", "sensor"), "F/m", "slope"),
        column("slope_se", "float64", ("set", "sensor"), "F/m", "standard error of the slope"),
        column("offset", "float64", ("set", "sensor"), "F", "capacitance at length zero"),
        column("rms", "float64", ("set", "sensor"), "m", "residual rms in length", nan_means="the sensor is dead"),
        column("worst", "float64", ("set", "sensor"), "m", "largest residual in length", nan_means="the sensor is dead"),
        column("loo_rms", "float64", ("set", "sensor"), "m", "leave-one-out rms in length",
          nan_means="the sensor is dead"),
        column("quadratic_rms", "float64", ("set", "sensor"), "m", "residual rms of a parabola, over the line's slope",
          nan_means="the sensor is dead, or has fewer than five different lengths"),
        column("count", "int64", ("set", "sensor"), "count", "number of points"),
        column("state", "uint8", ("set", "sensor"), "code", "whether the line can be used", codes=LINE_STATES),
    ),
    attributes=(
        AttributeSpec(name="used", type="str", required=False, description="set whose lines go into robot.toml"),
    ),
)  # fmt: skip

HISTORY = GroupSpec(
    path="history",
    description="dated sets of lines, sorted by file and date",
    datasets=(
        column("file", "str", ("entry",), "1", "file the set stood in; sets of different files are not compared"),
        column("commit", "str", ("entry",), "1", "version of that file"),
        column("time", "float64", ("entry",), "unix s", "date of the set, read as UTC where it names no zone"),
        column("slope", "float64", ("entry", "sensor"), "F/m", "slope"),
        column("offset", "float64", ("entry", "sensor"), "F", "capacitance at length zero"),
        column("state", "uint8", ("entry", "sensor"), "code", "whether the line can be used", codes=HISTORY_STATES),
        column("range", "float64", ("sensor", "pair"), "m", "working range of the sensor: shortest and longest length"),
        column("median_change", "float64", ("sensor",), "m", "median size of the change a recalibration made",
          nan_means="never recalibrated"),
        column("p90_change", "float64", ("sensor",), "m", "90th percentile of that size", nan_means="never recalibrated"),
        column("median_rate", "float64", ("sensor",), "m/s", "median size of the change over the time since",
          nan_means="never recalibrated"),
    ),
    attributes=(
        AttributeSpec(name="range_from", type="str", description="where the working range was taken from"),
        AttributeSpec(name="swap_threshold", type="float", unit="m", description="change that counts as a swap"),
    ),
)  # fmt: skip

DRIFT = GroupSpec(
    path="drift",
    description="what each usable line changed against the usable line before it, of the same file and sensor",
    datasets=(
        column("sensor", "int64", ("change",), "index", "sensor, position in robot.toml"),
        column("before", "int64", ("change",), "index", "entry of `history` that the earlier line was measured for"),
        column("after", "int64", ("change",), "index", "entry of `history` with the later line"),
        column("elapsed", "float64", ("change",), "s", "time between the two"),
        column("change", "float64", ("change",), "m", "new length minus old length for the capacitance that "
          "the old line gives in the middle of the working range"),
        column("change_max", "float64", ("change",), "m", "largest size of that difference over the working range"),
        column("state", "uint8", ("change",), "code", "what happened", codes=CHANGE_STATES),
    ),
)  # fmt: skip

TENDON_POINTS = GroupSpec(
    path="tendon_points",
    description="the measured force-displacement points, every row of the source",
    datasets=(
        column("curve", "int64", ("point",), "index", "curve of the point, row of group `tendons`"),
        column("displacement", "float64", ("point",), "m", "stretch beyond the rest length"),
        column("force", "float64", ("point",), "N", "tension"),
    ),
)

TENDONS = GroupSpec(
    path="tendons",
    description="force [N] = k1 x + k2 x^2 + k3 x^3 per curve, and their average (paper, figure of the measurements)",
    datasets=(
        column("name", "str", ("curve",), "1", "name of the curve"),
        column("k1", "float64", ("curve",), "N/m", "linear coefficient: stiffness at rest"),
        column("k2", "float64", ("curve",), "N/m^2", "quadratic coefficient"),
        column("k3", "float64", ("curve",), "N/m^3", "cubic coefficient"),
        column("rms", "float64", ("curve",), "N", "residual rms"),
        column("x_max", "float64", ("curve",), "m", "largest measured displacement"),
        column("stiffness_min", "float64", ("curve",), "N/m", "smallest slope of the fit on the measured range"),
        column("monotone", "bool", ("curve",), "bool", "the fit rises everywhere on the measured range"),
        column("x", "float64", ("grid",), "m", "displacements of the band, 0 to the end of the shortest curve"),
        column("mean", "float64", ("grid",), "N", "mean of the fits; equals the polynomial of the mean coefficients"),
        column("sd", "float64", ("grid",), "N", "standard deviation of the fits between curves",
          nan_means="one curve only"),
    ),
    attributes=(
        AttributeSpec(name="k1_mean", type="float", unit="N/m", description="mean of k1"),
        AttributeSpec(name="k2_mean", type="float", unit="N/m^2", description="mean of k2"),
        AttributeSpec(name="k3_mean", type="float", unit="N/m^3", description="mean of k3"),
        AttributeSpec(name="x_common", type="float", unit="m", description="end of the range that every curve covers"),
        AttributeSpec(name="monotone", type="bool", description="the average rises everywhere on that range"),
    ),
)  # fmt: skip

MASS_PARTS = GroupSpec(
    path="mass_parts",
    description="the weighed parts, each a solid around the rod's axis",
    datasets=(
        column("rod", "int64", ("part",), "index", "rod, position in robot.toml"),
        column("name", "str", ("part",), "1", "name of the part"),
        column("shape", "str", ("part",), "1", "point, sphere, cylinder or tube"),
        column("mass", "float64", ("part",), "kg", "mass"),
        column("offset", "float64", ("part",), "m", "centre along the rod from its middle, positive towards the odd cap",
          frame="R"),
        column("radius", "float64", ("part",), "m", "outer radius, 0 for a point"),
        column("length", "float64", ("part",), "m", "length along the rod, 0 for point and sphere"),
        column("inner_radius", "float64", ("part",), "m", "inner radius, 0 except for a tube"),
    ),
)  # fmt: skip

MASSES = GroupSpec(
    path="masses",
    description="what the parts make of each rod",
    datasets=(
        column("rod", "int64", ("weighed",), "index", "rod, position in robot.toml"),
        column("mass", "float64", ("weighed",), "kg", "mass of the rod with everything on it"),
        column("com", "float64", ("weighed",), "m", "centre of mass along the rod from its middle", frame="R"),
        column("inertia_axial", "float64", ("weighed",), "kg m^2", "moment of inertia about the rod's axis"),
        column("inertia_transverse", "float64", ("weighed",), "kg m^2",
          "moment of inertia about any axis through the centre of mass across the rod"),
    ),
)  # fmt: skip

CALIBRATION = ArtifactSpec(
    kind="calibration",
    version=1,
    title="offline measurements",
    filename="calibration.h5",
    level="project",
    groups=(POINTS, LINES, HISTORY, DRIFT, TENDON_POINTS, TENDONS, MASS_PARTS, MASSES),
)
