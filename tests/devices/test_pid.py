"""The controller on the wire is the controller of the engine: the same commands on the same lengths."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from r2s2r_cli.devices.pid import WirePid, WireSteps, ticks
from r2s2r_cli.engine import LatchedPid
from r2s2r_cli.engine.pid import advance, start_progress
from schemas.robot import Robot
from tests.support.wire_robot import calibrated


def in_the_engine(robot: Robot) -> LatchedPid:
    """The controller of a robot as the simulator has it."""
    pid = robot.pid
    return LatchedPid(
        p=pid.p, i=pid.i, d=pid.d, tolerance=pid.tolerance, min_length=pid.min_length_m, range=pid.range_m,
        period=1 / pid.rate_hz, cable_caps=tuple((c.caps[0], c.caps[1]) for c in robot.cables), actuated=robot.actuated,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["threebar", "threebar-330"])
def test_both_controllers_give_the_same_commands_and_steps(name: str) -> None:
    """A policy of 20 targets of cables that follow their commands, with noise, holds and time-outs.

    Every command, every `done` and every change of target must be equal to the bit; arrivals, time-outs and targets of
    0 below which a cable is done must all have happened.
    """
    robot = calibrated(name)
    draw = np.random.default_rng(11)
    targets = draw.choice([0.0, 0.3, 1.0], (20, 6))
    hold, limit = draw.integers(0, 4, 20), draw.integers(20, 120, 20)
    mine, steps = WirePid.of(robot), WireSteps(hold, limit)
    engine = in_the_engine(robot)
    progress = start_progress(1)
    length = np.full(9, robot.pid.min_length_m + robot.pid.range_m)
    memory = engine.start(torch.from_numpy(length)[None])
    seen = {"arrived": 0, "timed out": 0, "below 0": 0}
    for _ in range(2000):
        measured = length + draw.normal(0, 5e-4, 9)
        assert steps.index == int(progress.index[0])
        if steps.finished:
            break
        target = targets[steps.index]
        u = mine.tick(measured[:6], target)
        tensor = torch.from_numpy(measured)[None]
        v, memory = engine.tick(memory, tensor, progress.target(torch.from_numpy(targets)))
        np.testing.assert_array_equal(u, v[0].numpy())
        np.testing.assert_array_equal(mine.done, memory.done[0].numpy())
        seen["below 0"] += bool(((target == 0) & (mine.position(measured[:6]) < 0)).any())
        changed, timed_out = steps.advance(mine.done)
        progress, what = advance(progress, memory.done, torch.from_numpy(hold), torch.from_numpy(limit))
        assert (changed, timed_out) == (bool(what.changed[0]), bool(what.timed_out[0]))
        seen["arrived"] += changed and not timed_out
        seen["timed out"] += timed_out
        if changed:
            mine.restart()
            memory = memory.restarted(what.changed)
            # Somebody pushes a cable: shorter than position 0 by more than the tolerance.
            length[draw.integers(6)] = robot.pid.min_length_m - 0.02
        length[:6] -= u * 1.1e-3 * np.array([1, 1, 1, 0.9, 0.4, 1])
    assert steps.finished and all(seen.values()), seen


def test_ticks_are_those_of_the_engine() -> None:
    """Seconds in whole ticks, rounded up, rounding of the quotient forgiven; no negative times."""
    from r2s2r_cli.engine.pid import ticks as of_the_engine

    seconds = np.array([0.0, 0.02, 0.06, 0.061, 6.0])
    np.testing.assert_array_equal(ticks(seconds, 0.02), of_the_engine(torch.from_numpy(seconds), 0.02).numpy())
    np.testing.assert_array_equal(ticks(seconds, 0.02), [0, 1, 3, 4, 300])
    for bad in (np.array([-1.0]), np.array([np.inf])):
        with pytest.raises(ValueError, match="no times"):
            ticks(bad, 0.02)


def test_a_lost_reading_moves_nothing_and_latches_nothing() -> None:
    """A NaN gives command 0 and leaves the memory as it was; the next reading goes on from there."""
    pid = WirePid.of(calibrated())
    near, far = pid.min_length, pid.min_length + pid.range
    length = np.full(6, far)
    target = np.zeros(6)
    pid.tick(length, target)
    total, previous = pid.total.copy(), pid.previous.copy()
    gone = np.where(np.arange(6) == 2, np.nan, near - 1e-3)
    u = pid.tick(gone, target)
    assert u[2] == 0 and not pid.done[2] and pid.done[[0, 1, 3, 4, 5]].all()
    assert pid.total[2] == total[2] and pid.previous[2] == previous[2]
    assert pid.tick(length, target)[2] == 1
