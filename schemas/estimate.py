"""The estimate: state of the robot at every kept frame, from an import or a recording. World frame W: ground at z = 0."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from schemas.base import ArtifactSpec, AttributeSpec, Frozen, GroupSpec, column
from schemas.policy import policy_group
from schemas.recording import COMMANDS, RUN as RECORDED_RUN
from schemas.segments import INTERVALS, SEGMENTS


class EstimateSettings(Frozen):
    """Settings of `estimate`. The reasons and the figures behind the defaults: docs/concepts/estimate.md.

    Upper bounds are what stops being the quantity: a clearance of a whole cap radius (0.1 m: of a 2 m robot) calls every
    low cap a contact, 2 m/s is faster than any cable reels, and over gaps of 10 s a robot takes several steps.
    """

    switch_kick_m_per_s: Annotated[float, Field(strict=True, ge=0, le=1)] = Field(
        default=0.02,
        description="sudden change of a cap's velocity when a motor is switched, sd per axis [m/s]; a third of a cable's speed",
    )
    gate_probability: Annotated[float, Field(strict=True, gt=0, lt=0.5)] = Field(
        default=1e-4,
        description="false alarm of one test for an outlier or jump; a run has about 1,000 tests, so 1 in 10 runs shows one",
    )
    contact_clearance_m: Annotated[float, Field(strict=True, gt=0, le=0.1)] = Field(
        default=0.003,
        description="a cap lower than this above the ground counts as touching [m]; twice the usual noise",
    )
    contact_lift_m_per_s: Annotated[float, Field(strict=True, gt=0, le=2)] = Field(
        default=0.03,
        description="a cap that rises or falls faster than this is not in contact [m/s]; half a cable's speed",
    )
    sensor_gap_s: Annotated[float, Field(strict=True, gt=0, le=10)] = Field(
        default=0.25,
        description="sensor lengths are interpolated over gaps up to this long [s]; beyond they are missing",
    )
    rod_length_tolerance: Annotated[float, Field(strict=True, gt=0, lt=0.5)] = Field(
        default=0.05,
        description="largest relative departure of the seen rod length from robot.toml; beyond: another robot",
    )


QUALITY = {
    0: "observed and used",
    1: "not observed: predicted by the smoother",
    2: "outlier: observed, contradicts the other frames, not used",
    3: "jump: used, and the track jumped between the frame before and this one",
}

SIGHT = {
    0: "seen in colour and depth",
    1: "seen in colour, no depth on it",
    2: "out of the picture",
    3: "hidden: nothing of its colour where it should be",
    4: "of its colour, but no sphere of its size",
    5: "no picture, or a blank one",
}

MODE = {
    1: "no cable sensor near the frame",
    2: "some caps not seen",
    4: "no cap seen",
    8: "lost: some cap less certain than 30 mm",
    16: "no picture",
}
"""Bits of `frames/mode`."""

RUN = GroupSpec(
    path="runs/{run}",
    description="one run: what the recording says about it",
    required=True,
    attributes=RECORDED_RUN.attributes,
)

GROUND = GroupSpec(
    path="runs/{run}/ground",
    description="ground plane in the frame of the recording, and what was done to it; of camera images, that frame is the "
                "ground as the camera sees it, and this the floor as the caps that touch it show it",
    required=True,
    attributes=(
        AttributeSpec(name="offset", type="float", unit="m",
                      description="the plane is normal . p = offset, p in the frame of the recording"),
        AttributeSpec(name="offset_sd", type="float", unit="m", description="standard deviation of the offset, from ten parts "
                      "of the run"),
        AttributeSpec(name="shift", type="float", unit="m",
                      description="what was added to z so that the ground lies at z = 0; equals -offset"),
        AttributeSpec(name="height_error", type="float", unit="m", required=False, description="error of heights that smoothing does not take "
                      "away: usual height of the third lowest cap, which carries a robot at rest"),
        AttributeSpec(name="tilt_known", type="bool",
                      description="true: the contacts spread widely enough to tell the slope"),
    ),
    datasets=(
        column("normal", "float64", ("xyz",), "1", "normal of the plane that was applied: the z axis of the recording",
          frame="recording"),
        column("slope", "float64", ("pair",), "1", "slope dz/dx and dz/dy of the contacts; reported, not applied",
          frame="recording", nan_means="the contacts do not spread widely enough to tell"),
        column("slope_sd", "float64", ("pair",), "1", "standard deviation of the slope", nan_means="as slope"),
    ),
)  # fmt: skip

FRAMES = GroupSpec(
    path="runs/{run}/frames",
    description="state at every kept frame; row k is kept frame k, as intervals and segments count them",
    required=True,
    attributes=(
        AttributeSpec(name="source_rigid", type="bool", description="true: the source had made the rods rigid already, so the rod "
                      "length adds no information and does not narrow the covariance"),
        AttributeSpec(name="roll_observable", type="bool", description="false: the roll of a rod about its own axis is not seen; q_WR "
                      "carries it by minimal rotation, w_WR holds none"),
    ),
    datasets=(
        column("t", "float64", ("frame",), "s", "time since the start of the run"),
        column("source_frame", "int64", ("frame",), "index", "row of the recording's caps, or of its camera, that this frame is"),
        column("p_WE", "float64", ("frame", "cap", "xyz"), "m", "end caps: smoothed, rods rigid, on the ground", frame="W"),
        column("cov_p_WE", "float64", ("frame", "cap", "xyz", "xyz2"), "m^2", "covariance of each end cap, that of "
          "the ground included; the caps of a rod are correlated along it, which is not stored", frame="W"),
        column("v_WE", "float64", ("frame", "cap", "xyz"), "m/s", "velocity of the end caps", frame="W"),
        column("sd_v_WE", "float64", ("frame", "cap", "xyz"), "m/s", "standard deviation of the velocity, per axis", frame="W"),
        column("p_WR", "float64", ("frame", "rod", "xyz"), "m", "middle between the caps of each rod", frame="W"),
        column("q_WR", "float64", ("frame", "rod", "quat"), "1", "orientation of each rod, xyzw; z towards the odd cap; "
          "roll is not observable and carried by minimal rotation", frame="W"),
        column("v_WR", "float64", ("frame", "rod", "xyz"), "m/s", "velocity of the middle of each rod", frame="W"),
        column("w_WR", "float64", ("frame", "rod", "xyz"), "rad/s", "angular velocity across each rod; its part along the "
          "rod is not observable and 0", frame="W"),
        column("quality", "uint8", ("frame", "cap"), "code", "what the observation was worth", codes=QUALITY),
        column("mode", "uint8", ("frame",), "1", "what the state had to do without; sum of "
          + ", ".join(f"{bit} {words}" for bit, words in MODE.items()), required=False),
        column("score", "float64", ("frame", "cap"), "1", "distance of the observation from what all other frames predict, "
          "in standard deviations, root mean square over axes", nan_means="not observed, or not used"),
        column("contact", "bool", ("frame", "cap"), "bool", "the cap touches the ground, as far as heights can tell"),
        column("contact_probability", "float64", ("frame", "cap"), "1", "probability that the cap is lower than the clearance and "
          "neither rises nor falls, from height, velocity and their standard deviations, height_error included"),
        column("length", "float64", ("frame", "cable"), "m", "distance between the centres of the two end caps of each cable; "
          "the controller of the 3-bar robot counts in this length"),
        column("length_sd", "float64", ("frame", "cable"), "m", "standard deviation of that distance"),
        column("sensor_length", "float64", ("frame", "sensor"), "m", "lengths that the cable sensors gave, interpolated to the "
          "frames (later by sensor_fit's delay, where there is one)", required=False, nan_means="no reading near enough"),
        column("sensor_cable", "int64", ("sensor",), "index", "cable that each sensor measures", required=False),
    ),
)  # fmt: skip

TRACKS = GroupSpec(
    path="runs/{run}/tracks",
    description="how the smoother fits each end cap",
    required=True,
    datasets=(
        column("noise_sd", "float64", ("cap", "xyz"), "m", "noise of the observations that was assumed", frame="W"),
        column("held", "bool", ("cap", "xyz"), "bool", "the source held this coordinate (ground constraint of a tracker): "
          "its noise is not known, the median of the run stands in"),
        column("observed", "float64", ("frame", "cap", "xyz"), "m", "camera images: caps as they were known at this frame "
          "from it and those before it alone, cables and rods included; quality says which were seen", frame="W",
          required=False),
        column("observed_sd", "float64", ("frame", "cap", "xyz"), "m", "standard deviation of observed, per axis",
          frame="W", required=False),
        column("speed_change", "float64", ("cap",), "m/s", "process noise: standard deviation of the change of velocity "
          "over 1 s, per axis, as used: twice the density of highest likelihood"),
        column("innovation_variance", "float64", ("cap",), "1", "mean squared innovation over its variance, at the highest "
          "likelihood (camera images: of frames/score); 1 where the assumed noise is right, below 1 where it is too large"),
        column("innovation_lag1", "float64", ("cap",), "1", "correlation of neighbouring innovations; 0 where they are white; camera images: "
          "of sightings/residual"),
        column("white", "bool", ("cap",), "bool", "that correlation lies within 2 standard deviations of 0"),
    ),
)  # fmt: skip

CAMERA = GroupSpec(
    path="runs/{run}/camera",
    description="the camera that saw the caps; only of camera images",
    attributes=(
        *(AttributeSpec(name=name, type="int", unit="px", description=f"{name} of the pictures")
          for name in ("width", "height")),
        *(AttributeSpec(name=name, type="float", unit="px", description="focal length" if name[0] == "f" else
                        "principal point, pixel centres at u + 0.5") for name in ("fx", "fy", "cx", "cy")),
        AttributeSpec(name="depth_scale", type="float", unit="m", description="metres a count of depth"),
        AttributeSpec(name="plane_share", type="float", required=False,
                      description="share of the pixels with depth that lie on the ground"),
        AttributeSpec(name="plane_noise", type="float", unit="m", required=False,
                      description="standard deviation of depth about the ground"),
        AttributeSpec(name="begun", type="int", unit="index", description="frame in which the caps were told apart"),
        AttributeSpec(name="searched", type="int", unit="count",
                      description="frames in which the caps had been lost and were found again"),
    ),
    datasets=(
        column("X_WC", "float64", ("mat4", "mat4"), "1", "pose of the camera, homogeneous, translation in metres; z from the "
          "ground, x along the picture and the origin under the camera by choice, unless the recording states a pose",
          frame="W"),
        column("shift_px", "float64", ("pair",), "px", "how far depth lies beside colour; corrected"),
        column("noise_scale", "float64", ("pair",), "1", "what the standard deviations of the sightings were multiplied by, "
          "across and along the line of sight, because the run shows it"),
    ),
)  # fmt: skip

SIGHTINGS = GroupSpec(
    path="runs/{run}/sightings",
    description="where each cap was seen, before any smoothing; row k is row k of frames; only of camera images",
    datasets=(
        column("p_WE", "float64", ("frame", "cap", "xyz"), "m", "centres of the caps", frame="W", nan_means="not seen"),
        column("cov_p_WE", "float64", ("frame", "cap", "xyz", "xyz2"), "m^2", "their covariance, before noise_scale",
          frame="W", nan_means="not seen"),
        column("visible", "float64", ("frame", "cap"), "1", "share of the cap's disc that is seen in its colour"),
        column("code", "uint8", ("frame", "cap"), "code", "how it was seen, or why not", codes=SIGHT),
        column("residual", "float64", ("frame", "cap", "xyz"), "1", "sighting minus smoothed cap over the sighting's own "
          "standard deviations, along its principal axes; errors that neighbouring frames share are in it", nan_means="not seen, or not used"),
    ),
)  # fmt: skip

SENSOR_FIT = GroupSpec(
    path="runs/{run}/sensor_fit",
    description="the cable sensors against the camera; only of camera images with sensors",
    attributes=(
        AttributeSpec(name="delay", type="float", unit="s", description="by which the lengths of the sensors come later than "
                      "those of the pictures: clock offset and lag together; 0 where it is not known"),
        AttributeSpec(name="delay_sd", type="float", unit="s", required=False, description="its standard deviation"),
        AttributeSpec(name="delay_known", type="bool", description="false: nothing moved enough to tell"),
    ),
    datasets=(
        column("bias", "float64", ("frame", "sensor"), "m", "what the sensor shows minus the length"),
        column("bias_sd", "float64", ("frame", "sensor"), "m", "its standard deviation"),
        column("noise_sd", "float64", ("sensor",), "m", "noise of one reading, as the run shows it",
          nan_means="it gave no reading"),
        column("dead", "bool", ("sensor",), "bool", "it contradicts everything else, or never speaks: not used"),
    ),
)  # fmt: skip

ESTIMATE = ArtifactSpec(
    kind="estimate",
    version=1,
    title="states per frame",
    filename="20-estimate.h5",
    executed="51-estimate.h5",
    level="iteration",
    groups=(
        RUN,
        GROUND,
        FRAMES,
        TRACKS,
        CAMERA,
        SIGHTINGS,
        SENSOR_FIT,
        COMMANDS,
        INTERVALS,
        SEGMENTS,
        policy_group("runs/{run}/policy"),
    ),
)
