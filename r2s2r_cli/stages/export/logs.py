"""A run of a recording as the trajectory CSV that `import` reads, or its targets as a policy file."""

from __future__ import annotations

import csv
import io

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.frames import in_order
from r2s2r_cli.stages.simulate.policies import run_policy

_STATED = {"frame_stated": "frame", "start_unix": "start_unix_s"}
_PID = {
    "pid_min_length": "min_length_m", "pid_range": "range_m", "pid_tolerance": "tolerance", "pid_p": "p", "pid_i": "i",
    "pid_d": "d", "motor_speed": "motor_speed", "winch_radius": "winch_radius_m",
}  # fmt: skip
"""Attribute of the run -> key of the sidecar."""
_NOT_STATED = "not stated"


def trajectory_files(data: ArtifactData, run: str, *, source: str) -> list[tuple[str, bytes]]:
    """`<run>.csv` and its sidecar `<run>.toml`: `import` gives the same run again. source: the artifact's file.

    Raises InputError where the run has no observed end caps on the time of its commands.
    """
    caps, commands = _need(data, run, "caps", source), _need(data, run, "commands", source)
    rows = np.arange(len(caps["t"]))
    if len(commands["t"]) != len(rows):  # rows whose stamps ran backwards have no place among the commands
        rows = np.flatnonzero(in_order(caps["t"], caps["drop_reason"]))
    t = caps["t"][rows]
    if not np.array_equal(t, commands["t"]):
        raise _cannot(run, "end caps and commands on one time axis", "two time axes", source)
    columns = [("t_s", t)]
    for i in range(caps["p_WE"].shape[1]):
        columns += [(f"cap{i}_{axis}_m", caps["p_WE"][rows, i, k]) for k, axis in enumerate("xyz")]
    for name in ("target", "control"):
        if name in commands:
            columns += [(f"{name}{i}", commands[name][:, i]) for i in range(commands[name].shape[1])]
    columns += _lengths(data, run, t, source)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name for name, _ in columns])
    writer.writerows([[repr(float(v)) for v in row] for row in zip(*(c for _, c in columns), strict=True)])
    return [(f"{run}.csv", text.getvalue().encode()), (f"{run}.toml", _sidecar(data.groups[f"runs/{run}"], caps))]


def _lengths(data: ArtifactData, run: str, t: np.ndarray, source: str) -> list[tuple[str, np.ndarray]]:
    """Columns of the sensor lengths, named by the cable that each sensor measures."""
    sensors = data.group(run, "sensors")
    if sensors is None or "length" not in sensors:
        return []
    if not np.array_equal(sensors["t"], t):
        raise _cannot(run, "sensor lengths on the time axis of the end caps", "another time axis", source)
    length = sensors["length"]
    cables = sensors["cable"] if "cable" in sensors else np.arange(length.shape[1])
    return [(f"length{cable}_m", length[:, i]) for i, cable in enumerate(cables)]


def policy_file(data: ArtifactData, run: str, *, source: str) -> tuple[str, bytes]:
    """`<run>.policy.toml`: the target intervals of a run as a policy. source: the artifact's file. Raises InputError
    where it has none, or one that no policy can have."""
    import tomlkit

    if not len(_need(data, run, "intervals", source)["target"]):
        raise _cannot(run, "one target interval at least", "none", source)
    policy = run_policy(data, run)
    document = tomlkit.document()
    document["schema_version"] = policy.schema_version
    document["robot"] = policy.robot
    document["name"] = policy.name
    document["description"] = policy.description
    document["repeat"] = policy.repeat
    steps = tomlkit.aot()
    for one in policy.steps:
        step = tomlkit.table()
        step["target"] = list(one.target)
        steps.append(step)
    document["steps"] = steps
    return f"{run}.policy.toml", tomlkit.dumps(document).encode()


def _sidecar(run: Group, caps: Group) -> bytes:
    import tomlkit

    document = tomlkit.document()
    for name in ("robot", "nature", "source"):
        if run.attributes[name] != _NOT_STATED:
            document[name] = str(run.attributes[name])
    if "noise_sd_stated" in caps.attributes:
        document["noise_sd_m"] = float(caps.attributes["noise_sd_stated"])
    for name, key in _STATED.items():
        if name in run.attributes:
            document[key] = run.attributes[name]
    pid = tomlkit.table()
    for name, key in _PID.items():
        if name in run.attributes:
            pid[key] = float(run.attributes[name])
    if pid:
        document["pid"] = pid
    return tomlkit.dumps(document).encode()


def _need(data: ArtifactData, run: str, stream: str, source: str) -> Group:
    group = data.group(run, stream)
    if group is None:
        raise _cannot(run, f"a group runs/{run}/{stream}", "none", source)
    return group


def _cannot(run: str, expected: str, received: str, source: str) -> InputError:
    return InputError(
        "this run cannot be exported in that form",
        where=f"{source}, run {run}",
        expected=expected,
        received=received,
        hint=f"r2s2r export {quoted(source)} --to csv",
    )
