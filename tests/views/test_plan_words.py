"""What the tables of a plan, and of what it takes to execute one, say in words."""

from __future__ import annotations

import pytest

from r2s2r_cli.commands.execute_outcome import _lasting
from r2s2r_cli.views.plan import signed, told
from r2s2r_cli.views.plan_page import _long, _policy, report_tables
from schemas.results_plan import PlanReport, PolicyFigures


@pytest.mark.parametrize(
    ("shortcuts", "saved", "said"), [(0, 0, "0"), (1, 1, "1 (-1 target)"), (2, 5, "2 (-5 targets)")]
)
def test_shortcuts_say_what_they_save(shortcuts: int, saved: int, said: str) -> None:
    """And nothing where there are none."""
    figures = PolicyFigures(
        name="straight", gaits=("forward-1",), targets=3, shortcuts=shortcuts, saved=saved, expected_m=(0.0, 0.2),
        expected_turn_rad=0.0, shift_m=(0.0, 0.2), shift_sd_m=(0.0, 0.0), turn_rad=0.0, turn_sd_rad=0.0, worked=1.0,
        duration_s=4.0, goal=None,
    )  # fmt: skip
    assert _policy(figures)[2] == said


def test_short_runs_last_seconds() -> None:
    """Not a tenth of a minute."""
    assert [_lasting(seconds) for seconds in (6.2, 119.0, 150.0)] == ["6 s", "119 s", "2.5 minutes"]


def test_what_rounds_to_nothing_has_no_sign() -> None:
    """All else has one: which way is what the number says."""
    assert [signed(value) for value in (-0.4, 0.4, 0.0, -0.6, 12.3)] == ["0", "0", "0", "-1", "+12"]
    assert [signed(value, 2) for value in (-0.004, -0.01)] == ["0.00", "-0.01"]
    assert told("clockwise", -0.001) == "0 deg"


def test_the_digits_of_a_shape_are_explained() -> None:
    """Above the table of the gaits, which the terminal and the page share."""
    report = PlanReport.model_construct(
        gaits=(), policies=(), pairs=4, draws=2, seconds={}, symmetries=1, simulated=0, lost=0, pruned=0, found=0,
        wall_s=0.0,
    )  # fmt: skip
    assert "a digit a motor, 1: its cable long, 0: short" in next(iter(report_tables(report))).title


@pytest.mark.parametrize(("count", "said"), [(0, "0 long policies"), (1, "1 long policy"), (2, "2 long policies")])
def test_long_policies_are_counted(count: int, said: str) -> None:
    """One is a policy."""
    assert _long(count) == said
