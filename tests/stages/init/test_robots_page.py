"""docs/concepts/robots.md lists every number of every robot, as `init` writes it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.stages.init.facts import FACTS
from r2s2r_cli.stages.init.robots import robot_toml

PAGE = Path(__file__).resolve().parents[3] / "docs" / "concepts" / "robots.md"
BASE = "threebar"
"""The robot whose numbers hold where another robot's table has no row."""

NOT_LISTED = {"name", "shape", "caps", "kind", "sites_m", "cable", "rod"}
"""Names, the places of cables and sensors, and points that are derived one by one: not rows of a table."""


def numbers(name: str) -> dict[str, list[Any]]:
    """Key of the page -> values of one robot: one number, a range, or one value a motor."""
    robot = tomllib.loads(robot_toml(name))
    rows: dict[str, list[Any]] = {}

    def put(prefix: str, table: dict[str, Any]) -> None:
        for key, value in table.items():
            tables = isinstance(value, list) and isinstance(value[0], dict)
            if key not in NOT_LISTED and not tables:
                rows.setdefault(f"{prefix}.{key}", []).append(abs(value) if key == "offset_m" else value)

    for section in ("pid", "limits", "contact"):
        put(section, robot[section])
    for rod in robot["rods"]:
        put("rods", rod)
        for part in rod["parts"]:
            put("rods.parts." + re.sub("_even|_odd", "", part["name"]), part)
    for cable in robot["cables"]:
        put("cables." + cable["kind"], cable)
    for section in ("motors", "sensors"):
        for table in robot.get(section, []):
            put(section, table)
    for color in robot.get("colors", []):
        put("colors." + color["rod"], color)
    return {key: flat(values) for key, values in rows.items()}


def flat(values: list[Any]) -> list[Any]:
    """The items of a range; all values of names and signs, which differ from motor to motor; else the one value."""
    if isinstance(values[0], list):
        return list(values[0])
    return values if isinstance(values[0], str | int) or len(set(values)) > 1 else values[:1]


def listed(name: str) -> dict[str, list[str]]:
    """Key -> words of the value, from the table in the robot's section."""
    section = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    (text,) = [part for part in section if part.startswith(name + "\n")]
    rows = re.findall(r"^\| `([\w.]+)` \| ([^|]+) \| ([^|]+) \|$", text, re.MULTILINE)
    assert rows and all(source.strip() for _, _, source in rows)
    return {key: value.split() for key, value, _ in rows}


def same(words: list[str], values: list[Any]) -> bool:
    """Do the words begin with the values (a unit may follow)?"""
    if len(words) not in (len(values), len(values) + 1, len(values) + 2):
        return False
    pairs = zip(words[: len(values)], values, strict=True)
    return all(word == value if isinstance(value, str) else float(word) == value for word, value in pairs)


@pytest.mark.parametrize("name", FACTS)
def test_every_row_is_what_init_writes(name: str) -> None:
    """Each row of a robot's table has a number of its robot.toml, with that value."""
    values = numbers(name)
    for key, words in listed(name).items():
        assert key in values, key
        assert same(words, values[key]), (key, words, values[key])


@pytest.mark.parametrize("name", FACTS)
def test_every_number_is_on_the_page(name: str) -> None:
    """Each number of robot.toml has a row, in the robot's own table or, where it is the same, in that of threebar."""
    own, base, base_values = listed(name), listed(BASE), numbers(BASE)
    for key, values in numbers(name).items():
        color = re.sub(r"^colors\.\w+\.(saturation|value)", r"colors.red.\1", key)
        if key not in own:
            assert color in base, key
            assert values == base_values[color], key
