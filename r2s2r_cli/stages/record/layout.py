"""The streams of a recorded run: what its journal will hold, with types from the schema of recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from r2s2r_cli.artifact import Scalar
from r2s2r_cli.devices.link import LinkFacts
from r2s2r_cli.stages.record.plan import RunPlan
from schemas.recording import RECORDING
from schemas.robot import Robot


@dataclass(frozen=True)
class StreamLayout:
    """Datasets of one group that grow together. fields: (name, dtype, shape). name: where a group has several."""

    path: str
    fields: tuple[tuple[str, str, tuple[int, ...]], ...]
    attributes: Mapping[str, Scalar] = field(default_factory=dict)
    name: str = ""

    @property
    def key(self) -> str:
        """What a row of it is sent to."""
        return f"{self.path}:{self.name}" if self.name else self.path


@dataclass(frozen=True)
class CameraFacts:
    """What is known of an open camera: intrinsics by the names of the schema's attributes, and metres a depth count."""

    intrinsics: Mapping[str, float]
    depth_scale: float


def place_of(link: LinkFacts) -> str:
    """Where the robot is, as its runs remember it. A rig in lock-step repeats itself exactly, on whatever free port: it
    has none, so that its recordings have the same hash again (the provenance has the port)."""
    return "lock-step" if link.lock_step else link.port


def run_layout(plan: RunPlan, robot: Robot, link: LinkFacts, camera: CameraFacts | None) -> tuple[StreamLayout, ...]:
    """The streams of one run. Rows go to `runs/<run>/<stream>`, those of the sensor table to `...sensors:table`."""
    run = plan.name
    motors, sensors = len(robot.actuated), len(robot.sensors)
    sizes: dict[str, tuple[int, ...]] = {"actuated": (motors,), "sensor": (sensors,), "xyz": (3,)}
    wanted: dict[str, tuple[str, ...]] = {
        "policy": ("target", "hold", "timeout"),
        "sensors": ("t", "t_board", "board", "capacitance", "length"),
        "commands": ("t", "target", "control", "done"),
        "motors": ("t", "position", "speed", "encoder", "voltage"),
        "imu": ("t", "board", "a_B", "w_WB"),
        "link": ("t", "received", "lost", "repeated", "corrupt", "late", "latency"),
        "intervals": ("first", "last", "t_first", "t_last", "target", "complete"),
        "segments": ("interval", "first", "last", "t_first", "t_last", "direction", "complete"),
    }
    words = f"{plan.policy.description}; as it is run, with the rest shape and all its repeats".lstrip("; ")
    attributes: dict[str, Mapping[str, Scalar]] = {
        "link": {"protocol": link.protocol, "port": place_of(link), "stops_by_itself": link.stops_by_itself},
        "policy": {"robot": robot.name, "description": words, "repeat": 1},
    }
    found = [
        StreamLayout(f"runs/{run}/{stream}", _fields(run, stream, names, sizes), attributes.get(stream, {}))
        for stream, names in wanted.items()
    ]
    table = _fields(run, "sensors", ("cable",), {})
    found.append(StreamLayout(f"runs/{run}/sensors", tuple((n, d, ()) for n, d, _ in table), name="table"))
    if camera is not None:
        pictures = ("t", "t_device", "color", "source_frame", "pair", "t_depth", "depth")
        facts: dict[str, Scalar] = {**camera.intrinsics, "depth_scale": camera.depth_scale}
        facts |= {name: int(facts[name]) for name in ("width", "height")}
        found.append(StreamLayout(f"runs/{run}/camera", _fields(run, "camera", pictures, sizes), facts))
    return tuple(found)


def _fields(
    run: str, stream: str, names: tuple[str, ...], sizes: Mapping[str, tuple[int, ...]]
) -> tuple[tuple[str, str, tuple[int, ...]], ...]:
    """Fields by name; the first axis of each dataset is the row."""
    spec = RECORDING.group(f"runs/{run}/{stream}")
    if spec is None:
        raise KeyError(stream)
    found = []
    for name in names:
        column = spec.dataset(name)
        if column is None:
            raise KeyError(f"{stream}/{name}")
        found.append((name, column.dtype, tuple(n for axis in column.dims[1:] for n in sizes[axis])))
    return tuple(found)
