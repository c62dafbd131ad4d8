"""Sequences on paper: moves are group actions, values mean what they say, A* finds the way or says there is none."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.plan.gaits import Gait
from r2s2r_cli.stages.plan.goal import Goal, way_near, way_to
from r2s2r_cli.stages.plan.placement import Reference, reference_of, turned, wrapped
from r2s2r_cli.stages.plan.robust import Primitive
from r2s2r_cli.stages.plan.route import (
    ARC,
    LONG,
    SIGNS,
    Moves,
    Paths,
    arching,
    best_sequences,
    different_sequences,
    extended,
    farthest,
    moves_of,
    start_paths,
    walked,
    without_rare,
)
from r2s2r_cli.stages.plan.symmetry import principal_axis, symmetry_group
from tests.support.robots import subject


def three_bar() -> Reference:
    """The reference of the paper's robot."""
    robot = subject("threebar").robot
    return reference_of(np.array(robot.rest_caps_m), symmetry_group(robot))


def lying(reference: Reference, element: int, xy: np.ndarray, yaw: float) -> np.ndarray:
    """Caps (cap, 3) of the reference after a symmetry, turned and moved."""
    flat = turned(reference.p[:, :2], yaw) + xy
    p_WE = np.empty_like(reference.p)
    p_WE[list(reference.group.elements[element].caps)] = np.concatenate([flat, reference.p[:, 2:]], axis=1)
    return p_WE


def made(name: str, x: float, y: float, turn: float, element: int = 0, **other: float) -> Primitive:
    """A primitive of that move."""
    values = {"worked": 1.0, "same_element": 1.0, "duration": 4.0, **other}
    shape = np.array([[float(digit) for digit in f"{ord(name[0]) % 64:06b}"], [1.0] * 6])
    return Primitive(
        name, "forward", Gait(shape), 0.0, 0.0, 0.0, 0.0, values["worked"], np.array([x, y, turn]), np.zeros(3),
        element, values["same_element"], values["duration"],
    )  # fmt: skip


def simple(*moves: tuple[float, float, float]) -> Moves:
    """Moves (x, y, turn) of 1 s that leave the robot on its triangle."""
    return moves_of(three_bar(), [made(str(k), *move, duration=1.0) for k, move in enumerate(moves)])


def test_moves_on_paper_are_moves_of_poses() -> None:
    """A gait that moves the reference by a shift, a turn and a symmetry, done again and again: place, heading and
    triangle on paper are those of end caps that are relabelled, turned and moved for each gait."""
    reference, generator = three_bar(), np.random.default_rng(2)
    angle = reference.axis_angles()
    gaits = []
    for k in range(6):
        x, y, yaw = generator.normal(size=3) * [0.2, 0.2, 0.4]
        gaits.append(made(str(k), x, y, float(wrapped(yaw + angle[k] - angle[0])), k))
    moves, paths = moves_of(reference, gaits), start_paths()
    group, element, xy, yaw = reference.group, 0, np.zeros(2), 0.0
    heading = 0.0
    for pick in generator.integers(0, 6, 12):
        before = principal_axis(lying(reference, element, xy, yaw))
        xy = xy + turned(gaits[pick].move[:2], yaw)
        yaw += float(moves.yaw[pick])
        element = group.product(gaits[pick].element, element)
        p_WE = lying(reference, element, xy, yaw)
        after = principal_axis(p_WE)
        heading += float(wrapped(np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])))
        paths = extended(moves, paths).take(np.array([pick]))
        assert np.allclose(paths.xy[0, -1], xy) and paths.element[0] == element
        assert abs(paths.heading[0, -1] - heading) < 1e-9
        # A gait turns the robot as it turned the reference, whatever triangle it begins on.
        assert abs(wrapped(paths.heading[0, -1] - paths.heading[0, -2] - gaits[pick].move[2])) < 1e-9
        found = reference.place(p_WE[None])
        assert found.element[0] == element and np.allclose(found.xy[0], xy)
        assert abs(wrapped(found.yaw[0] - paths.yaw[0])) < 1e-9


def test_the_long_gaits_ask_for_what_their_names_say() -> None:
    """Of forward, arcs to the left, and turns on the spot: straight takes the first, arching the second, and the turns
    those of their side."""
    moves = simple((0.0, 0.2, 0.0), (0.0, 0.2, ARC), (0.0, 0.0, 0.3), (0.0, 0.0, -0.3))
    for name, pick in (("straight", 0), ("arching", 1), ("turn-counterclockwise", 2), ("turn-clockwise", 3)):
        # How the robot lies at the end does not count for an arc: three of four gaits are asked for.
        assert best_sequences(moves, 4, LONG[name]).picks[0, :3].tolist() == [pick] * 3


def test_a_turn_is_to_the_side_that_it_is_named_for() -> None:
    """A gait that turns clockwise and leaves its place is worth less than one that turns the other way on the spot, and
    is taken all the same; where only the other one is there, there is no sequence, and so none is tried."""
    value, sign = LONG["turn-clockwise"], SIGNS["turn-clockwise"]
    moves = simple((0.0, 0.4, -0.4), (0.0, 0.0, 0.2))
    assert best_sequences(moves, 1, value).picks.tolist() == [[1]]
    for reach in (np.inf, 1.0):
        assert best_sequences(moves, 1, value, reach=reach, sign=sign).picks.tolist() == [[0]]
    wrong = moves.take(np.array([1]))
    assert not best_sequences(wrong, 2, value, reach=1.0, sign=sign).picks.shape[1]
    assert not different_sequences(wrong, partial(best_sequences, length=2, value=value, sign=sign), 4)


def test_a_gait_that_may_go_wrong_is_not_worth_a_little_more_way() -> None:
    """0.25 m that fails once in ten against 0.2 m that never does: the second, in sequences and on the way to a goal;
    0.6 m that fails once in ten is worth it."""
    sure, risky = made("a", 0.0, 0.2, 0.0), made("b", 0.0, 0.25, 0.0, worked=0.9)
    moves = moves_of(three_bar(), [sure, risky])
    assert best_sequences(moves, 4, LONG["straight"]).picks.tolist() == [[0] * 4]
    assert set(way_to(moves, Goal((0.0, 1.0), 0.0, within_m=0.01)).picks[0].tolist()) == {0}
    far = moves_of(three_bar(), [sure, made("c", 0.0, 0.6, 0.0, worked=0.9)])
    assert best_sequences(far, 4, LONG["straight"]).picks.tolist() == [[1] * 4]


def test_an_arc_loses_nothing_but_its_length() -> None:
    """A regular polygon whose sides turn by ARC is worth its length; the straight line of that length less."""
    turn = ARC * np.arange(5)
    step = 0.2 * np.column_stack([np.cos(turn), np.sin(turn)])
    corners = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    line = np.column_stack([0.2 * np.arange(6), np.zeros(6)])
    none = np.zeros((2, 6))
    paths = Paths(np.zeros((2, 5), int), np.stack([corners, line]), none, np.zeros(2), np.zeros(2, int))
    assert np.allclose(arching(paths), [1.0, 1.0 - 2.0 * 4 * ARC])
    mirrored = Paths(paths.picks, paths.xy * [1, -1], none, paths.yaw, paths.element)
    assert np.allclose(arching(mirrored), arching(paths))


def test_the_way_is_found_and_is_short() -> None:
    """Steps of 0.2 m and quarter turns: (0.6, 0) with a half-turn takes three steps and two turns, in any order that
    leads there; where nothing leads, the nearest is named."""
    moves = simple((0.2, 0.0, 0.0), (0.0, 0.0, np.pi / 2), (-0.2, 0.0, 0.0))
    path = way_to(moves, Goal((0.6, 0.0), np.pi, within_m=0.01, within_rad=0.01))
    assert np.allclose(path.xy[0, -1], [0.6, 0.0], atol=1e-9) and np.isclose(abs(path.heading[0, -1]), np.pi)
    assert path.picks.shape[1] == 5
    assert way_to(moves, Goal((0.0, 0.0), 0.0)).picks.shape[1] == 0
    with pytest.raises(NumericalError, match="no sequence"):
        way_to(simple((0.0, 0.0, 0.1)), Goal((1.0, 0.0), 0.0))


def test_a_way_aims_nearer_than_what_is_near_enough() -> None:
    """Steps of 0.09 m to a goal 0.18 m away, within 0.1 m: one step is near enough (0.09 m), and two are on it; what is
    taken is the two, since the robot ends elsewhere than on paper. Steps of 0.12 m come no nearer than 0.06 m."""
    goal = Goal((0.18, 0.0), 0.0, within_m=0.1)
    assert way_to(simple((0.09, 0.0, 0.0)), goal).picks.shape[1] == 1
    assert way_near(simple((0.09, 0.0, 0.0)), goal).picks.shape[1] == 2
    path = way_near(simple((0.12, 0.0, 0.0)), goal)
    end = path.xy[:, -1], path.heading[:, -1]
    assert np.allclose(goal.left(*end)[0], 0.06) and goal.reached(*end).all()
    with pytest.raises(NumericalError, match="no sequence"):
        way_near(simple((0.0, 0.0, 0.1)), Goal((1.0, 0.0), 0.0))


def test_other_sequences_leave_out_what_was_used_most() -> None:
    """The best, then the best without its gait, numbered as in all moves."""
    moves = simple((0.0, 0.1, 0.0), (0.0, 0.3, 0.0), (0.0, 0.2, 0.0))
    best = partial(best_sequences, length=3, value=LONG["straight"])
    assert [path.picks.tolist() for path in different_sequences(moves, best, 5)] == [[[1] * 3], [[2] * 3], [[0] * 3]]


def test_what_robots_walked_is_told_from_their_start() -> None:
    """Whole turns are counted, and ways begin at the origin along the first heading."""
    turn = np.array([0.5, 2.0, 3.5, 5.0, 6.5])
    way = [np.array([[1.0 + 0.1 * k, 2.0, wrapped(one)]]) for k, one in enumerate(turn)]
    paths = walked(way)
    assert np.allclose(paths.heading[0], turn - 0.5)
    assert np.allclose(paths.xy[0], 0.1 * np.arange(5)[:, None] * [np.cos(0.5), -np.sin(0.5)])


def test_gaits_that_may_end_elsewhere_are_left_out() -> None:
    """Only gaits that come back, on one triangle, are put into sequences; where a behaviour has none, all of it are."""
    good, stray = made("a", 0.1, 0, 0), made("b", 0.2, 0, 0, same_element=0.8)
    lost = made("c", 0.3, 0, 0, worked=0.85)
    assert [one.name for one in without_rare([good, stray, lost, good])] == ["a"]
    assert [one.name for one in without_rare([stray, lost])] == ["b", "c"]
    other = replace(stray, behaviour="clockwise")
    assert [one.name for one in without_rare([good, lost, other])] == ["a", "b"], "no steady one turns it"


def test_a_sequence_stays_within_reach() -> None:
    """No place on its way is farther than allowed; a shorter one is then the best, and none where none fits."""
    reference = three_bar()
    moves = moves_of(reference, [made("far", 0.0, 0.2, 0.0), made("short", 0.0, 0.05, 0.0)])
    free = best_sequences(moves, 6, LONG["straight"])
    assert free.xy[0, -1, 1] == pytest.approx(1.2)
    near = best_sequences(moves, 6, LONG["straight"], reach=0.5)
    assert farthest(near)[0] == pytest.approx(0.5)
    assert near.picks.shape[1] < 6
    assert best_sequences(moves, 6, LONG["straight"], reach=0.01).picks.shape[1] == 0


def test_a_goal_out_of_reach_is_answered_with_one_that_is_reached() -> None:
    """As it would be typed in the place of what was."""
    moves = simple((0.0, 0.0, 0.1))
    with pytest.raises(NumericalError) as caught:
        way_near(moves, Goal((1.0, 0.0), 0.0, typed="1,0,0"))
    assert caught.value.where == "--to 1,0,0"
    option, text = caught.value.hint.split()
    x, y, heading = map(float, text.split(","))
    assert option == "--to" and way_near(moves, Goal((x, y), np.radians(heading))).picks.shape[0] == 1


def test_standing_still_is_no_way() -> None:
    """Gaits of 0.2 m, and a goal 0.11 m away that none comes nearer to: no empty sequence stands for a policy. One
    that a gait does come nearer to, though not near enough, is gone to as far as that."""
    moves = simple((0.0, 0.2, 0.0))
    with pytest.raises(NumericalError, match="nearer to it than the robot stands") as caught:
        way_near(moves, Goal((0.11, 0.0), 0.0))
    assert caught.value.hint == "--to 0.00,0.20,0"
    assert way_near(moves, Goal((0.11, 0.2), 0.0)).picks.shape[1] == 1
