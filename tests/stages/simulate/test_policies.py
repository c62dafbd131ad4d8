"""Policies to simulate: written out, random, and from what artifacts hold."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.stages.simulate.policies import policy_group, policy_names, random_policy, sequence, stored_policies
from schemas.policy import PolicyFile
from tests.support import builders

CRAWL = PolicyFile.model_validate(
    {"schema_version": 1, "robot": "threebar", "name": "crawl", "description": "two shapes", "repeat": 3,
     "steps": [{"target": (1.0, 0.1, 1.0, 0.0, 0.0, 0.0), "hold_s": 0.5},
               {"target": (1.0, 1.0, 0.1, 0.0, 0.0, 0.0), "timeout_s": 2.0}]}
)  # fmt: skip


def test_repeats_are_written_out_with_the_robots_timeout() -> None:
    """Three times two shapes are six targets in order; a step without a timeout has that of the robot."""
    found = sequence(CRAWL, builders.robot())
    assert found.target[:, 1].tolist() == [0.1, 1.0] * 3
    assert found.hold.tolist() == [0.5, 0.0] * 3
    assert found.timeout.tolist() == [builders.robot().pid.step_timeout_s, 2.0] * 3


@pytest.mark.parametrize("change", [{"robot": "sixbar"}, {"steps": ({"target": (1.0, 0.0)},)}])
def test_a_policy_of_another_robot_is_refused(change: dict[str, object]) -> None:
    """Another robot's name, and another number of cables."""
    policy = PolicyFile.model_validate({**CRAWL.model_dump(), **change})
    with pytest.raises(InputError, match="another robot"):
        sequence(policy, builders.robot())


def test_random_shapes_are_binary_and_each_a_new_one() -> None:
    """No shape is the one before it, the first not the rest shape; both ends occur for every cable."""
    target = np.array([step.target for step in random_policy(builders.robot(), 200, 5).steps])
    assert set(target.flatten()) == {0.0, 1.0}
    assert (np.diff(target, axis=0, prepend=np.ones((1, 6))) != 0).any(axis=1).all()
    assert (target.mean(axis=0) > 0.3).all() and (target.mean(axis=0) < 0.7).all()


def test_the_seed_decides_a_random_policy() -> None:
    """The same seed gives the same policy, another one another; longer ones begin alike."""
    robot = builders.robot()
    assert random_policy(robot, 8, 1) == random_policy(robot, 8, 1)
    assert random_policy(robot, 8, 1).steps != random_policy(robot, 8, 2).steps
    assert random_policy(robot, 12, 1).steps[:8] == random_policy(robot, 8, 1).steps


@pytest.mark.parametrize("steps", [0, -1, 10_001])
def test_a_random_policy_has_a_sensible_length(steps: int) -> None:
    """None, or more than anyone would wait for, is refused."""
    with pytest.raises(UsageError, match="random policy"):
        random_policy(builders.robot(), steps, 0)


def test_a_policy_survives_an_artifact() -> None:
    """Written as a group and read back it is the same policy, own timeouts and those of the robot included."""
    data = ArtifactData("policy", {"policies/crawl": policy_group(CRAWL)})
    assert stored_policies(data) == {"crawl": CRAWL}


def test_a_run_without_a_policy_gives_the_targets_it_had() -> None:
    """What was recorded without a policy is run by the targets of its intervals."""
    data = builders.recording(images=False)
    assert list(stored_policies(data)) == ["walk"]
    assert stored_policies(data)["walk"].description == "rest, then a step"
    bare = ArtifactData("recording", {k: g for k, g in data.groups.items() if not k.endswith("policy")})
    found = stored_policies(bare)["walk"]
    assert [step.target for step in found.steps] == [tuple(t) for t in data.groups["runs/walk/intervals"]["target"]]
    assert stored_policies(ArtifactData("recording", {"runs/walk": Group()})) == {}


def _with_targets(value: float) -> ArtifactData:
    """A run `walk` without a policy whose first target is `value`, and a sound run `other`."""
    data = builders.recording(images=False)
    intervals = data.groups["runs/walk/intervals"]
    target = intervals["target"].copy()
    target[0] = value
    groups = {key: group for key, group in data.groups.items() if not key.endswith("policy")}
    other = {key.replace("walk", "other", 1): group for key, group in groups.items()}
    bad = Group({**intervals.datasets, "target": target}, intervals.attributes)
    return ArtifactData("recording", {**groups, "runs/walk/intervals": bad, **other})


@pytest.mark.parametrize(("value", "meant"), [(1 + 5e-7, 1.0), (-5e-7, 0.0)])
def test_targets_of_a_log_may_be_rounded(value: float, meant: float) -> None:
    """What `import` takes for 0 or 1 is one here as well."""
    assert stored_policies(_with_targets(value))["walk"].steps[0].target == (meant,) * 6


def test_targets_that_no_cable_can_have_are_refused_where_they_are_asked_for() -> None:
    """The run is named, and the other runs of the recording are policies all the same."""
    data = _with_targets(1.2)
    assert policy_names(data) == ["walk", "other"]
    assert list(stored_policies(data, ["other"])) == ["other"]
    with pytest.raises(InputError, match="run walk") as caught:
        stored_policies(data)
    assert caught.value.received == "1.2"
