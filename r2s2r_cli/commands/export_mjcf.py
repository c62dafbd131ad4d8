"""`r2s2r export --to mjcf`: a robot description, with any of its numbers overridden, as a MuJoCo model."""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.options import parse_override
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.toml import check_model, read_toml
from r2s2r_cli.store.toml_hints import in_override, last_name, shown
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
        first, _, rest = key.partition(".")
        if first == OPTIONS:
            options[rest] = value
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


def _set(values: Any, key: str, value: Any) -> None:
    """Set a dotted key, list items by their numbers. Raises UsageError for a place that the robot does not have."""
    parts = key.split(".")
    for i, part in enumerate(parts):
        here = values
        if isinstance(here, list):
            if not part.isdecimal() or int(part) >= len(here):
                raise _no_such(key, ".".join(parts[:i]), f"0 to {len(here) - 1}", part)
            place: Any = int(part)
        elif isinstance(here, dict):
            place = part
            if part not in here and i + 1 < len(parts):
                raise _no_such(key, ".".join(parts[:i]), " | ".join(here), part)
        else:
            raise _no_such(key, ".".join(parts[:i]), "a number", f"something below it: {part}")
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


def _no_such(key: str, above: str, expected: str, received: str) -> UsageError:
    return UsageError(
        f"robot.toml has no {key}", where=f"--set, below {above}" if above else "--set", expected=expected,
        received=received, hint="--set contact.friction=0.5, or --set cables.6.stiffness_n_per_m=120",
    )  # fmt: skip


def _options(values: dict[str, Any]) -> Options:
    from r2s2r_cli.rig.model import Options

    known = {field.name: field for field in dataclasses.fields(Options)}
    for name, value in values.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)[0]
            raise UsageError("the MuJoCo model has no such option", where="--set", expected=" | ".join(known),
                             received=name, hint=f"--set {OPTIONS}.{near}={known[near].default}")  # fmt: skip
        default = known[name].default
        text = isinstance(default, str)
        shape = len(default) if isinstance(default, tuple) else 0
        right = (
            isinstance(value, bool) if isinstance(default, bool)
            else isinstance(value, str) if text
            else isinstance(value, list) and len(value) == shape and all(_is_number(x) for x in value) if shape
            else _is_number(value)
        )  # fmt: skip
        if not right:
            raise UsageError(f"{OPTIONS}.{name} cannot be that", where="--set", received=repr(value),
                             expected=f"something like {default if default is not None else 0.5}",
                             hint=f"--set {OPTIONS}.{name}={default if default is not None else 0.5}")  # fmt: skip
        values[name] = tuple(map(float, value)) if shape else value if text or isinstance(value, bool) else float(value)
    return Options(**values)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
