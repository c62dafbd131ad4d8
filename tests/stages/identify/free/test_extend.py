"""Specs that come to what is free anyway."""

from __future__ import annotations

import math

import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.free.extend import extended, written
from r2s2r_cli.stages.identify.free.select import Spec, parse

DEFAULT = ("motor_speed_in.0,~0.2", "friction,~0.3", "rest_length.6,~0.02", "rest_length.7,~0.02", "delay=0.1,0..0.5")


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ((), DEFAULT),
        (("mass", "friction=0.5"), ("mass", "friction=0.5")),
        (("+mass",), (*DEFAULT, "mass")),
        (("+friction,0.01..9",), (DEFAULT[0], "friction,0.01..9.0,~0.3", *DEFAULT[2:])),
        (("+delay=0.2,~0.1",), (*DEFAULT[:4], "delay=0.2,0.0..0.5,~0.1")),
        (("+rest_length.*,~0.1",), (*DEFAULT[:2], DEFAULT[4], "rest_length.*,~0.1")),
        (("mass.2", "+mass"), ("mass",)),
        (("friction", "+friction,~inf", "+mass=2"), ("friction,~inf", "mass=2.0")),
    ],
)
def test_what_is_free(asked: tuple[str, ...], found: tuple[str, ...]) -> None:
    """Plain specs replace the default, those with a plus come to it or change the parts that they name."""
    assert extended(asked, DEFAULT) == found


def test_written_specs_are_read_alike() -> None:
    """Every digit comes back."""
    for spec in (Spec("a"), Spec("a.*", 1 / 3), Spec("a", None, -1e-7, None, math.inf), Spec("a", 2.0, None, 0.1, 0.7)):
        assert parse(written(spec)) == spec


def test_what_cannot_be_read_is_refused() -> None:
    """As without a plus."""
    with pytest.raises(UsageError, match="cannot read"):
        extended(("+friction,a",), DEFAULT)
