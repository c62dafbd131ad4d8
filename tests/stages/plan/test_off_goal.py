"""A policy that was asked to go to a place: how far it ends from there, and the name by which it is executed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from r2s2r_cli.stages.plan.goal import Goal
from r2s2r_cli.stages.plan.groups import LongPolicy
from r2s2r_cli.stages.plan.rewards import Outcomes
from r2s2r_cli.stages.plan.route import Paths, start_paths
from r2s2r_cli.stages.plan.ways import worth_of_lost
from r2s2r_cli.views.plan_page import report_tables
from schemas.results_plan import PlanReport, PolicyFigures

GOAL = Goal((0.2, 0.1), math.radians(30.0))


def ended(paper: tuple[float, float, float], simulated: tuple[float, float, float], goal: Goal | None) -> LongPolicy:
    """A policy that ends at these places [m] and headings [deg]."""
    path = start_paths()
    ends = {"xy": np.array([[[*paper[:2]]]]), "heading": np.radians([[paper[2]]])}
    path = cast(Paths, type("Ended", (), {**{name: getattr(path, name) for name in path.__dataclass_fields__}, **ends}))
    came = Outcomes(np.array([[*simulated[:2], 0.0]]), np.radians([simulated[2]]), *(np.zeros(1) for _ in range(4)))
    return LongPolicy("to", cast(Any, None), path, came, np.array([True]), goal)


@pytest.mark.parametrize(
    ("paper", "simulated", "said"),
    [
        ((0.2, 0.1, 30.0), (0.25, 0.1, 40.0), ""),
        ((0.2, 0.1, 30.0), (0.2, 0.35, 40.0), "simulated whole, it ends 0.25 m and 10 deg from the goal"),
        ((0.2, -0.2, 30.0), (0.2, 0.1, 30.0), "on paper, it ends 0.30 m and 0 deg from the goal"),
        ((0.2, 0.1, 30.0), (0.2, 0.1, 60.0), "simulated whole, it ends 0.00 m and 30 deg from the goal"),
    ],
)
def test_what_ends_elsewhere_says_how_far_and_how_far_is_near_enough(
    paper: tuple[float, float, float], simulated: tuple[float, float, float], said: str
) -> None:
    """Both numbers, of the simulation and else of the way on paper."""
    found = ended(paper, simulated, GOAL).off_goal()
    assert found == (f"{said}; near enough are 0.1 m (plan.goal_within_m) and 20 deg" if said else "")
    assert ended(paper, simulated, None).off_goal() == ""


def test_a_straight_policy_that_comes_back_to_its_start_is_said_to() -> None:
    """Two gaits of 0.2 m that lead back, or forth and to the side; one gait alone has nothing to undo it, and other
    policies are not to go far."""
    path = start_paths()

    def policy(name: str, xy: list[tuple[float, float]], end: tuple[float, float]) -> LongPolicy:
        one = replace(ended((*xy[-1], 0.0), (*end, 0.0), None), name=name)
        way = {name: getattr(path, name) for name in path.__dataclass_fields__}
        return replace(
            one, path=cast(Paths, type("Way", (), {**way, "xy": np.array([xy]), "heading": np.zeros((1, 3))}))
        )

    there, back = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.2)], [(0.0, 0.0), (0.2, 0.0), (0.01, 0.0)]
    assert policy("straight", there, (0.2, 0.2)).back_again() == ""
    assert (
        "ends 0.01 m from its start, and one of its 2 gaits goes 0.20 m"
        in policy("straight", back, (0.01, 0.0)).back_again()
    )
    assert policy("straight", there, (0.05, 0.0)).back_again()  # on paper it goes far, simulated whole it does not
    assert policy("arching", back, (0.01, 0.0)).back_again() == ""
    assert policy("straight", there[:2], (0.01, 0.0)).back_again() == ""


def test_a_robot_that_gives_up_is_worth_no_more_than_one_that_ends_far_off() -> None:
    """-10, or the least that a robot of any sequence for this purpose is worth that did not give up."""
    some = np.array([False, True])
    assert worth_of_lost([(np.array([-1.0, 3.0]), some), (np.array([-2.0, -99.0]), some)]) == -10.0
    assert worth_of_lost([(np.array([-1.0, 3.0]), ~some), (np.array([-50.0, -99.0]), some)]) == -50.0
    assert worth_of_lost([(np.array([-50.0, -99.0]), np.array([True, True]))]) == -10.0


@pytest.mark.parametrize(
    "turns", [(-88.0, -92.0, -91.0, -89.0), (268.0, -92.0, 269.0, -89.0), (91.0, 89.0, 90.0, 90.0)]
)
def test_draws_that_end_the_other_way_round_do_not_make_up_for_each_other(turns: tuple[float, ...]) -> None:
    """Half a turn off in every draw, by a little more or less, or with a whole turn more: off by half a turn."""
    one = ended((0.2, 0.1, 90.0), (0.2, 0.1, 90.0), Goal((0.2, 0.1), math.radians(90.0)))
    count = len(turns)
    xyz = np.tile([0.2, 0.1, 0.0], (count, 1))
    came = Outcomes(xyz, np.radians(turns), *(np.zeros(count) for _ in range(4)))
    many = replace(one, came=came, good=np.ones(count, dtype=bool))
    assert np.degrees(many.reached[:, 2].std()) < 2.0
    assert bool(many.off_goal()) == (turns[0] != 91.0)


def test_the_table_calls_it_as_execute_does() -> None:
    """The name alone in its column; where it leads stands above."""
    figures: dict[str, Any] = {
        "name": "to", "gaits": ("forward-1",), "targets": 3, "shortcuts": 0, "saved": 0, "expected_m": (0.2, 0.1),
        "expected_turn_rad": 0.5, "shift_m": (0.2, 0.1), "shift_sd_m": (0.0, 0.0), "turn_rad": 0.5, "turn_sd_rad": 0.0,
        "worked": 1.0, "duration_s": 5.0, "goal": (0.2, 0.1, math.radians(30.0)),
    }  # fmt: skip
    report = PlanReport(
        numbers="robot.toml", identified=False, symmetries=6, found=1, simulated=1, pruned=0, lost=0, draws=1, pairs=1,
        gaits=(), policies=(PolicyFigures(**figures),), computed_by="machine code",
    )  # fmt: skip
    _, long, _ = report_tables(report)
    assert [row[0] for row in long.rows] == ["to"]
    assert long.title == "long policies; to leads to (0.2 m, 0.1 m, 30 deg)"
