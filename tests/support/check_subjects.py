"""Sound subjects for the checks: every stream and dataset is there, and nothing is wrong with any of it."""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group
from r2s2r_cli.checks.subjects import Content, InputState, Journals, Links, Policy, Reading, Run
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.header import Header, InputRef, Provenance
from schemas.robot import Robot
from tests.support import builders
from tests.support.identified import identification as identified

FRAMES, SAMPLES = 6, 25
PNG = b"\x89PNG\r\n\x1a\n" + b"image"
SHA = "a" * 64


@functools.cache
def robot() -> Robot:
    """The 3-bar robot, its sensors calibrated."""
    values = tomllib.loads(robot_toml("threebar"))
    for sensor in values["sensors"]:
        sensor |= {"slope_f_per_m": 3e-11, "offset_f": 1.2e-11}
    return Robot.model_validate(values)


def caps() -> np.ndarray:
    """The rest pose, crawling along x by 1 mm a frame [m], (frame, cap, 3)."""
    p = np.repeat(np.array(robot().rest_caps_m)[None], FRAMES, axis=0)
    p[..., 0] += 1e-3 * np.arange(FRAMES)[:, None]
    return p


def stamps() -> np.ndarray:
    """0.1 s apart."""
    return 0.1 * np.arange(FRAMES)


def spans() -> dict[str, Group]:
    """Two target intervals of three frames, each one segment."""
    t = stamps()
    first, last = np.array([0, 3]), np.array([2, 5])
    base = {"first": first, "last": last, "t_first": t[first], "t_last": t[last], "complete": np.array([True, True])}
    target = np.array([[0.0] * 6, [1.0] * 6])
    return {
        "intervals": Group({**base, "target": target}),
        "segments": Group(
            {**base, "interval": np.array([1, 2]), "direction": np.array([[1] * 6, [-1] * 6], dtype=np.int32)}
        ),
        "commands": Group(
            {"t": t, "target": np.repeat(target, 3, axis=0), "control": np.repeat([[1.0] * 6, [-1.0] * 6], 3, axis=0)}
        ),
        "policy": policy_group(),
    }


def policy_group() -> Group:
    """Two steps: all short, all long."""
    return Group(
        {"target": np.array([[0.0] * 6, [1.0] * 6]), "hold": np.zeros(2), "timeout": np.array([np.nan, 5.0])},
        {"robot": "threebar", "repeat": 1},
    )


def recording() -> Run:
    """A run with every stream. One frame more than FRAMES was dropped, at the end."""
    p = caps()
    t = np.append(stamps(), stamps()[-1] + 0.01)
    samples = np.linspace(0.0, 1.0, SAMPLES)
    lengths = 0.15 + 0.01 * samples[:, None] * np.ones(9)
    streams = {
        "": Group({}, {"robot": "threebar", "origin": "robot", "nature": "measured", "source": "made for a test"}),
        "caps": Group(
            {
                "t": t, "p_WE": np.concatenate([p, p[-1:]]),
                "drop_reason": np.array([0] * FRAMES + [1], dtype=np.uint8),
                "source_row": np.arange(2, FRAMES + 3), "noise_sd": np.full((6, 3), 1e-3),
                "rod_length": np.full(3, 0.325), "rod_length_sd": np.full(3, 1e-3),
            },
            {"ground_offset": 0.0, "stamp_jitter": 0.0},
        ),
        "sensors": Group(
            {"t": samples, "capacitance": 1.2e-11 + 3e-11 * lengths, "length": lengths, "cable": np.arange(9),
             "board": np.full(SAMPLES, -1)}
        ),
        "motors": Group(
            {
                "t": samples, "position": np.full((SAMPLES, 6), 0.5), "speed": np.full((SAMPLES, 6), -1.0),
                "encoder": np.zeros((SAMPLES, 6)), "encoder_length": np.full((SAMPLES, 6), 0.15),
                "voltage": np.full(SAMPLES, 7.4),
            }
        ),
        "imu": Group(
            {
                "t": samples, "board": (np.arange(SAMPLES) % 2).astype(np.uint8),
                "a_B": np.tile([0.0, 0.0, 9.81], (SAMPLES, 1)), "w_WB": np.zeros((SAMPLES, 3)),
            }
        ),
        "camera": camera(),
        "camera_pose": Group(
            {"t": samples, "p_WC": np.zeros((SAMPLES, 3)), "q_WC": np.tile([0, 0, 0, 1.0], (SAMPLES, 1))}
        ),
        "mocap": Group({"t": stamps(), "p_ME": p}),
        **spans(),
    }  # fmt: skip
    return Run("recording", "a", streams, robot())


def camera() -> Group:
    """Three colour and two depth frames; the last colour frame has no depth."""
    return Group(
        {
            "t": np.array([0.0, 0.1, 0.2]), "t_depth": np.array([0.01, 0.11]), "pair": np.array([0, 1, -1]),
            "color": Blobs([PNG] * 3, 3), "depth": Blobs([PNG] * 2, 2), "source_frame": np.arange(3), "X_WC": np.eye(4),
        },
        {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0, "depth_scale": 0.001},
    )  # fmt: skip


def rods() -> dict[str, np.ndarray]:
    """Poses and caps of a robot that crawls along x at 10 mm/s."""
    p = caps()
    bar = p[:, 1::2] - p[:, 0::2]
    z = bar / np.linalg.norm(bar, axis=-1, keepdims=True)
    # Half-way rotation from world z to the rod: (z_W x z_R, 1 + z_W . z_R), normalised.
    q = np.stack([-z[..., 1], z[..., 0], np.zeros_like(z[..., 0]), 1 + z[..., 2]], axis=-1)
    crawl = np.array([0.01, 0.0, 0.0])
    cables = robot().cables
    length = np.stack([np.linalg.norm(p[:, c.caps[1]] - p[:, c.caps[0]], axis=-1) for c in cables], axis=-1)
    lowest = p[..., 2] < 0.03
    return {
        "t": stamps(), "p_WE": p, "p_WR": (p[:, 1::2] + p[:, 0::2]) / 2, "length": length, "contact": lowest,
        "q_WR": q / np.linalg.norm(q, axis=-1, keepdims=True), "v_WR": np.tile(crawl, (FRAMES, 3, 1)),
        "w_WR": np.zeros((FRAMES, 3, 3)),
    }  # fmt: skip


def estimate() -> Run:
    """A run of an estimate with every dataset."""
    frames = {
        **rods(),
        "source_frame": np.arange(FRAMES), "cov_p_WE": np.tile(1e-6 * np.eye(3), (FRAMES, 6, 1, 1)),
        "v_WE": np.tile([0.01, 0.0, 0.0], (FRAMES, 6, 1)), "sd_v_WE": np.full((FRAMES, 6, 3), 0.01),
        "quality": np.zeros((FRAMES, 6), dtype=np.uint8), "score": np.ones((FRAMES, 6)),
        "contact_probability": np.full((FRAMES, 6), 0.5), "length_sd": np.full((FRAMES, 9), 1e-3),
        "sensor_length": np.full((FRAMES, 9), 0.15), "sensor_cable": np.arange(9),
    }  # fmt: skip
    tracks = {
        "noise_sd": np.full((6, 3), 1e-3), "held": np.zeros((6, 3), dtype=bool), "speed_change": np.full(6, 0.1),
        "innovation_variance": np.ones(6), "innovation_lag1": np.zeros(6), "white": np.ones(6, dtype=bool),
    }  # fmt: skip
    ground = Group(
        {"normal": np.array([0.0, 0.0, 1.0]), "slope": np.zeros(2), "slope_sd": np.full(2, 0.1)},
        {"offset": 0.0, "offset_sd": 1e-3, "shift": 0.0, "tilt_known": False},
    )
    streams = {
        "": Group({}, {"robot": "threebar", "origin": "robot", "nature": "measured", "source": "made for a test"}),
        "ground": ground,
        "frames": Group(frames, {"source_rigid": False, "roll_observable": False}),
        "tracks": Group(tracks),
        **spans(),
    }
    return Run("estimate", "a", streams, robot())


def simulation() -> Run:
    """A simulated run with every dataset."""
    frames = {**rods(), "rest_length": np.full((FRAMES, 9), 0.1), "tension": np.zeros((FRAMES, 9))}
    own = {"policy": "a", "robot": "threebar", "engine": "none", "step": 1e-3, "control": "closed loop"}
    return Run("simulation", "a", {"": Group({}, own), "frames": Group(frames), **spans()}, robot())


def calibration() -> Content:
    """Two sets of lines, of which one is used, two curves, three rods, a history of three days."""
    two = np.zeros((2, 9))
    sensor_rows = {
        name: two + value
        for name, value in (
            ("slope", 3e-11), ("slope_se", 1e-13), ("offset", 1.2e-11), ("rms", 1.5e-3), ("worst", 3e-3),
            ("loo_rms", 2e-3), ("quadratic_rms", 1e-3),
        )
    }  # fmt: skip
    groups = {
        "points": Group(
            {
                "set": np.array([0, 1]), "sensor": np.array([0, 8]), "length": np.full(2, 0.1),
                "capacitance": np.full(2, 1.5e-11), "residual": np.zeros(2), "loo_residual": np.zeros(2),
                "source_row": np.array([2, 3]),
            }
        ),
        "lines": Group(
            {
                **sensor_rows, "name": np.array([b"old", b"new"]), "rms_set": np.full(2, 1.5e-3),
                "count": np.full((2, 9), 5), "state": np.zeros((2, 9), dtype=np.uint8),
            },
            {"used": "new"},
        ),
        "history": Group(
            {
                "file": np.array([b"f"] * 3), "commit": np.array([b"c"] * 3), "time": np.arange(3.0),
                "slope": np.full((3, 9), 3e-11), "offset": np.full((3, 9), 1.2e-11),
                "state": np.zeros((3, 9), dtype=np.uint8), "range": np.tile([0.1, 0.2], (9, 1)),
                "median_change": np.full(9, 1e-3), "p90_change": np.full(9, 2e-3), "median_rate": np.full(9, 1e-8),
            },
            {"range_from": "points", "swap_threshold": 0.05},
        ),
        "drift": Group(
            {
                "sensor": np.array([0]), "before": np.array([0]), "after": np.array([2]), "elapsed": np.array([2.0]),
                "change": np.array([1e-3]), "change_max": np.array([2e-3]), "state": np.zeros(1, dtype=np.uint8),
            }
        ),
        "tendon_points": Group(
            {"curve": np.array([0, 1]), "displacement": np.array([0.01, 0.02]), "force": np.array([1.0, 2.0])}
        ),
        "tendons": Group(
            {
                "name": np.array([b"t1", b"t2"]), "k1": np.full(2, 100.0), "k2": np.zeros(2), "k3": np.zeros(2),
                "rms": np.full(2, 0.1), "x_max": np.full(2, 0.1), "stiffness_min": np.full(2, 90.0),
                "monotone": np.ones(2, dtype=bool), "x": np.array([0.0, 0.1]), "mean": np.array([0.0, 10.0]),
                "sd": np.array([0.0, 1.0]),
            },
            {"k1_mean": 100.0, "k2_mean": 0.0, "k3_mean": 0.0, "x_common": 0.1, "monotone": True},
        ),
        "mass_parts": Group(
            {
                "rod": np.array([0]), "name": np.array([b"cap"]), "shape": np.array([b"sphere"]),
                "mass": np.array([0.01]), "offset": np.array([0.1]), "radius": np.array([0.0175]),
                "length": np.zeros(1), "inner_radius": np.zeros(1),
            }
        ),
        "masses": Group(
            {
                "rod": np.arange(3), "mass": np.full(3, 0.13), "com": np.zeros(3), "inertia_axial": np.full(3, 1e-5),
                "inertia_transverse": np.full(3, 2e-3),
            }
        ),
    }  # fmt: skip
    return Content(ArtifactData("calibration", groups))


def identification() -> Content:
    """Four parameters, one of each sort of trust."""
    return Content(identified(robot()))


def plan() -> Content:
    """Two gaits of one behaviour, one long policy of them."""
    return Content(builders.plan())


def content() -> Content:
    """A whole recording of one run."""
    run = recording()
    return Content(ArtifactData("recording", {run.at(stream): group for stream, group in run.streams.items()}))


def policy(**changes: Any) -> Policy:
    """Two steps, as a hand-written file."""
    group = policy_group()
    base = Policy("", "threebar", group["target"], group["hold"], group["timeout"], 1, robot())
    return dataclasses.replace(base, **changes)


def header(**changes: Any) -> Header:
    """The head of a recording, made by stage import from a file and an artifact."""
    ref = InputRef(path="crawl.csv", kind="file", sha256=SHA)
    made = Provenance(
        stage="import", stage_version=1, argv=("r2s2r",), settings={}, config_sha256=SHA, inputs=(ref,), versions={},
        platform="any", started="2026-01-01T00:00:00Z", wall_s=0.0,
    )  # fmt: skip
    base = Header(
        kind="recording", schema_version=1, title="raw runs", created_by="r2s2r", content_sha256=SHA, seal_sha256=SHA,
        body_sha256=SHA, body_offset=4096, body_bytes=1, datasets={}, provenance=made,
    )  # fmt: skip
    return base.model_copy(update=changes)


def links(**changes: Any) -> Links:
    """A recording in its place, of the project's robot, its source unchanged and its input artifact too."""
    head = header()
    body = head.model_dump(mode="json") | {
        f"provenance/{k}": v for k, v in head.provenance.model_dump(mode="json").items()
    }
    artifact = InputRef(path="iterations/001/10-record.h5", kind="recording", schema_version=1, sha256=SHA)
    base = Links(
        header=head, body=body, inputs=(InputState(head.provenance.inputs[0], SHA), InputState(artifact, SHA)),
        robots={"runs/a": "threebar"}, project_robot="threebar", stage_versions={"import": 1}, filename="10-record.h5",
    )  # fmt: skip
    return dataclasses.replace(base, **changes)


def edited(run: Run, path: str, value: Any) -> Run:
    """The run with another value of `stream/dataset`, or of `stream@attribute`; a function gets a copy to change."""
    stream, _, name = path.partition("@" if "@" in path else "/")
    group = run.streams[stream]
    streams = dict(run.streams)
    if "@" in path:
        streams[stream] = Group(group.datasets, {**group.attributes, name: value})
    else:
        streams[stream] = Group({**group.datasets, name: _new(group.datasets[name], value)}, group.attributes)
    return dataclasses.replace(run, streams=streams)


def edited_content(base: Content, path: str, value: Any) -> Content:
    """The same for whole artifacts: `group/dataset` or `group@attribute`."""
    parent, _, name = path.rpartition("@" if "@" in path else "/")
    groups: dict[str, Group] = dict(base.data.groups)
    group = groups[parent]
    if "@" in path:
        groups[parent] = Group(group.datasets, {**group.attributes, name: value})
    else:
        groups[parent] = Group({**group.datasets, name: _new(group.datasets[name], value)}, group.attributes)
    return Content(ArtifactData(base.kind, groups), base.layout)


def _new(old: Any, value: Any) -> Any:
    if not callable(value):
        return value
    copy = np.array(old)
    value(copy)
    return copy


def put(place: Any, number: Any) -> Callable[[np.ndarray], None]:
    """An edit that writes `number` at `place` of an array."""

    def edit(array: np.ndarray) -> None:
        array[place] = number

    return edit


SOUND: Mapping[str, Callable[[], object]] = {
    "reading": Reading, "links": links, "journals": lambda: Journals(()), "recording": recording, "estimate": estimate,
    "simulation": simulation, "calibration": calibration,
    "identification": identification, "plan": plan, "content": content, "policy": policy, "robot": robot,
}  # fmt: skip
"""One sound subject of every sort."""
