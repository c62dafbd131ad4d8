"""Many policies at once do what the engine's closed loop does with each of them alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

from r2s2r_cli.effects.cap_radius import CapRadius
from r2s2r_cli.engine import end_caps, settle
from r2s2r_cli.engine.closed_loop import closed_loop
from r2s2r_cli.engine.flat import pack_state, unpack_state
from r2s2r_cli.engine.link import Link
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.identify.free.mapping import Mapping
from r2s2r_cli.stages.plan.belief import Belief, assumed
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.robust import start_poses
from r2s2r_cli.stages.plan.standing import Standing
from tests.support.robots import rested, subject


def executor(belief: Belief, draws: np.ndarray, timeout_s: float = 6.0) -> Executor:
    """The paper's robot with drawn numbers."""
    made = Executor(subject().robot, belief, draws, step=1e-3, timeout_s=timeout_s)
    made.simulator = subject().simulator if made.structure == subject().structure else made.simulator
    return made


def test_a_batch_does_what_the_closed_loop_does_one_by_one() -> None:
    """Policies of two targets with numbers and a delay of their own: same states at the ends of both targets, same
    ticks, same targets given up, as the engine's closed loop gives them alone, to rounding."""
    robot = subject().robot
    frees = tuple(entries(robot)[name].free for name in ("motor_speed", "friction", "command_delay"))
    values = np.array([frees[0].start, frees[1].start, 0.03])
    belief = Belief(Identified("a test", robot, Mapping(robot, frees), values, np.diag([1e-2, 1e-2, 1e-3]) ** 2), True)
    draws = belief.draws(3, np.random.default_rng(1))
    assert len(set(draws[:, 0])) == 3 and np.array_equal(draws[0], values)
    made = executor(belief, draws, timeout_s=1.3)
    at = made.standing(np.repeat(subject().p_WE.numpy(), 3, axis=0), np.arange(3))
    targets = np.array([[[1, 0, 1, 1, 0, 1], [1, 1, 1, 1, 1, 1]], [[0, 0, 0, 0, 0, 0], [1, 1, 0, 1, 1, 1]],
                        [[1, 1, 1, 1, 1, 0.5], [0, 1, 1, 1, 1, 1]]], dtype=float)  # fmt: skip
    run = made.run(at, targets)
    for k in range(3):
        theta, _, pid = made.numbers(torch.tensor([k]))
        one = closed_loop(
            made.simulator, theta, unpack_state(made.structure, at.s[k : k + 1]), pid,
            torch.as_tensor(targets[k]), torch.zeros(2, dtype=torch.float64),
            torch.full((2,), 1.3, dtype=torch.float64), link=Link(delay=made.delay[k : k + 1, None]),
        )  # fmt: skip
        assert run.given_up[k].tolist() == one.timed_out[0].tolist()
        index = one.index[0].numpy()
        for step in range(2):
            last = int(np.flatnonzero(index == step)[-1]) + 1
            assert run.ticks[k, step] == last
            flat = pack_state(made.structure, one.trajectory.at(last))
            assert float((flat - run.ends[step].s[k]).abs().max()) < 1e-9
    assert run.given_up.any() and not run.given_up.all() and not run.failed.any()


def test_two_targets_are_one_after_the_other() -> None:
    """A run of two targets is a run of the first, and one of the second from where that ended."""
    belief = assumed(subject().robot)
    made = executor(belief, belief.draws(1, np.random.default_rng(0)))
    at = made.standing(np.repeat(subject().p_WE.numpy(), 2, axis=0), np.zeros(2, dtype=int))
    targets = np.array(
        [[[1, 0, 1, 1, 0, 1], [1, 1, 1, 1, 1, 1]], [[0, 1, 1, 1, 1, 0], [0, 0, 1, 1, 1, 0]]], dtype=float
    )
    whole = made.run(at, targets)
    half = made.run(at, targets[:, :1])
    rest = made.run(half.ends[0], targets[:, 1:])
    assert torch.equal(whole.ends[1].s, rest.ends[0].s)
    assert (whole.ticks[:, 1] == half.ticks[:, 0] + rest.ticks[:, 0]).all()
    assert whole.sound.all()
    # One target less for the second robot: it stops there, and the first goes on as before.
    fewer = made.run(at, targets, np.array([2, 1]), record=True)
    assert torch.equal(fewer.last.s, torch.stack([whole.ends[1].s[0], whole.ends[0].s[1]]))
    assert fewer.total.tolist() == [whole.ticks[0, 1], whole.ticks[1, 0]]
    assert torch.equal(fewer.before_last(0).s, torch.stack([track.s[-1] for track in fewer.tracks]))
    assert [len(track.u) for track in fewer.tracks] == fewer.total.tolist()
    assert fewer.tracks[0].index.tolist() == [0] * whole.ticks[0, 0] + [1] * (fewer.total[0] - whole.ticks[0, 0])


def test_a_sensor_that_reads_too_much_leaves_its_cable_shorter() -> None:
    """A bias of the lengths shifts where the controller stops: the cable that is reeled in ends shorter by it, to what
    it moves in a tick."""
    belief = assumed(subject().robot)
    draws = np.repeat(belief.draws(1, np.random.default_rng(0)), 2, axis=0)
    bias = np.zeros((2, 9))
    bias[1, 1] = 0.02
    made = Executor(subject().robot, belief, draws, step=1e-3, bias=bias)
    made.simulator = subject().simulator
    at = made.standing(np.repeat(subject().p_WE.numpy(), 2, axis=0), np.arange(2))
    target = np.repeat(np.array([[[1.0, 0.4, 1, 1, 1, 1]]]), 2, axis=0)
    p_WE = made.caps(made.run(at, target).last)
    a, b = subject().cable_caps[1]
    length = np.linalg.norm(p_WE[:, a] - p_WE[:, b], axis=-1)
    assert abs(length[0] - length[1] - 0.02) < 0.003


def test_a_sensor_that_drifts_reads_too_much_by_the_time_of_the_run() -> None:
    """A robot that has run for 40 s with a drift of 0.5 mm/s of one sensor does what one does whose sensor reads 20 mm
    too much and more by as much a second; the time goes on from target to target."""
    robot = subject().robot
    cable = robot.sensors[1].cable
    known = entries(robot)
    frees = tuple(known[f"sensor_bias.drift_m_per_s.{k}"].free for k in range(len(robot.cables)))
    one = np.array([5e-4 if k == cable else 0.0 for k in range(len(frees))])
    belief = Belief(Identified("a test", robot, Mapping(robot, frees), one, np.zeros((len(one), len(one)))), True)
    bias = np.zeros((2, len(robot.cables)))
    bias[1, cable] = 0.02
    made = Executor(robot, belief, np.tile(one, (2, 1)), step=1e-3, bias=bias)
    at = made.standing(np.repeat(subject().p_WE.numpy(), 2, axis=0), np.arange(2))
    at = replace(at, s=at.s[:1].repeat(2, 1), t=torch.tensor([40.0, 0.0], dtype=torch.float64))
    target = np.repeat(np.array([[[1.0, 0.4, 1, 1, 1, 1], [1.0, 0.8, 1, 1, 1, 1]]]), 2, axis=0)
    run = made.run(at, target)
    assert torch.equal(run.last.s[0], run.last.s[1])
    assert run.last.t.numpy() == pytest.approx(np.array([40.0, 0.0]) + run.total * made.period)
    still = made.run(replace(at, t=torch.zeros(2, dtype=torch.float64)), target)
    assert float((still.last.s[0] - run.last.s[0]).abs().max()) > 1e-3


def test_caps_and_readings_are_those_of_the_numbers_that_effects_make(monkeypatch: pytest.MonkeyPatch) -> None:
    """With an effect that makes rods a tenth longer for every unit of its number, caps lie where the longer rods have
    them, and the controller's numbers are theirs."""
    monkeypatch.setattr(
        CapRadius,
        "parameters",
        lambda self, x, theta: replace(theta, p_BE=theta.p_BE * (1 + 100.0 * x["change_m"].mean())),
    )
    robot = subject().robot
    free = entries(robot)["cap_radius.change_m"].free
    model = Identified("a test", robot, Mapping(robot, (free,)), np.array([1e-3]), np.zeros((1, 1)))
    made = Executor(robot, Belief(model, True), np.array([[1e-3]]), step=1e-3)
    s = pack_state(subject().structure, rested().state)
    zero = torch.zeros(1, dtype=torch.long)
    at = Standing(s, s.new_zeros(1, 2, made.structure.n_actuated), zero, s.new_zeros(1))
    middle = made.caps(at).reshape(1, -1, 2, 3).mean(axis=2, keepdims=True)
    there = end_caps(subject().theta, rested().state).numpy().reshape(1, -1, 2, 3)
    assert made.caps(at).reshape(there.shape) == pytest.approx(middle + 1.1 * (there - middle), abs=1e-12)
    assert torch.equal(made.numbers(zero)[0].p_BE, made.seen.p_BE) and not torch.equal(made.seen.p_BE, made.theta.p_BE)


def test_a_robot_starts_where_its_sensors_say_that_it_is_at_rest() -> None:
    """A sensor that reads 8 mm too much: its winch stops 8 mm early, before the gait as in it; the first robot stands
    as robot.toml says whatever its sensors read."""
    robot = subject().robot
    robot = robot.model_copy(update={"pid": robot.pid.model_copy(update={"tolerance": 1e-9})})
    belief = assumed(robot)
    bias = np.zeros((2, len(robot.cables)))
    bias[:, robot.actuated[1]] = 8e-3
    made = Executor(robot, belief, np.tile(belief.model.values, (2, 1)), step=1e-3, bias=bias)
    made.simulator = subject().simulator
    caps = made.caps(start_poses(made, robot, 1, np.random.default_rng(0)))
    ends = np.array([robot.cables[k].caps for k in robot.actuated])
    length = np.linalg.norm(caps[:, ends[:, 0]] - caps[:, ends[:, 1]], axis=-1)
    short = 1e3 * (length[0] - length[1])
    assert short[1] == pytest.approx(8.0, abs=1.0)
    assert np.abs(np.delete(short, 1)).max() < 2.5


def test_a_draw_that_does_not_come_to_rest_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others stand as they would without it; where the best numbers are restless nothing can be planned."""
    belief = assumed(subject().robot)
    made = executor(belief, belief.draws(3, np.random.default_rng(1)))
    poses, draws = np.repeat(subject().p_WE.numpy(), 3, axis=0), np.arange(3)
    whole, found = made.standing(poses, draws), settle.settled

    def restless(row: int, speed: float) -> None:
        def one_moves(*given: Any, **named: Any) -> Any:
            at = found(*given, **named)
            moving = at.speed.clone()
            moving[row] = speed
            return replace(at, speed=moving)

        monkeypatch.setattr(settle, "settled", one_moves)

    for speed in (0.5, float("nan")):
        restless(1, speed)
        left = made.standing(poses, draws)
        assert left.draw.tolist() == [0, 2]
        np.testing.assert_array_equal(left.s.numpy(), whole.s[[0, 2]].numpy())
    restless(0, 0.5)
    with pytest.raises(NumericalError, match="does not come to rest"):
        made.standing(poses, draws)
