"""Recorded commands as the simulator takes them."""

from __future__ import annotations

import shlex

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.simulate.replay import recorded_commands
from tests.support import builders


def with_commands(**changes: np.ndarray) -> ArtifactData:
    """The recording of the builders with other command datasets; None drops one."""
    data = builders.estimate()
    datasets = {**data.groups["runs/walk/commands"].datasets, **changes}
    commands = Group({k: v for k, v in datasets.items() if v is not None})
    return ArtifactData("estimate", {**data.groups, "runs/walk/commands": commands})


def test_a_command_holds_until_the_next() -> None:
    """Zero-order hold on the clock of the recording; before the first command no target, and motors off."""
    t = np.array([0.5, 1.0, 2.0])
    control = np.array([[1.0] * 6, [-1.0] * 6, [0.25] * 6])
    replay = recorded_commands(with_commands(t=t, control=control, target=np.ones((3, 6)), done=None), "walk", 6)
    target, found = replay.at(np.array([0.0, 0.4999, 0.5, 0.99, 1.0, 1.7, 5.0]))
    assert found[:, 0].tolist() == [0, 0, 1, 1, -1, -1, 0.25]
    assert np.isnan(target[:2]).all() and (target[2:] == 1).all()


def test_a_replay_lasts_from_the_first_to_the_last_frame() -> None:
    """An estimate is replayed over its frames, a recording without frames over its commands."""
    data = builders.estimate()
    t = data.groups["runs/walk/frames"]["t"]
    replay = recorded_commands(data, "walk", 6)
    assert (replay.t_first, replay.t_last) == (t[0], t[-1])
    bare = ArtifactData("estimate", {k: g for k, g in data.groups.items() if not k.endswith("frames")})
    again = recorded_commands(bare, "walk", 6)
    assert (again.t_first, again.t_last) == tuple(data.groups["runs/walk/commands"]["t"][[0, -1]])
    assert len(replay.group()["t"]) == len(t)


def test_what_was_not_logged_is_counted_and_off() -> None:
    """NaN rows are replayed as 0 and counted; commands beyond the limits are limited."""
    control = np.full((24, 6), 1.5)
    control[3, 2] = control[7, :] = np.nan
    replay = recorded_commands(with_commands(control=control), "walk", 6)
    assert replay.missing == 2
    assert replay.control[7].tolist() == [0.0] * 6
    assert replay.control.max() == 1


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"control": None}, "targets only"),
        ({"control": np.full((24, 6), np.nan)}, "targets only"),
        ({"control": np.ones((24, 4))}, "4"),
    ],
)
def test_a_run_that_cannot_be_replayed_is_refused(changes: dict[str, np.ndarray], expected: str) -> None:
    """No commands, none that was logged, and those of another robot."""
    with pytest.raises(InputError) as caught:
        recorded_commands(with_commands(**changes), "walk", 6)
    assert caught.value.received == expected


def test_a_run_without_commands_is_refused() -> None:
    """A camera recording has nothing to replay."""
    data = builders.estimate()
    bare = ArtifactData("estimate", {k: g for k, g in data.groups.items() if not k.endswith("commands")})
    with pytest.raises(InputError, match="no motor commands") as caught:
        recorded_commands(bare, "walk", 6, source="it/20-estimate.h5")
    assert caught.value.hint == "r2s2r inspect it/20-estimate.h5"


def test_a_log_without_motor_commands_is_simulated_by_its_targets_instead() -> None:
    """The hint names the artifact where it lies: pasted, it finds it, whatever is in its name."""
    with pytest.raises(InputError) as caught:
        recorded_commands(with_commands(control=None), "walk", 6, source="a b/10-record.h5")
    assert shlex.split(caught.value.hint, comments=True) == ["r2s2r", "simulate", "a b/10-record.h5:walk"]
