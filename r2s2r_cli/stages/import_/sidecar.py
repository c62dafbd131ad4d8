"""The TOML sidecar beside a log: read, checked, and compared with the project's robot."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from r2s2r_cli.artifact import Scalar
from r2s2r_cli.errors import InputError, quoted
from r2s2r_cli.stages.import_.files import MAX_TEXT_BYTES, clipped, decode, did_you_mean, read_source, shown
from schemas.robot import Robot
from schemas.sidecar import MINIMAL_SIDECAR, Sidecar, SidecarPid

NOT_STATED = "not stated"
"""Nature of a run whose sidecar does not say it."""
UNIT_MARGIN = 10**0.5
"""A wrong unit is off by 10 at least: lengths may leave the robot's limits by this factor, no further."""


def sidecar_path(source: Path) -> Path:
    """Where the sidecar lies: `crawl.csv` -> `crawl.toml`, folder `run1/` -> `run1.toml` beside it."""
    absolute = Path(source.absolute())
    name = absolute.stem if absolute.is_file() else absolute.name
    return source.parent / f"{name}.toml" if source.name else absolute.parent / f"{name}.toml"


def read_sidecar(source: Path) -> Sidecar:
    """The sidecar of a source. Raises InputError where it is missing (showing a minimal one) or wrong."""
    path = sidecar_path(source)
    if not path.is_symlink() and not path.exists():
        keys = MINIMAL_SIDECAR.strip().replace("\n", "\\n").replace("'", "")
        raise InputError(
            "the log has no sidecar, so robot and source are unknown",
            where=str(path),
            expected=f"a TOML file:\n{MINIMAL_SIDECAR}".rstrip(),
            hint=f"printf '{keys}\\n' > {quoted(path)}   # then put the true values in",
        )
    return parse_sidecar(read_source(path, "the sidecar", limit=MAX_TEXT_BYTES), str(path))


def parse_sidecar(data: bytes, where: str) -> Sidecar:
    """A sidecar from its bytes. Raises InputError with the line of a syntax error or the key of a wrong value."""
    text = decode(data, "the sidecar", where)
    try:
        tree = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        reason = "tables nested too deep" if isinstance(error, RecursionError) else str(error)
        at = re.search(r" \(at line (\d+), column (\d+)\)", reason)
        raise InputError(
            "the sidecar is not TOML",
            where=f"{where}:{at[1]}:{at[2]}" if at else where,
            expected="key = value lines and [pid]",
            received=clipped(reason.replace(at[0], "") if at else reason),
            hint=f"cat -n {quoted(where)}",
        ) from error
    try:
        return Sidecar.model_validate(tree, strict=True)
    except ValidationError as error:
        raise _invalid(error, where) from error
    except RecursionError as error:
        raise InputError("the sidecar nests too deep", where=where, hint=f"cat -n {quoted(where)}") from error


def check_sidecar(sidecar: Sidecar, robot: Robot, where: str, known: Iterable[str] = ()) -> None:
    """Refuse the log of another robot than the project's, and a controller in another unit than metres.

    known: names of the robots that `init` knows. Raises InputError.
    """
    if sidecar.robot != robot.name:
        others = sorted(set(known) - {robot.name})
        script = f"'s/^ *robot *=.*/robot = \"{robot.name}\"/'"
        here = f"sed -i.bak {script} {quoted(sidecar_path(Path(where)))}   # if it is this project's robot"
        if sidecar.robot in others:
            hint = f"r2s2r init other --robot {quoted(sidecar.robot)}   # and import it into that project"
        else:
            hint = here + (f"; r2s2r init also knows {', '.join(others)}" if others else "")
        raise InputError(
            "the log is of another robot than this project",
            where=where,
            expected=f"robot {shown(robot.name)} (robot.toml)",
            received=f"robot {shown(sidecar.robot)} (sidecar)",
            hint=hint,
        )
    _check_controller(sidecar, robot, where)


def _check_controller(sidecar: Sidecar, robot: Robot, where: str) -> None:
    """Refuse lengths of the controller that cables of this robot are far from: another unit."""
    low, high = sidecar.pid.min_length_m, sidecar.pid.range_m
    most = robot.limits.cable_length_max_m * UNIT_MARGIN
    least = robot.limits.cable_length_min_m / UNIT_MARGIN
    span = robot.limits.cable_length_max_m - robot.limits.cable_length_min_m
    wrong = [
        f"pid.{key} = {value:g}"
        for key, value, bad in (
            ("min_length_m", low, low is not None and not least <= low <= most),
            ("range_m", high, high is not None and not 0 < high <= span * UNIT_MARGIN),
        )
        if bad
    ]
    if wrong:
        raise InputError(
            "the controller in the sidecar asks for lengths that cables of this robot cannot have",
            where=f"{sidecar_path(Path(where))}, {wrong[0].partition(' ')[0]}",
            expected=f"metres: cables of {robot.name} are {robot.limits.cable_length_min_m:g} to "
            f"{robot.limits.cable_length_max_m:g} m long",
            received=", ".join(wrong),
            hint="give both in metres: 95 mm is 0.095",
        )


def run_attributes(sidecar: Sidecar, robot: Robot, origin: str) -> dict[str, Scalar]:
    """Attributes of the group `runs/<run>` that the sidecar gives."""
    attributes: dict[str, Scalar] = {
        "origin": origin,
        "nature": sidecar.nature or NOT_STATED,
        "source": sidecar.source,
        "robot": robot.name,
    }
    if sidecar.frame:
        attributes["frame_stated"] = sidecar.frame
    if sidecar.start_unix_s is not None:
        attributes["start_unix"] = sidecar.start_unix_s
    return attributes | pid_attributes(sidecar.pid)


def pid_attributes(pid: SidecarPid) -> dict[str, Scalar]:
    """Attributes of the controller and the motors that are known."""
    values = {
        "pid_min_length": pid.min_length_m,
        "pid_range": pid.range_m,
        "pid_tolerance": pid.tolerance,
        "pid_p": pid.p,
        "pid_i": pid.i,
        "pid_d": pid.d,
        "motor_speed": pid.motor_speed,
        "winch_radius": pid.winch_radius_m,
    }
    return {name: value for name, value in values.items() if value is not None}


def _invalid(error: ValidationError, where: str) -> InputError:
    errors = error.errors(include_url=False)
    unknown = [entry for entry in errors if entry["type"] == "extra_forbidden"]
    # A misspelt key is reported twice, as missing and as unknown; the second says how it is spelt.
    first = next((e for e in unknown if did_you_mean(str(e["loc"][-1]), _known_keys(e["loc"][:-1]))), errors[0])
    place = first["loc"]
    key = ".".join(shown(str(part)).strip("'\"") for part in place)
    if first["type"] == "extra_forbidden":
        known = _known_keys(place[:-1])
        return InputError(
            f"the sidecar has the unknown key {key}{did_you_mean(str(place[-1]), known)}",
            where=where,
            expected=", ".join(known),
            received=key,
            hint=f"grep -n {quoted(str(place[-1])[:60])} {quoted(where)}",
        )
    if first["type"] == "missing":
        return InputError(
            f"the sidecar does not give {key}",
            where=where,
            expected=f"at least:\n{MINIMAL_SIDECAR}".rstrip(),
            hint=f"add it: {key} = ...",
        )
    return InputError(
        f"the sidecar's {key} is wrong",
        where=where,
        expected="a table" if first["type"] == "model_type" else _in_words(first["msg"]),
        received=shown(first["input"]),
        hint=f"grep -n {quoted(str(place[-1])[:60] if place else '=')} {quoted(where)}",
    )


def _in_words(message: str) -> str:
    """What pydantic says of a value, without its own first words."""
    return message.removeprefix("Input should be ").removeprefix("Value error, ")


def _known_keys(parents: tuple[Any, ...]) -> list[str]:
    model = SidecarPid if parents == ("pid",) else Sidecar
    return list(model.model_fields)
