"""Long policies in the engine: gaits relabelled for where the robot has come to, and shortcuts that keep the end."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np

from r2s2r_cli.stages.plan.gaits import Gait, Seen, run_gaits, seen
from r2s2r_cli.stages.plan.long import Walk, _Option, _taken, walks
from r2s2r_cli.stages.plan.placement import Reference
from r2s2r_cli.stages.plan.robust import Primitive
from r2s2r_cli.stages.plan.route import walked
from r2s2r_cli.stages.plan.runs import played, policy_file, run_groups
from r2s2r_cli.stages.plan.ways import share_astray, turns_as_named
from tests.stages.plan.planted import bench
from tests.support.robots import subject

FORWARD = ("101011", "001010", "111111")
"""A gait of the paper's robot that rolls it a third about its principal axis."""


def forward() -> Primitive:
    """That gait as a primitive."""
    targets = np.array([[float(digit) for digit in shape] for shape in FORWARD])
    zero = np.zeros(3)
    return Primitive("forward-1", "forward", Gait(targets), 0, 0, 0, 0, 1.0, zero, zero, 4, 1.0, 4.2)


def test_a_gait_relabelled_for_another_triangle_does_the_same() -> None:
    """From where the gait has brought it the robot does it again, relabelled: the same way forward, another third of
    a turn about its axis."""
    executor, reference, at = bench()
    gait = forward().gait
    first, sound = run_gaits(executor, reference, at, [gait], np.zeros(1, dtype=int))
    moved = executor.run(at, gait.targets[None]).last
    again, sound_too = run_gaits(executor, reference, moved, [gait], np.zeros(1, dtype=int))
    assert sound.all() and sound_too.all() and first.element[0] == again.element[0] != 0
    assert first.com[0, 1] > 0.2 and np.allclose(first.com[0], again.com[0], atol=0.03)


def test_long_policies_go_on_where_the_robot_is() -> None:
    """Three gaits without smoothing are the gait, relabelled by the powers of its symmetry, returns to rest included;
    smoothed the policy is shorter, ends on the same triangle and comes as far. What was walked is what the policy does
    when it is run whole, and what the stored run of it shows."""
    executor, reference, at = bench()
    gait = forward()
    (plain,) = walks(executor, reference, at, [[gait] * 3], smooth=False)
    (short,) = walks(executor, reference, at, [[gait] * 3])
    group, power, expected = reference.group, 0, []
    for _ in range(3):
        expected.append(group.elements[power].relabelled(gait.gait.targets))
        power = group.product(gait.element, power)
    assert np.array_equal(plain.policy, np.concatenate(expected)) and plain.elements == [0, 4, 2]
    assert (plain.shortcuts, short.shortcuts) == (0, 2) and len(short.policy) == len(plain.policy) - short.saved
    far = [walked(walk.way).xy[0, -1] for walk in (plain, short)]
    assert np.linalg.norm(far[0]) > 0.6 and np.linalg.norm(far[1]) > 0.75 * np.linalg.norm(far[0])
    files = [policy_file(subject().robot, name, "", walk.policy) for name, walk in (("a", plain), ("b", short))]
    runs = played(executor, reference, at, files)
    groups = run_groups(executor, subject().robot, at, runs)
    for walk, run, name in zip((plain, short), runs, "ab", strict=True):
        assert run.sound.all() and run.came.element[0] == power
        p_WE = groups[f"runs/{name}/frames"]["p_WE"]
        assert np.allclose(p_WE[-1], executor.caps(walk.rested)[0], atol=1e-9)
        assert np.allclose(p_WE[0], seen(executor, at).caps[0])
        assert np.array_equal(groups[f"runs/{name}/intervals"]["target"], walk.policy)


def ends_at(com: np.ndarray, element: int, yaw: float = 0.0) -> Seen:
    """Robots that all stand on a triangle; caps are what `Placed` below reads."""
    rods = np.tile(np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]] * 3), (len(com), 1, 1))
    return cast(Seen, SimpleNamespace(com=com, caps=rods, element=element, yaw=yaw))


class Placed:
    """A reference that knows where the ends of this test stand."""

    def __init__(self, ends: list[Seen]) -> None:
        self.ends = ends

    def place(self, caps: np.ndarray) -> SimpleNamespace:
        """Triangle and yaw of one of them."""
        one = cast(SimpleNamespace, next(end for end in self.ends if end.caps is caps))
        return SimpleNamespace(element=np.full(len(caps), one.element), yaw=np.full(len(caps), one.yaw))


def test_a_shortcut_that_tips_the_robot_is_not_taken() -> None:
    """The first ends on another triangle, the next one turned otherwise, the next 20 cm away, the
    next gives a target up in one of five robots: the fifth is taken; of the first four alone none is."""
    far, beyond, close = (np.tile([x, 0.0, 0.0], (5, 1)) for x in (0.1, 0.3, 0.11))
    ends = [ends_at(far, 1), ends_at(far, 2), ends_at(far, 1, yaw=0.5), ends_at(beyond, 1),
            ends_at(far, 1), ends_at(close, 1)]  # fmt: skip
    sound = [np.ones(5, dtype=bool) for _ in ends]
    sound[4][3] = False
    walk = cast(Walk, SimpleNamespace(com=np.zeros((5, 3)), heading=np.zeros(5), lost=np.zeros(5, dtype=bool)))
    reference, ways = cast(Reference, Placed(ends)), cast(list[_Option], list(range(6)))
    assert _taken(reference, walk, ways, ends, sound) == 5
    assert _taken(reference, walk, ways[:5], ends[:5], sound[:5]) == 0


def test_robots_that_end_elsewhere_are_astray() -> None:
    """Of eight robots one ends in another place, one turned otherwise, one not at rest, and one gave up: half of them.
    Where all turned about the vertical at the start, nothing changes."""
    end = np.tile([0.5, 0.0, 0.3], (8, 1)) + np.random.default_rng(0).normal(scale=0.01, size=(8, 3))
    end[1, 1] += 0.2
    end[2, 2] += 0.5
    rested, lost = np.arange(8) != 3, np.arange(8) == 4
    for yaw in (0.0, 3.0):
        c, s = np.cos(yaw), np.sin(yaw)
        way = [np.tile([0.0, 0.0, yaw], (8, 1)), np.column_stack([end[:, :2] @ [[c, s], [-s, c]], end[:, 2] + yaw])]
        walk = cast(Walk, SimpleNamespace(way=way, lost=lost))
        assert share_astray(walk, rested) == 0.5
    assert share_astray(cast(Walk, SimpleNamespace(way=way, lost=~lost)), lost & ~lost) == 1.0


def test_a_walk_that_turns_the_other_way_is_not_what_its_name_says() -> None:
    """Robots that turn counter-clockwise in the mean are no turn-clockwise; one that gave a target up says nothing, and
    what is named for no turn may turn as it likes."""
    way = [np.zeros((3, 3)), np.column_stack([np.zeros((3, 2)), [0.2, 0.1, -1.0]])]
    walk = cast(Walk, SimpleNamespace(way=way, lost=np.array([False, False, True])))
    assert not turns_as_named("turn-clockwise", walk)
    assert turns_as_named("turn-counterclockwise", walk) and turns_as_named("straight", walk)
