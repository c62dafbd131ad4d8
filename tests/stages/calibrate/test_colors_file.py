"""Colour ranges in robot.toml: set where they are, added where not, everything else as it was."""

from __future__ import annotations

import tomllib

import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.colors import with_colors
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import HsvRange, Robot

RED = HsvRange(rod="red", hue=(170.0, 4.0), saturation_min=110.0, value_min=31.0)


def test_a_range_is_set_and_nothing_else() -> None:
    """One rod gets its new range with its source; the other lines of the file stay to the letter."""
    text = robot_toml("threebar")
    new = with_colors(text, [RED], source="doctor camera, 2 clicks")
    robot = Robot.model_validate(tomllib.loads(new))
    assert {color.rod: color for color in robot.colors}["red"] == RED
    changed = [(a, b) for a, b in zip(text.splitlines(), new.splitlines(), strict=True) if a != b]
    assert [b.split("=")[0].strip() for _, b in changed] == ["hue", "saturation_min", "value_min"]
    assert all("calibrate: doctor camera, 2 clicks" in b for _, b in changed)
    assert "before: [T]" in changed[0][1]
    assert with_colors(new, [RED], source="doctor camera, 2 clicks") == new


@pytest.mark.parametrize("kept", [0, 1])
def test_colours_that_are_not_there_are_added(kept: int) -> None:
    """A robot without colours, or without this one, gets a table of its own."""
    text = robot_toml("threebar")
    head, _, tail = text.partition("[[colors]]")
    head = head.rstrip() + "\n"
    if kept:
        head += "\n[[colors]]" + tail.split("[[colors]]")[1].rstrip() + "\n"  # the green one
    new = with_colors(head, [RED])
    assert {c.rod for c in Robot.model_validate(tomllib.loads(new)).colors} == {"red", *(["green"] if kept else [])}
    assert new.startswith(head.rstrip())


def test_colours_in_braces_are_refused() -> None:
    """A list of inline tables cannot carry comments: the user is told how to write it."""
    text = robot_toml("threebar").partition("# Colours of the rods'")[0]
    head = 'colors = [{rod = "red", hue = [1, 2], saturation_min = 1, value_min = 1}]\n'
    with pytest.raises(InputError, match="braces"):
        with_colors(head + text, [RED])
