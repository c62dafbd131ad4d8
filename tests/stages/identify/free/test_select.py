"""Specs of --free: the grammar, and everything that can be wrong with one."""

from __future__ import annotations

import math

import pytest

from r2s2r_cli.errors import ExitCode, UsageError
from r2s2r_cli.stages.identify.free import catalogue, select
from r2s2r_cli.stages.identify.free.select import Spec, parse
from tests.support.engine import threebar
from tests.support.varied import varied


@pytest.mark.parametrize(
    ("text", "spec"),
    [
        ("friction", Spec("friction")),
        ("friction=0.5", Spec("friction", start=0.5)),
        ("friction=0.5,0.2..1.5,~0.3", Spec("friction", 0.5, 0.2, 1.5, 0.3)),
        ("friction, ~0.3, 0.2..1.5", Spec("friction", None, 0.2, 1.5, 0.3)),
        ("com.0=-1e-3,-0.02..", Spec("com.0", -1e-3, -0.02, None, None)),
        ("com.0,..0.02", Spec("com.0", None, None, 0.02, None)),
        ("motor_speed.*=.5,.1...9", Spec("motor_speed.*", 0.5, 0.1, 0.9)),
        ("friction,~inf", Spec("friction", prior_sd=math.inf)),
    ],
)
def test_the_grammar(text: str, spec: Spec) -> None:
    """Every part is optional, and their order is free."""
    assert parse(text) == spec


@pytest.mark.parametrize(
    "text", ["", "=0.5", "friction=", "friction=half", "friction,0.2", "friction,..", "friction,~", "friction,~a",
             "friction,0..1,0..2", "friction,~1,~2", "friction=0.5=0.6", "friction,a..b"],
)  # fmt: skip
def test_what_cannot_be_read(text: str) -> None:
    """Exit code 2, with a spec that can be pasted."""
    with pytest.raises(UsageError, match="cannot read") as caught:
        parse(text)
    assert caught.value.exit_code == ExitCode.USAGE
    assert parse(caught.value.hint.split('"')[1]).name == "friction"


def test_given_parts_replace_those_of_the_catalogue() -> None:
    """And the others stay."""
    (made,) = select(["friction=0.5,..1.2"], varied())
    own = catalogue(varied())["friction"]
    assert (made.start, made.lower, made.upper) == (0.5, own.lower, 1.2)
    assert (made.coordinate, made.prior_sd, made.unit) == (own.coordinate, own.prior_sd, own.unit)


def test_order_and_wildcards() -> None:
    """As asked for; FAMILY.* stands for its elements and not for the whole."""
    names = [free.name for free in select(["friction.*", "mass", "motor_speed_in.*=0.4"], varied())]
    assert names == [f"friction.cap{c}" for c in range(6)] + ["mass"] + [f"motor_speed_in.{k}" for k in range(6)]
    assert {free.start for free in select(["motor_speed.*=0.4"], varied())} == {0.4}
    assert len(select(["cap_friction.factor.*"], varied())) == 6


@pytest.mark.parametrize(
    ("text", "near"),
    [("motor_sped", "motor_speed"), ("frction", "friction"), ("friction.0", "friction"),
     ("rest_lenght.7", "rest_length.7"), ("motor_speed.6", "motor_speed."), ("attachment_phase", "attachment_phase."),
     ("masses.*", "mass.*"), ("motor_lag.tau", "motor_lag.tau_s")],
)  # fmt: skip
def test_unknown_names(text: str, near: str) -> None:
    """Exit code 2; the hint has a name that exists and looks like it."""
    with pytest.raises(UsageError, match="unknown parameter") as caught:
        select([text], varied())
    assert caught.value.exit_code == ExitCode.USAGE
    assert near in caught.value.hint
    assert select([caught.value.hint.split()[-1]], varied())


@pytest.mark.parametrize("text", ["zzzz", "foo", "zzzz.*"])
def test_no_name_is_offered_that_is_not_near(text: str) -> None:
    """Pasted, it would free a number that nobody meant: the hint says where the names are."""
    with pytest.raises(UsageError, match="unknown parameter") as caught:
        select([text], varied())
    assert caught.value.hint == "r2s2r identify --help   # docs/reference/free-parameters.md lists the names"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("friction,1.5..0.2", "not below"),
        ("friction,0.5..0.5", "not below"),
        ("friction=2,0.2..1.5", "outside"),
        ("friction,0.1..0.3", "outside"),
        ("friction=0.2,0.2..1.5", "on a bound"),
        ("friction=1.5,0.2..1.5", "on a bound"),
        ("restitution=0", "on a bound"),
        ("restitution=0.5,0..1.5", "beyond"),
        ("friction,-1..1", "beyond"),
        ("motor_lag,-0.1..1", "beyond"),
        ("friction=nan", "no finite number"),
        ("friction,0.1..inf", "no finite number"),
        ("friction,~0", "width"),
        ("friction,~-1", "width"),
        ("friction,~nan", "width"),
    ],
)
def test_contradictions(text: str, what: str) -> None:
    """Exit code 2, and the hint is a spec without the contradiction."""
    with pytest.raises(UsageError, match=what) as caught:
        select([text], threebar())
    assert caught.value.exit_code == ExitCode.USAGE
    hint = caught.value.hint.split(" --free ")[1]
    if text == "friction=2,0.2..1.5":
        assert hint.endswith(",0.2..1.5")  # the bounds that were asked for are no part of the contradiction
    assert select([hint], threebar())[0].name == text.split("=")[0].split(",")[0]


@pytest.mark.parametrize(
    "pair",
    [("motor_speed", "motor_speed.2"), ("motor_speed", "motor_speed_in"), ("motor_speed_out.1", "motor_speed.1"),
     ("friction", "friction.cap3"), ("stiffness_passive", "stiffness.7"), ("damping", "damping_actuated"),
     ("rest_length", "rest_length.*"), ("mass", "mass.0"), ("motor_lag", "motor_lag.tau_s"),
     ("ground_slope_x", "ground_slope.angle_x_rad"), ("cap_friction.factor", "cap_friction.factor.0")],
)  # fmt: skip
def test_two_that_set_the_same(pair: tuple[str, str]) -> None:
    """Exit code 2, in either order; the message names both."""
    for both in (pair, pair[::-1]):
        with pytest.raises(UsageError, match="set the same number") as caught:
            select(both, varied())
        assert caught.value.exit_code == ExitCode.USAGE


def test_two_that_do_not() -> None:
    """In and out, the two slopes, com and phase of one rod, friction and one cap's factor."""
    specs = ["motor_speed_in", "motor_speed_out.*", "ground_slope_x", "ground_slope_y", "com.0", "attachment_phase.0",
             "friction", "cap_friction.factor.0", "stiffness_actuated", "stiffness.8"]  # fmt: skip
    assert len(select(specs, varied())) == len(specs) + 5


def test_the_same_twice() -> None:
    """Also by a wildcard."""
    for specs in (["mass", "mass=0.1"], ["mass.*", "mass.1"]):
        with pytest.raises(UsageError, match="twice"):
            select(specs, varied())
