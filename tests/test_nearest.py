"""Which known name a wrong one is taken for, and when none is."""

from __future__ import annotations

import pytest

from r2s2r_cli.nearest import nearest, nearest_choice

COMMANDS = ("init", "floor", "plan", "look", "status", "simulate", "identify", "calibrate")


@pytest.mark.parametrize(
    ("word", "meant"),
    [("flor", "floor"), ("plna", "plan"), ("lok", "look"), ("lookk", "look"), ("stat", "status"), ("inti", "init"),
     ("simulation", "simulate"), ("idntfy", "identify"), ("calibration", "calibrate")],
)  # fmt: skip
def test_a_slip_is_near(word: str, meant: str) -> None:
    """A letter missing, too many, another or swapped, and other forms of a long word."""
    assert nearest(word, COMMANDS) == meant


@pytest.mark.parametrize("word", ["foo", "oo", "x", "", "monday", "motor_speed"])
def test_what_only_shares_letters_is_not(word: str) -> None:
    """Of a short word nearly every other has most letters, `foo` of floor as well."""
    assert nearest(word, COMMANDS) == ""


def test_no_name_is_near_where_none_is_known() -> None:
    """And a closed set has one in any case."""
    assert nearest("floor", ()) == ""
    assert nearest_choice("zzzz", ("left", "right")) in ("left", "right")
