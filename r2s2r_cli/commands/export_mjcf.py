"""`r2s2r export --to mjcf`: a robot description, with any of its numbers overridden, as a MuJoCo model."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.nearest import nearest, nearest_choice
from r2s2r_cli.options import parse_override
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.toml import check_model, read_toml
from r2s2r_cli.store.toml_hints import in_override, last_name, override, shown
from schemas.robot import Robot

if TYPE_CHECKING:
    from r2s2r_cli.rig.model import Options

OPTIONS = "options"
"""First part of the keys that are no keys of robot.toml: the world and the solver."""


def mjcf_file(path: Path, items: list[str]) -> tuple[str, bytes]:
    """Name and content of the model of the robot at `path`, a robot.toml or a project.

    items: `key=value`, keys of robot.toml or `options.NAME`. Raises InputError, UsageError.
    """
    from r2s2r_cli.rig.model import mjcf

    values, options = read_toml(_robot_path(path)), {}
    robot = check_model(values, Robot, str(path))
    for item in items:
        key, value = _parse(item)
        if key.partition(".")[0] == OPTIONS:
            options[key] = value
        else:
            _set(values, key, value)
    if items:
        try:
            file = str(_robot_path(path))
            mend = in_override(dict(map(_parse, items)), Robot, lambda loc: shown(file, last_name(loc)))
            robot = check_model(values, Robot, "--set", mend)
        except InputError as error:
            raise UsageError(error.what, where=error.where, expected=error.expected, received=error.received,
                             hint=error.hint) from error  # fmt: skip
    name = re.sub(r"[^\w.-]+", "_", robot.name).strip(".") or "robot"
    return f"{name}.xml", mjcf(robot, _options(options)).encode()


def _robot_path(path: Path) -> Path:
    if path.is_dir():
        return Project.find(path).robot_path
    if path.suffix == ".h5":
        raise InputError("an artifact holds no robot description", where=str(path), received="an artifact",
                         expected="a robot.toml or a project", hint="r2s2r export robot.toml --to mjcf")  # fmt: skip
    return path


def _parse(item: str) -> tuple[str, Any]:
    return parse_override(item, hint=lambda key: "--set contact.friction=0.5")


def _set(robot: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, list items by their numbers. Raises UsageError for a place that the robot does not have."""
    values: Any = robot
    parts = key.split(".")
    for i, part in enumerate(parts):
        here = values
        if isinstance(here, list):
            if not part.isdecimal() or int(part) >= len(here):
                raise _no_such(robot, key, value, i, f"0 to {len(here) - 1}")
            place: Any = int(part)
        elif isinstance(here, dict):
            place = part
            if part not in here and i + 1 < len(parts):
                raise _no_such(robot, key, value, i, " | ".join(here))
        else:
            raise _no_such(robot, key, value, i, "a number, and nothing below it")
        if i + 1 == len(parts):
            # TOML tells 1 from 1.0; who types --set means a number.
            old = here[place] if isinstance(here, list) else here.get(place)
            here[place] = _number(value) if isinstance(value, int) and not isinstance(old, int) else value
        else:
            values = here[place]


def _number(value: int) -> float:
    try:
        return float(value)
    except OverflowError:  # the model refuses it in words
        return math.inf if value > 0 else -math.inf


def _no_such(robot: dict[str, Any], key: str, value: Any, at: int, expected: str) -> UsageError:
    """at: which part of the key leads nowhere. The hint names the number of the robot that is spelt most like it, with
    the number that was typed; where there is neither, with its own. Its place in the command is found by `where`."""
    parts = key.split(".")
    known = {name: number for name, number in _numbers(robot) if name != "schema_version"}
    near = nearest(key, known)
    meant = near or "contact.friction"
    return UsageError(
        f"robot.toml has no {key}", where=f"--set {key}", received=parts[at],
        expected=f"{'.'.join(parts[:at])}: {expected}" if at else expected,
        hint=override(meant, value if near and _is_number(value) else known.get(meant, 0.5)),
    )  # fmt: skip


def _numbers(values: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """Every number of robot.toml by its dotted key."""
    for name, value in enumerate(values) if isinstance(values, list) else values.items():
        key = f"{above}{name}"
        if isinstance(value, dict | list):
            yield from _numbers(value, f"{key}.")
        elif _is_number(value):
            yield key, value


def _options(given: dict[str, Any]) -> Options:
    """given: values by the keys as typed, `options.NAME`; their places in the command are found by `where`."""
    from r2s2r_cli.rig.model import Options

    known = {field.name: field.default for field in dataclasses.fields(Options) if field.default != ()}
    values: dict[str, Any] = {}
    for key, value in given.items():
        name = key.partition(".")[2]
        if name not in known:
            near = nearest_choice(name, known)
            raise UsageError("the MuJoCo model has no such option", where=f"--set {key}",
                             expected=" | ".join(f"{OPTIONS}.{one}" for one in known), received=key,
                             hint=_usual(near, known[near]))  # fmt: skip
        default = known[name]
        text = isinstance(default, str)
        shape = len(default) if isinstance(default, tuple) else 0
        right = (
            isinstance(value, bool) if isinstance(default, bool)
            else isinstance(value, str) if text
            else isinstance(value, list) and len(value) == shape and all(_is_number(x) for x in value) if shape
            else _is_number(value)
        )  # fmt: skip
        if not right:
            raise UsageError(f"{key} cannot be that", where=f"--set {key}", received=repr(value),
                             expected=f"something like {default if default is not None else 0.5}",
                             hint=_usual(name, default))  # fmt: skip
        values[name] = tuple(map(float, value)) if shape else value if text or isinstance(value, bool) else float(value)
    return Options(**values)


def _usual(name: str, default: Any) -> str:
    """An option with the value that holds without it, as TOML; None is a number of robot.toml."""
    return override(f"{OPTIONS}.{name}", 0.5 if default is None else default)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
