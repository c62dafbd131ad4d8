"""What `record` can be asked for: seeded random shapes, excitation sets, repeats that take turns, the rest shape."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.record import EXCITATIONS, excitation, plans, random_targets
from r2s2r_cli.stages.record.plan import with_rest
from r2s2r_cli.stages.simulate.policies import Sequence, random_policy, sequence
from tests.support.fake_robot import calibrated

ROBOT = calibrated()


def targets(policy: object) -> np.ndarray:
    """(step, actuated)."""
    return sequence(policy, ROBOT).target  # type: ignore[arg-type]


@pytest.mark.parametrize("levels", [3, 5, 21])
def test_graded_targets_have_their_levels_and_no_repeats(levels: int) -> None:
    """300 shapes use every level of every cable, no two in a row are equal, and the seed gives the same again."""
    found = targets(random_targets(ROBOT, 300, 7, levels=levels))
    assert np.allclose(found * (levels - 1), np.round(found * (levels - 1)))
    assert all(len(np.unique(column)) == levels for column in found.T)
    assert (np.diff(found, axis=0) != 0).any(axis=1).all()
    assert np.array_equal(found, targets(random_targets(ROBOT, 300, 7, levels=levels)))
    assert not np.array_equal(found, targets(random_targets(ROBOT, 300, 8, levels=levels)))


def test_binary_targets_are_those_of_simulate() -> None:
    """One seed, one policy: what the robot runs can be simulated by the same number."""
    assert random_targets(ROBOT, 15, 3) == random_policy(ROBOT, 15, 3)


@pytest.mark.parametrize(("steps", "levels"), [(0, 2), (10, 1), (10, 22), (0, 5)])
def test_no_policy_is_refused(steps: int, levels: int) -> None:
    """Neither targets nor levels out of their range."""
    with pytest.raises(UsageError):
        random_targets(ROBOT, steps, 0, levels=levels)


@pytest.mark.parametrize("name", ["ramps", "holds", "reversals"])
def test_single_cable_sets_move_one_cable_at_a_time(name: str) -> None:
    """Every shape leaves all cables but one long, every cable has its turn, and the set ends with all long."""
    found = targets(*excitation(ROBOT, name))
    assert ((found != 1.0).sum(axis=1) <= 1).all()
    assert (found != 1.0).any(axis=0).all()
    assert (found[-1] == 1.0).all()


def test_what_each_set_excites() -> None:
    """Ramps go through quarters, holds wait, reversals turn round five times a cable, repeats come back five times."""
    assert set(np.unique(targets(*excitation(ROBOT, "ramps")))) == {0.0, 0.25, 0.5, 0.75, 1.0}
    assert sequence(*excitation(ROBOT, "holds"), ROBOT).hold.min() >= 5.0
    one = np.append(1.0, targets(*excitation(ROBOT, "reversals"))[:7, 0])
    assert (np.diff(np.sign(np.diff(one))) != 0).sum() == 5
    shapes, counts = np.unique(targets(*excitation(ROBOT, "repeats")), axis=0, return_counts=True)
    assert len(shapes) == 2 and (counts == 5).all()


def test_commission_is_all_of_them() -> None:
    """The set for a new robot holds every other set, each a policy of its own."""
    assert [policy.name for policy in excitation(ROBOT, "commission")] == list(EXCITATIONS)
    with pytest.raises(UsageError, match="no excitation set"):
        excitation(ROBOT, "wiggle")


def test_repeats_take_turns() -> None:
    """a-1, b-1, a-2, b-2: drift is not taken for a difference of the policies; two of one name are refused."""
    one, two = random_policy(ROBOT, 2, 1), random_policy(ROBOT, 2, 2)
    assert [p.name for p in plans((one, two), repeats=2, rest=1.0)] == [
        "random-1-1", "random-2-1", "random-1-2", "random-2-2",
    ]  # fmt: skip
    assert [p.name for p in plans((one,), repeats=1, rest=1.0)] == ["random-1"]
    with pytest.raises(UsageError, match="same name") as caught:
        plans((one, one), repeats=1, rest=1.0, again="execute straight")
    assert caught.value.where == "r2s2r execute"
    assert caught.value.hint.startswith("r2s2r execute straight --repeats 2   #")
    with pytest.raises(UsageError, match="number of repeats"):
        plans((one,), repeats=0, rest=1.0)


def test_the_rest_shape_stands_before_and_after() -> None:
    """It is added where the policy does not begin or end there, and held for longer where it does."""
    short = Sequence(np.zeros((1, 2)), np.array([0.5]), np.array([6.0]))
    framed = with_rest(short, rest=2.0, timeout=9.0)
    assert framed.target.tolist() == [[1, 1], [0, 0], [1, 1]]
    assert framed.hold.tolist() == [2.0, 0.5, 2.0] and framed.timeout.tolist() == [9.0, 6.0, 9.0]
    there = Sequence(np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([0.5, 0.0]), np.array([6.0, 6.0]))
    framed = with_rest(there, rest=2.0, timeout=9.0)
    assert framed.target.tolist() == [[1, 1], [0, 1], [1, 1]] and framed.hold.tolist() == [2.5, 0.0, 2.0]
    assert with_rest(short, rest=0.0, timeout=9.0) is short
