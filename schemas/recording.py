"""The recording: raw runs, from the robot (`record`, `execute`) or from a foreign log (`import`)."""

from __future__ import annotations

from schemas.base import ArtifactSpec, AttributeSpec, GroupSpec, column
from schemas.policy import policy_group
from schemas.segments import INTERVALS, SEGMENTS

DROP_REASONS = {
    0: "kept",
    1: "duplicate: less than 20 ms after the last kept frame",
    2: "time runs backwards",
    3: "not observed: a coordinate or the stamp is not finite",
}


RUN = GroupSpec(
    path="runs/{run}",
    description="one execution of one policy",
    required=True,
    attributes=(
        AttributeSpec(name="origin", type="str", description="where the data came from",
                      choices=("robot", "rig", "trajectory_csv", "authors_folder", "tum_rgbd")),
        AttributeSpec(name="nature", type="str", description="what kind of truth this is",
                      choices=("measured", "simulated", "kinematic sample", "not stated")),
        AttributeSpec(name="source", type="str", description="in words: robot, date, gait, who published it"),
        AttributeSpec(name="robot", type="str", description="name of the robot description"),
        AttributeSpec(name="start_unix", type="float", unit="unix s", required=False,
                      description="wall clock of t = 0, where the source has it"),
        AttributeSpec(name="pid_min_length", type="float", unit="m", required=False,
                      description="controller: length at position 0"),
        AttributeSpec(name="pid_range", type="float", unit="m", required=False,
                      description="controller: length between position 0 and 1"),
        AttributeSpec(name="pid_tolerance", type="float", required=False,
                      description="controller: position error at which a cable is done"),
        AttributeSpec(name="pid_p", type="float", required=False, description="controller: proportional gain"),
        AttributeSpec(name="pid_i", type="float", required=False, description="controller: integral gain"),
        AttributeSpec(name="pid_d", type="float", required=False, description="controller: derivative gain"),
        AttributeSpec(name="frame_stated", type="str", required=False,
                      description="coordinate frame, in the words of the source"),
        AttributeSpec(name="motor_speed", type="float", required=False,
                      description="fraction of the no-load speed"),
        AttributeSpec(name="winch_radius", type="float", unit="m", required=False,
                      description="radius of the winches"),
        AttributeSpec(name="recovered", type="bool", required=False,
                      description="true: sealed by `r2s2r recover` after a crash"),
        AttributeSpec(name="clock", type="str", required=False, choices=("host", "board"),
                      description="what t counts: the host's clock; of a robot in lock-step, the board's"),
        AttributeSpec(name="repeat", type="int", required=False, description="which repeat of its policy this run is, from 1"),
        AttributeSpec(name="rest", type="float", unit="s", required=False,
                      description="time held in the rest shape (all cables long) before and after the policy"),
    ),
)  # fmt: skip

CAPS = GroupSpec(
    path="runs/{run}/caps",
    description="observed end caps, every row of the source, with what was dropped and why",
    datasets=(
        column("t", "float64", ("t_caps",), "s", "time of the frame since the start of the run"),
        column("p_WE", "float64", ("t_caps", "cap", "xyz"), "m", "centres of the end-cap spheres", frame="W",
          nan_means="not observed"),
        column("drop_reason", "uint8", ("t_caps",), "code", "why a frame is left out of everything later", codes=DROP_REASONS),
        column("source_row", "int64", ("t_caps",), "index", "line of the source file, 1-based, or number of its frame file"),
        column("noise_sd", "float64", ("cap", "xyz"), "m", "noise per axis, from residuals of 5-frame local lines",
          frame="W", required=False, nan_means="too few frames to tell"),
        column("rod_length", "float64", ("rod",), "m", "median distance of the caps of each rod", required=False),
        column("rod_length_sd", "float64", ("rod",), "m", "standard deviation of that distance", required=False),
    ),
    attributes=(
        AttributeSpec(name="ground_offset", type="float", unit="m", required=False,
                      description="cap radius minus mean height of the lowest cap: what to add to z"),
        AttributeSpec(name="stamp_jitter", type="float", unit="s", required=False,
                      description="standard deviation of the gaps between kept frames"),
        AttributeSpec(name="noise_sd_stated", type="float", unit="m", required=False,
                      description="noise per axis, as the source states it"),
    ),
)  # fmt: skip

COMMANDS = GroupSpec(
    path="runs/{run}/commands",
    description="what the controller asked for",
    datasets=(
        column("t", "float64", ("t_command",), "s", "time since the start of the run"),
        column("target", "float64", ("t_command", "actuated"), "1", "target position, 0 short .. 1 long",
          nan_means="no target at that time"),
        column("control", "float64", ("t_command", "actuated"), "1", "motor command over maximum, +1 reels in",
          required=False, nan_means="not logged"),
        column("done", "bool", ("t_command", "actuated"), "bool", "cable reached its target (latched)", required=False),
    ),
)  # fmt: skip

SENSORS = GroupSpec(
    path="runs/{run}/sensors",
    description="cable sensors",
    datasets=(
        column("t", "float64", ("t_sensor",), "s", "time since the start of the run"),
        column("capacitance", "float64", ("t_sensor", "sensor"), "F", "raw capacitance", required=False,
          nan_means="not received"),
        column("length", "float64", ("t_sensor", "sensor"), "m", "length as the source's own calibration gave it",
          required=False, nan_means="not received"),
        column("t_board", "float64", ("t_sensor",), "s", "clock of the board that sent the sample, of unknown origin",
          required=False, nan_means="the protocol has none"),
        column("board", "int64", ("t_sensor",), "index", "board that sent the sample, -1: all at once", required=False),
        column("cable", "int64", ("sensor",), "index", "cable that each sensor measures", required=False),
    ),
)  # fmt: skip

MOTORS = GroupSpec(
    path="runs/{run}/motors",
    description="motor states",
    datasets=(
        column("t", "float64", ("t_motor",), "s", "time since the start of the run"),
        column("position", "float64", ("t_motor", "actuated"), "1", "cable position as the controller saw it",
          required=False, nan_means="not received"),
        column("speed", "float64", ("t_motor", "actuated"), "1", "speed command as sent, over its maximum, +1 reels in",
          required=False, nan_means="not received"),
        column("encoder", "float64", ("t_motor", "actuated"), "count", "encoder counts", required=False,
          nan_means="not received"),
        column("encoder_length", "float64", ("t_motor", "actuated"), "m", "length from the encoder", required=False,
          nan_means="not received"),
        column("voltage", "float64", ("t_motor",), "V", "battery", required=False, nan_means="not received"),
    ),
)  # fmt: skip

IMU = GroupSpec(
    path="runs/{run}/imu",
    description="inertial measurement units, one a board",
    datasets=(
        column("t", "float64", ("t_imu",), "s", "time since the start of the run"),
        column("board", "uint8", ("t_imu",), "index", "board number"),
        column("a_B", "float64", ("t_imu", "xyz"), "m/s^2", "specific force", frame="board", nan_means="not received"),
        column("w_WB", "float64", ("t_imu", "xyz"), "rad/s", "angular velocity", frame="board", required=False,
          nan_means="not received"),
    ),
)  # fmt: skip

ROTATION_TOLERANCE = 1e-3
"""Most that R^T R may differ from the unit matrix in an entry: rotations come as text, some with three digits."""
CAMERA = GroupSpec(
    path="runs/{run}/camera",
    description="colour and depth frames as they came, never re-encoded",
    attributes=(
        AttributeSpec(name="width", type="int", unit="px", description="image width"),
        AttributeSpec(name="height", type="int", unit="px", description="image height"),
        AttributeSpec(name="fx", type="float", unit="px", required=False, description="focal length along u"),
        AttributeSpec(name="fy", type="float", unit="px", required=False, description="focal length along v"),
        AttributeSpec(name="cx", type="float", unit="px", required=False,
                      description="principal point, pixel centres at u + 0.5"),
        AttributeSpec(name="cy", type="float", unit="px", required=False,
                      description="principal point, pixel centres at v + 0.5"),
        AttributeSpec(name="depth_scale", type="float", unit="m", required=False, description="metres per depth count"),
    ),
    datasets=(
        column("t", "float64", ("t_color",), "s", "time of the colour frame", required=False),
        column("color", "blobs", ("t_color",), "byte", "encoded colour images (PNG or JPEG)", required=False),
        column("source_frame", "int64", ("t_color",), "index", "number of the colour frame in the source; a gap is a lost one",
          required=False),
        column("t_device", "float64", ("t_color",), "s", "clock of the camera, of unknown origin", required=False),
        column("t_depth", "float64", ("t_depth",), "s", "time of the depth frame", required=False),
        column("depth", "blobs", ("t_depth",), "byte", "encoded 16-bit depth images (PNG)", required=False),
        column("pair", "int64", ("t_color",), "index", "depth frame that belongs to each colour frame, -1 none",
          required=False),
        column("X_WC", "float64", ("mat4", "mat4"), "1", "pose of the camera, homogeneous, translation in metres",
          frame="W", required=False),
    ),
)  # fmt: skip

CAMERA_POSE = GroupSpec(
    path="runs/{run}/camera_pose",
    description="pose of a moving camera (TUM ground truth)",
    datasets=(
        column("t", "float64", ("t_pose",), "s", "time since the start of the run"),
        column("p_WC", "float64", ("t_pose", "xyz"), "m", "camera position", frame="W"),
        column("q_WC", "float64", ("t_pose", "quat"), "1", "camera orientation, xyzw", frame="W"),
    ),
)  # fmt: skip

LINK = GroupSpec(
    path="runs/{run}/link",
    description="health of the link to the robot, about once a second; counts since the run began",
    attributes=(
        AttributeSpec(name="protocol", type="str", description="how host and robot talk"),
        AttributeSpec(name="port", type="str", description="device or address"),
        AttributeSpec(name="stops_by_itself", type="bool",
                      description="true: the device stops its motors when the host falls silent"),
    ),
    datasets=(
        column("t", "float64", ("t_link",), "s", "time since the start of the run"),
        column("received", "int64", ("t_link",), "count", "samples received"),
        column("lost", "int64", ("t_link",), "count", "samples that never came, by their sequence numbers"),
        column("repeated", "int64", ("t_link",), "count", "samples that came twice"),
        column("corrupt", "int64", ("t_link",), "count", "lines that were thrown away: checksum, form or range"),
        column("late", "int64", ("t_link",), "count", "control ticks more than half a period late"),
        column("latency", "float64", ("t_link",), "s", "from a command to its answer, the last one",
          nan_means="the protocol cannot tell"),
    ),
)  # fmt: skip

MOCAP = GroupSpec(
    path="runs/{run}/mocap",
    description="motion capture of the end caps, where the source has it",
    datasets=(
        column("t", "float64", ("t_mocap",), "s", "time since the start of the run"),
        column("p_ME", "float64", ("t_mocap", "cap", "xyz"), "m", "end caps in the frame of the motion capture",
          frame="M", nan_means="not seen"),
    ),
)  # fmt: skip

RECORDING = ArtifactSpec(
    kind="recording",
    version=1,
    title="raw runs",
    filename="10-record.h5",
    executed="50-execute.h5",
    level="iteration",
    groups=(
        RUN, CAPS, COMMANDS, SENSORS, MOTORS, IMU, LINK, CAMERA, CAMERA_POSE, MOCAP, INTERVALS, SEGMENTS,
        policy_group("runs/{run}/policy"),
    ),
)  # fmt: skip
