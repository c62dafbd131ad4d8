"""The TOML sidecar beside a log: read, checked, and compared with the project's robot."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from r2s2r_cli.artifact import Scalar
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_.files import MAX_TEXT_BYTES, clipped, decode, did_you_mean, quoted, read_source, shown
from schemas.robot import Robot
from schemas.sidecar import MINIMAL_SIDECAR, Sidecar, SidecarPid

NOT_STATED = "not stated"
"""Nature of a run whose sidecar does not say it."""


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


def check_robot_name(sidecar: Sidecar, robot: Robot, where: str) -> None:
    """Refuse the log of another robot than the project's."""
    if sidecar.robot != robot.name:
        raise InputError(
            "the log is of another robot than this project",
            where=where,
            expected=f"robot {shown(robot.name)} (robot.toml)",
            received=f"robot {shown(sidecar.robot)} (sidecar)",
            hint=f"import it into a project of its robot: r2s2r init other --robot {quoted(sidecar.robot)}",
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
        expected="a table" if first["type"] == "model_type" else first["msg"].removeprefix("Input should be "),
        received=shown(first["input"]),
        hint=f"grep -n {quoted(str(place[-1])[:60] if place else '=')} {quoted(where)}",
    )


def _known_keys(parents: tuple[Any, ...]) -> list[str]:
    model = SidecarPid if parents == ("pid",) else Sidecar
    return list(model.model_fields)
