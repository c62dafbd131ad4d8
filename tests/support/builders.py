"""Small artifacts of every kind, as values: a closed-form motion of the 3-bar robot."""

from __future__ import annotations

import struct
import tomllib
import zlib
from collections.abc import Callable
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Scalar, Value
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.header import InputRef, Provenance
from schemas.robot import Robot
from schemas.versions import STAGE_VERSIONS
from tests.support.identified import identification as identified
from tests.support.motion import Motion, motion

STARTED = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
_TARGETS = np.array([[1.0, 1, 1, 1, 1, 1], [0.1, 1, 1, 0.1, 1, 1]])


@cache
def robot() -> Robot:
    """The 3-bar robot of the paper, as `init` writes it."""
    return Robot.model_validate(tomllib.loads(robot_toml("threebar")))


def provenance(**changes: Any) -> Provenance:
    """A provenance that is the same on every machine and at every time."""
    values: dict[str, Any] = {
        "stage": "import", "stage_version": STAGE_VERSIONS.get(changes.get("stage", "import"), 1),
        "argv": ("r2s2r", "import", "walk.csv"),
        "settings": {"rod_length_tolerance": 0.05, "flags": {}}, "robot": {"name": "threebar"},
        "config_sha256": "0" * 64, "inputs": (InputRef(path="walk.csv", kind="file", sha256="1" * 64),),
        "versions": {"r2s2r": "0", "python": "3"}, "platform": "nowhere", "started": STARTED.isoformat(),
        "wall_s": 0.25,
    }  # fmt: skip
    return Provenance(**{**values, **changes})


def png(gray: int, size: int = 4) -> bytes:
    """A whole PNG file: `size` x `size` pixels of one 8-bit gray."""
    rows = b"".join(b"\0" + bytes([gray]) * size for _ in range(size))
    head = struct.pack(">IIBBBBB", size, size, 8, 0, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    body = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(body)


def recording(frames: int = 24, *, images: bool = True) -> ArtifactData:
    """A recording of one run `walk` with every stream that a recording can have."""
    m = motion(robot(), frames)
    walk: dict[str, Group] = {
        "": Group({}, {"origin": "robot", "nature": "kinematic sample", "source": "closed form, not a measurement",
                       "robot": "threebar", "start_unix": 1.7e9, "pid_min_length": 0.1, "pid_range": 0.1}),
        "caps": _caps(m),
        "commands": _commands(m.t),
        "sensors": _sensors(m),
        "motors": Group({"t": m.t, "position": np.repeat(_targets(m.t)[:, :1], 6, axis=1),
                         "speed": np.zeros((frames, 6)), "voltage": np.full(frames, 11.1)}),
        "imu": Group({"t": m.t, "board": np.zeros(frames, np.uint8), "a_B": np.tile([0.0, 0.0, 9.81], (frames, 1))}),
        "camera_pose": Group({"t": m.t, "p_WC": np.tile([0.0, 0.0, 1.5], (frames, 1)),
                              "q_WC": np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1))}),
        "mocap": Group({"t": m.t, "p_ME": m.p_WE.copy()}),
        **_spans(m.t), "policy": _policy(),
    }  # fmt: skip
    if images:
        walk["camera"] = _camera(m)
    return ArtifactData("recording", {_join("runs/walk", name): group for name, group in walk.items()})


def estimate(frames: int = 24) -> ArtifactData:
    """The exact states of the same motion, with made-up uncertainties."""
    m = motion(robot(), frames)
    caps, cables = 6, len(robot().cables)
    attributes: dict[str, Scalar] = {"origin": "robot", "nature": "kinematic sample", "source": "closed form",
                                     "robot": "threebar"}  # fmt: skip
    low = m.p_WE[..., 2] < 0.03
    states = {
        "t": m.t, "source_frame": np.arange(frames), "p_WE": m.p_WE, "v_WE": m.v_WE, "p_WR": m.p_WR, "q_WR": m.q_WR,
        "v_WR": m.v_WR, "w_WR": m.w_WR, "length": m.length, "contact": low,
        "cov_p_WE": np.tile(1e-6 * np.eye(3), (frames, caps, 1, 1)), "sd_v_WE": np.full((frames, caps, 3), 0.01),
        "quality": np.zeros((frames, caps), np.uint8), "score": np.full((frames, caps), 1.0),
        "contact_probability": np.where(low, 0.9, 0.0), "length_sd": np.full((frames, cables), 1e-3),
    }  # fmt: skip
    ground = Group(
        {"normal": np.array([0.0, 0.0, 1.0]), "slope": np.full(2, np.nan), "slope_sd": np.full(2, np.nan)},
        {"offset": 0.004, "offset_sd": 0.001, "shift": -0.004, "tilt_known": False},
    )
    tracks = Group(
        {
            "noise_sd": np.full((caps, 3), 0.002), "held": np.zeros((caps, 3), bool), "white": np.ones(caps, bool),
            "speed_change": np.full(caps, 0.1), "innovation_variance": np.ones(caps), "innovation_lag1": np.zeros(caps),
        }
    )  # fmt: skip
    walk = {"": Group({}, attributes), "ground": ground, "tracks": tracks, "commands": _commands(m.t),
            "frames": Group(states, {"source_rigid": True, "roll_observable": False}), **_spans(m.t),
            "policy": _policy()}  # fmt: skip
    return ArtifactData("estimate", {_join("runs/walk", name): group for name, group in walk.items()})


def simulation(frames: int = 24) -> ArtifactData:
    """The same motion as a simulated run."""
    m = motion(robot(), frames)
    states = {"t": m.t, "p_WR": m.p_WR, "q_WR": m.q_WR, "v_WR": m.v_WR, "w_WR": m.w_WR, "p_WE": m.p_WE,
              "length": m.length, "rest_length": m.length - 0.01, "tension": np.full(m.length.shape, 0.5),
              "contact": m.p_WE[..., 2] < 0.03}  # fmt: skip
    attributes: dict[str, Scalar] = {"policy": "walk", "robot": "threebar", "engine": "closed form 1", "step": 0.001,
                                     "control": "closed loop"}  # fmt: skip
    walk = {"": Group({}, attributes), "frames": Group(states), "commands": _commands(m.t), **_spans(m.t),
            "policy": _policy()}  # fmt: skip
    return ArtifactData("simulation", {_join("runs/walk", name): group for name, group in walk.items()})


def policy() -> ArtifactData:
    """Two policies."""
    return ArtifactData("policy", {"policies/walk": _policy(), "policies/rest": _policy(steps=1)})


def plan() -> ArtifactData:
    """Two gaits of one behaviour, one long policy of them, simulated: the same motion; two symmetries."""
    number = np.array([0.1, 0.05])
    table = dict.fromkeys(("nominal", "mean", "sd", "score", "turn", "turn_sd", "duration"), number)
    primitives = {
        **table, "name": np.array([b"forward-1", b"forward-2"]), "behaviour": np.array([b"forward", b"forward"]),
        "worked": np.array([1.0, 0.75]), "shift": np.outer(number, [0.1, 1.0]), "shift_sd": np.zeros((2, 2)),
        "element": np.array([0, 1]), "same_element": np.ones(2),
    }  # fmt: skip
    long = {
        "name": np.array([b"straight"]), "gaits": np.array([b"forward-1 forward-2"]), "shortcuts": np.array([1]),
        "saved": np.array([1]), "expected": np.array([[0.015, 0.15, 0.15]]), "mean": np.array([[0.01, 0.14, 0.1]]),
        "sd": np.full((1, 3), 0.01), "worked": np.ones(1), "duration": np.array([4.0]), "goal": np.full((1, 3), np.nan),
    }  # fmt: skip
    symmetry = {
        "caps": np.array([[0, 1, 2, 3, 4, 5], [2, 3, 4, 5, 0, 1]]), "turn": np.tile(np.eye(3), (2, 1, 1)),
        "cables": np.array([[0, 1, 2, 3, 4, 5, 6, 7, 8], [2, 0, 1, 5, 3, 4, 8, 6, 7]]), "misfit": np.zeros(2),
        "motors": np.array([[0, 1, 2, 3, 4, 5], [2, 0, 1, 5, 3, 4]]), "support": np.array([[0, 2, 5], [1, 2, 4]]),
    }  # fmt: skip
    facts: dict[str, Scalar] = {
        "robot": "threebar", "engine": "closed form 1", "numbers": "made up", "identified": False, "seed": 0,
        "step": 0.001, "depth": 3, "simulated": 10, "pruned": 0, "lost": 1, "found": 4,
    }  # fmt: skip
    runs = {path.replace("walk", "straight", 1): group for path, group in simulation().groups.items()}
    return ArtifactData("plan", {
        "plan": Group({}, facts), "symmetry": Group(symmetry), "primitives": Group(primitives), "long": Group(long),
        "reference": Group({"p": np.array(robot().rest_caps_m)}),
        **{f"policies/{name}": _policy() for name in ("forward-1", "forward-2", "straight")}, **runs,
    })  # fmt: skip


def calibration() -> ArtifactData:
    """Exact lines of two sensors from four points each, one dated history, two tendon curves, one weighed rod."""
    from tests.support.bench import bench_groups

    return ArtifactData("calibration", bench_groups())


def identification(frames: int = 24, *, repeating: bool = False) -> ArtifactData:
    """Four parameters, one of each sort of trust, learned from the same motion. repeating: with the part that later
    versions add; the golden file has none."""
    return identified(robot(), frames, repeating=repeating)


def floor() -> ArtifactData:
    """Four repeats of two phases in caps, two sensors, two gait steps."""
    away = np.array([[1.0, 2, 3, 2, 1, 2], [2, 1, 1, 2, 3, 2], [3, 3, 1, 1, 2, 2], [1, 1, 2, 2, 3, 3]]) * 1e-3
    caps = Group(
        {"run": np.array([b"1:walk-1", b"1:walk-2"] * 2), "interval": np.array([2, 2, 3, 3]),
         "phase": np.array([0, 0, 1, 1]), "deviation": np.sqrt(np.mean(away**2, axis=1)), "deviation_cap": away},
        {"floor": 0.003, "lower": 0.002, "upper": 0.005, "level": 0.95, "sensor": 0.001, "repeatability": 0.0028,
         "contrasts": 2, "basis": "repeats of a policy", "carry": "pose"},
    )  # fmt: skip
    lengths = Group(
        {"cable": np.array([0, 3]), "sd": np.array([0.002, np.nan]), "noise": np.array([0.0005, np.nan])},
        {"floor": 0.002, "basis": "repeats of a policy", "contrasts": 2},
    )
    numerics = Group(
        {"seed": np.array([0, 1]), "error": np.array([0.001, 0.002]), "way": np.array([0.03, 0.04])},
        {"floor": 0.0016, "median": 0.0015, "worst": 0.002, "moved": 0.035, "engine_step": 2.5e-4, "rig_step": 2.5e-4},
    )  # fmt: skip
    return ArtifactData("floor", {"caps": caps, "lengths": lengths, "numerics": numerics})


def comparison() -> ArtifactData:
    """One run of two intervals, two simulators: one is off by 1 mm along x, the other could not be simulated."""
    n, points, caps = 2, 3, 6
    p_WE = np.linspace(0.0, 0.1, n * points * caps * 3).reshape(n, points, caps, 3)
    nan = np.full((n, points, caps, 3), np.nan)
    both = np.stack([p_WE + np.array([1e-3, 0, 0]), nan])
    by_interval = np.array([[1e-3, 1e-3], [np.nan, np.nan]])
    whole = np.array([1e-3, np.nan])
    real = {"target": np.array([[0.0] * 6, [1.0] * 6]), "duration": np.array([1.0, 1.5]), "p_WE_start": p_WE[0, 0],
            "p_WE": p_WE, "com": p_WE.mean(axis=2)}  # fmt: skip
    simulated = {
        "compared": np.array([2, 0]), "trained_on": np.array([False, True]), "p_WE": both, "com": both.mean(axis=3),
        "duration": np.array([[1.1, 1.4], [np.nan, np.nan]]), "segment_end": by_interval, "gait": by_interval,
        "keyframe": by_interval, "com_end_error": whole, "heading_end_error": np.array([0.0, np.nan]),
        "path_error": whole, "cap_rmse": whole,
    }  # fmt: skip
    models = {"name": np.array([b"initial", b"iteration 1"]), "words": np.array([b"robot.toml", b"30-identify.h5"]),
              "srcc_com": np.full(2, np.nan), "srcc_turn": np.full(2, np.nan)}  # fmt: skip
    return ArtifactData("comparison", {
        "models": Group(models), "floor": Group(attributes={"com_end": 0.004}),
        "runs/walk": Group(attributes={"policy": "walk", "robot": "threebar"}), "runs/walk/real": Group(real),
        "runs/walk/simulated": Group(simulated),
    })  # fmt: skip


def diagnosis() -> ArtifactData:
    """An effect that wins over none and unknown; two fitted intervals, one of which stands out, and a judged one."""

    def words(*values: str) -> np.ndarray:
        return np.array([value.encode() for value in values])

    caps = np.array(robot().rest_caps_m)
    verdict = {
        "robot": "threebar", "verdict": "effect", "effects": "friction_field", "probability": 0.8,
        "set90": "friction_field cap_friction", "calibrated": "not calibrated", "floor": 0.006,
        "floor_from": "repeats of a policy", "chance": 3.5, "within_run": False,
    }  # fmt: skip
    names = ("friction_field", "cap_friction", "none", "unknown")
    ranking = {
        "name": words(*names), "elpd_gain": np.array([20.0, 8.0, 0.0, 2.0]),
        "probability": np.array([0.8, 0.1, 0.05, 0.05]),
        "rmse": np.array([0.007, 0.009, 0.012, np.nan]), "element": words("", "cap 2", "", ""),
        "channel": words("contact", "contact", "", ""),
    }  # fmt: skip
    sizes = {"name": words("cap_friction.factor.2"), "value": np.array([0.6]), "lower": np.array([0.5]),
             "upper": np.array([0.7]), "unit": words("1")}  # fmt: skip
    screening = {"name": words("friction_field", "motor_dead_zone"), "gain": np.array([18.0, np.nan]),
                 "absorbed": np.array([0.4, 0.0]), "seen": np.array([12.0, 0.0])}  # fmt: skip
    segments = {
        "run": words("walk", "walk"), "interval": np.array([1, 2]), "t": np.array([[0.0, 1.0], [1.0, 2.5]]),
        "refit": np.array([0.006, 0.02]), "effect": np.array([0.006, 0.008]), "misfit": np.array([1.0, 4.0]),
        "gap": np.array([False, True]), "xy": np.stack([caps[:, :2], caps[:, :2] + 0.1]),
        "error": np.stack([0 * caps, 0 * caps + 1e-2]),
    }  # fmt: skip
    judged = {"name": words("walk:3"), "nominal": np.array([0.03]), "refit": np.array([0.02]),
              "effect": np.array([0.008]), "ceiling": np.array([0.007])}  # fmt: skip
    drawn = {"p_WE": caps, "cable": np.array([cable.caps for cable in robot().cables]),
             "actuated": np.array([i in robot().actuated for i in range(len(robot().cables))])}  # fmt: skip
    place = {"x": np.array([0.0, 0.1]), "y": np.array([0.0, 0.1, 0.2]),
             "value": np.array([[0.0, 0.1], [0.2, 0.3], [np.nan, 0.1]]),
             "weight": np.array([[1.0, 1.0], [2.0, 3.0], [0.0, 1.0]])}  # fmt: skip
    return ArtifactData("diagnosis", {
        "verdict": Group(attributes=verdict), "ranking": Group(ranking), "sizes": Group(sizes),
        "screening": Group(screening), "segments": Group(segments), "judged": Group(judged), "robot": Group(drawn),
        "place": Group(place),
    })  # fmt: skip


BUILDERS: dict[str, Callable[[], ArtifactData]] = {
    "calibration": calibration, "recording": recording, "estimate": estimate, "identification": identification,
    "plan": plan, "policy": policy, "simulation": simulation, "comparison": comparison, "floor": floor,
    "diagnosis": diagnosis,
}  # fmt: skip
"""One builder a kind."""


def _join(root: str, name: str) -> str:
    return f"{root}/{name}" if name else root


def _targets(t: np.ndarray) -> np.ndarray:
    return _TARGETS[(np.arange(len(t)) >= len(t) // 2).astype(int)]


def _caps(m: Motion) -> Group:
    """The motion with one frame logged twice, 5 ms apart, as the authors' trackers do."""
    twice = len(m.t) // 3
    t = np.insert(m.t, twice + 1, m.t[twice] + 0.005)
    reason = np.zeros(len(t), np.uint8)
    reason[twice + 1] = 1
    datasets = {"t": t, "p_WE": np.insert(m.p_WE, twice + 1, m.p_WE[twice], axis=0), "drop_reason": reason,
                "source_row": np.arange(2, len(t) + 2), "noise_sd": np.full((6, 3), 0.002),
                "rod_length": m.rod_length, "rod_length_sd": np.zeros(3)}  # fmt: skip
    return Group(datasets, {"ground_offset": 0.004, "stamp_jitter": 0.0, "noise_sd_stated": 0.002})


def _commands(t: np.ndarray) -> Group:
    control = np.where(_targets(t) < 0.5, 1.0, 0.0)
    return Group({"t": t, "target": _targets(t), "control": control, "done": control == 0})


def _sensors(m: Motion) -> Group:
    length = m.length + 0.002 * np.sin(3 * m.t)[:, None]
    capacitance = 40e-12 + 2e-10 * length
    return Group({"t": m.t, "capacitance": capacitance, "length": length, "cable": np.arange(length.shape[1])})


def _camera(m: Motion) -> Group:
    frames = len(m.t) // 2
    pictures = [png(10 * (i % 20) + 5) for i in range(frames)]
    datasets: dict[str, Value] = {
        "t": m.t[:frames], "color": Blobs(pictures, frames), "source_frame": np.arange(frames),
        "t_depth": m.t[:frames] + 0.002, "depth": Blobs(pictures[::-1], frames), "pair": np.arange(frames),
        "X_WC": np.diag([1.0, -1.0, -1.0, 1.0]),
    }  # fmt: skip
    return Group(datasets, {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0,
                            "depth_scale": 0.001})  # fmt: skip


def _spans(t: np.ndarray) -> dict[str, Group]:
    half = len(t) // 2
    first, last = np.array([0, half]), np.array([half - 1, len(t) - 1])
    common = {"first": first, "last": last, "t_first": t[first], "t_last": t[last], "complete": np.array([True, False])}
    direction = np.where(_TARGETS < 0.5, 1, 0).astype(np.int32)
    return {
        "intervals": Group({**common, "target": _TARGETS.copy()}),
        "segments": Group({**common, "interval": np.array([1, 2]), "direction": direction}),
    }


def _policy(steps: int = 2) -> Group:
    return Group({"target": _TARGETS[:steps].copy(), "hold": np.zeros(steps), "timeout": np.full(steps, np.nan)},
                 {"robot": "threebar", "description": "rest, then a step", "repeat": 1})  # fmt: skip
