"""A policy executed with the robot's controller inside the simulation."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import lru_cache

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    ClosedLoopRun,
    Detach,
    EngineInputError,
    LatchedPid,
    Parameters,
    State,
    Structure,
    cap_lengths,
    closed_loop,
    end_caps,
)
from tests.support.engine import parameters, simulator, state, vector
from tests.support.robots import rested, subject

PERIOD = 0.02
SHAPES = torch.tensor([[0.1, 1.0, 0.0, 0.3, 1.0, 0.5], [1.0, 0.6, 1.0, 1.0, 0.2, 1.0]], dtype=torch.float64)
HOLDS, TIMEOUTS = (torch.tensor(x, dtype=torch.float64) for x in ([0.1, 0.0], [4.0, 4.0]))


@lru_cache
def policy() -> ClosedLoopRun:
    """Two shapes on the three-bar robot."""
    robot = subject()
    with torch.no_grad():
        return closed_loop(robot.simulator, robot.theta, rested().state, robot.pid(), SHAPES, HOLDS, TIMEOUTS)


def at(run: ClosedLoopRun, shape: int) -> Tensor:
    """Ticks at which a shape was commanded."""
    return (run.index[0] == shape).nonzero()[:, 0]


def test_every_target_is_reached_within_the_tolerance() -> None:
    """At the tick a cable is done its position is within 0.1 of the target or short of 0; no shape times out."""
    robot, run = subject(), policy()
    pid = robot.pid()
    assert not run.timed_out.any()
    for shape, target in enumerate(SHAPES):
        ticks = at(run, shape)
        assert run.done[0, ticks[-1]].all()
        for cable in range(6):
            first = int(ticks[run.done[0, ticks, cable].nonzero()[0, 0]])
            error = float(pid.position(run.length[:, first])[0, cable] - target[cable])
            assert abs(error) < float(pid.tolerance)


def test_done_is_latched_and_stops_the_motor() -> None:
    """Within a shape done never goes back, and a done motor has command 0; a running one is commanded."""
    run = policy()
    for shape in range(2):
        done = run.done[0, at(run, shape)].int()
        assert (done.diff(dim=0) >= 0).all()
    assert not run.u[run.done].any()
    assert run.u[~run.done].abs().min() > 0


def test_the_hold_is_waited_for() -> None:
    """Five ticks of hold follow the tick in which the last cable of the first shape is done, none after the second."""
    run = policy()
    for shape, ticks in ((0, 6), (1, 1)):
        assert int(run.done[0, at(run, shape)].all(dim=1).sum()) == ticks
    assert int(run.ticks[0]) == run.u.shape[1]
    assert float(run.duration(PERIOD)[0]) == pytest.approx(run.u.shape[1] * PERIOD)


def test_a_target_out_of_reach_times_out() -> None:
    """A cable no winch can make so long is given up after its time, and the next target follows."""
    robot = subject()
    targets = torch.stack([torch.full((6,), 9.0, dtype=torch.float64), SHAPES[1]])
    run = closed_loop(robot.simulator, robot.theta, rested().state, robot.pid(), targets, torch.zeros(2),
                      torch.tensor([0.3, 4.0], dtype=torch.float64))  # fmt: skip
    assert run.timed_out.tolist() == [[True, False]]
    assert len(at(run, 0)) == 15


def test_replaying_its_commands_gives_the_run() -> None:
    """The commands it made, one a tick, through command replay: bit for bit the same states."""
    robot, run = subject(), policy()
    replay = robot.simulator.rollout(robot.theta, rested().state, run.u, hold=20, every=20)
    for name in ("p_WB", "q_WR", "v_WB", "w_R", "rest", "winding"):
        assert torch.equal(getattr(replay.states, name), getattr(run.trajectory.states, name))
    torch.testing.assert_close(replay.t, run.trajectory.t)


def test_lengths_are_those_of_the_frames() -> None:
    """What the controller read at a tick is the cap distance of that frame."""
    robot, run = subject(), policy()
    expected = cap_lengths(robot.cable_caps, run.trajectory.end_caps()[0, :-1])
    torch.testing.assert_close(run.length[0], expected, rtol=0, atol=1e-12)


def test_a_batch_is_what_each_gives_alone() -> None:
    """Motors of different speed reach their targets at different times; the fast robot waits, and meanwhile is the run
    it had alone. Batch lanes round differently, by less than 1e-8 over the run."""
    robot = subject()
    speed = torch.tensor([[1.0], [0.6]], dtype=torch.float64)
    theta = robot.theta.map(lambda x: x.expand(2, *x.shape[1:]))
    theta = replace(theta, speed_in=theta.speed_in * speed, speed_out=theta.speed_out * speed)
    one = SHAPES[1:] * 0.5 + 0.4
    how = (one, torch.zeros(1), torch.tensor([4.0]))
    both = closed_loop(robot.simulator, theta, rested().state, robot.pid(), *how)
    assert int(both.ticks[0]) < int(both.ticks[1])
    for k in range(2):
        own = Parameters(**{name: x[k : k + 1] for name, x in vars(theta).items() if name != "extra"})
        alone = closed_loop(robot.simulator, own, rested().state, robot.pid(), *how)
        n = int(alone.ticks[0])
        assert int(both.ticks[k]) == n
        assert torch.equal(both.done[k, :n], alone.done[0])
        torch.testing.assert_close(both.u[k, :n], alone.u[0], rtol=0, atol=1e-6)
        torch.testing.assert_close(both.trajectory.states.p_WB[k, : n + 1], alone.trajectory.states.p_WB[0],
                                   rtol=0, atol=1e-8)  # fmt: skip
    assert not both.u[0, int(both.ticks[0]) :].any()


def test_the_tail_lets_the_robot_swing_out() -> None:
    """0.1 s after the last target: five ticks more, without commands; progress counts the targets that are through."""
    robot = subject()
    how = (SHAPES[1:], torch.zeros(1), torch.tensor([4.0]))
    through: list[int] = []
    plain = closed_loop(robot.simulator, robot.theta, rested().state, robot.pid(), *how)
    longer = closed_loop(robot.simulator, robot.theta, rested().state, robot.pid(), *how, tail=0.1,
                         progress=through.append)  # fmt: skip
    assert longer.u.shape[1] == plain.u.shape[1] + 5
    assert torch.equal(longer.ticks, plain.ticks)
    assert not longer.u[:, -5:].any()
    n = int(longer.ticks[0])
    assert through == [0] * (n - 1) + [1] * 6


def hanging(**numbers: float | Tensor) -> tuple[Structure, Parameters, State, LatchedPid]:
    """Two free rods that a winched cable pulls together: smooth, without ground."""
    structure = Structure(n_rods=2, cable_rods=((0, 1),), actuated=(0,), rod_contact=False)
    theta = parameters(structure, **{"gravity": torch.zeros(3), "stiffness": 500.0, "rest_min": 0.01, **numbers})
    p = torch.stack([vector(0.0, 0.0, 2.0), vector(0.4, 0.0, 2.0)])
    start = state(structure, p, axis=vector(0.0, 0.0, 1.0), rest=torch.tensor([0.4]))
    pid = LatchedPid(p=2.0, i=0.01, d=0.5, tolerance=0.02, min_length=0.1, range=0.4, period=PERIOD,
                     cable_caps=((0, 2),), actuated=(0,))  # fmt: skip
    return structure, theta, start, pid


def test_the_gradient_by_the_motor_speed() -> None:
    """d (last cap distance) / d (speed) through plant and controller, against central differences between which the
    decisions stay the same."""
    structure, theta, start, pid = hanging()
    sim = simulator(structure)

    def reached(speed: Tensor) -> tuple[Tensor, Tensor]:
        own = replace(theta, speed_in=speed.reshape(1, 1))
        run = closed_loop(sim, own, start, pid, torch.tensor([[0.2]]), torch.zeros(1), torch.tensor([1.0]), tail=0.02)
        return cap_lengths(pid.cable_caps, end_caps(own, run.trajectory.at(-1)))[0, 0], run.done

    speed = torch.tensor(0.3, dtype=torch.float64, requires_grad=True)
    length, done = reached(speed)
    (slope,) = torch.autograd.grad(length, speed)
    with torch.no_grad():
        (up, done_up), (down, done_down) = reached(speed + 1e-6), reached(speed - 1e-6)
    assert torch.equal(done, done_up)
    assert torch.equal(done, done_down)
    assert done.any()
    assert abs(float(slope)) > 0.01
    assert float(slope) == pytest.approx(float((up - down) / 2e-6), rel=1e-5)


def test_the_gradient_by_a_gain() -> None:
    """The proportional gain reaches the motion through the commands while they are not saturated."""
    structure, theta, start, pid = hanging()
    sim = simulator(structure)

    def reached(p: Tensor) -> Tensor:
        run = closed_loop(sim, theta, start, replace(pid, p=p), torch.tensor([[0.5]]), torch.zeros(1),
                          torch.tensor([0.2]))  # fmt: skip
        return cap_lengths(pid.cable_caps, end_caps(theta, run.trajectory.at(-1)))[0, 0]

    gain = torch.tensor(1.2, dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(reached(gain), gain)
    with torch.no_grad():
        difference = (reached(gain + 1e-5) - reached(gain - 1e-5)) / 2e-5
    assert float(slope) == pytest.approx(float(difference), rel=1e-5)
    assert abs(float(slope)) > 1e-4


@pytest.mark.parametrize(
    ("targets", "holds", "timeouts", "step", "field"),
    [
        (torch.zeros(1, 5), torch.zeros(1), torch.ones(1), 1e-3, "targets"),
        (torch.zeros(0, 6), torch.zeros(0), torch.ones(0), 1e-3, "targets"),
        (torch.zeros(1, 6), -torch.ones(1), torch.ones(1), 1e-3, "holds, timeouts"),
        (torch.zeros(1, 6), torch.zeros(1), torch.ones(1), 3e-3, "step"),
    ],
)
def test_bad_policies_are_named(targets: Tensor, holds: Tensor, timeouts: Tensor, step: float, field: str) -> None:
    """Targets of another robot, or none; times that are none, and steps that do not fit the period."""
    robot = subject()
    with pytest.raises(EngineInputError) as caught:
        closed_loop(robot.simulator, robot.theta, rested().state, robot.pid(), targets.to(torch.float64), holds,
                    timeouts, step=step)  # fmt: skip
    assert caught.value.field == field


@pytest.mark.parametrize(("seconds", "warned"), [(0.4, False), (0.6, True)])
def test_detached_impulses_warn_beyond_half_a_second(seconds: float, warned: bool) -> None:
    """The tangent without contact impulses grows without bound: said for command replay longer than 0.5 s."""
    structure, theta, start, _ = hanging()
    sim = simulator(replace(structure, detach=Detach.IMPULSE))
    u = torch.zeros(1, 1, 1, dtype=torch.float64)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sim.rollout(theta, start, u, hold=round(seconds * 1e3), every=round(seconds * 1e3))
    assert any("impulse" in str(w.message) for w in caught) is warned
