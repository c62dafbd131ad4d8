"""States to start from: settled at rest from observed caps."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    EngineInputError,
    NonFiniteError,
    Settled,
    balance,
    cap_lengths,
    end_caps,
    read,
    settled,
)
from r2s2r_cli.engine.roll import roll_relaxed
from r2s2r_cli.stages.init.attachment import Mode
from tests.support.engine import RADIUS, free_rods, lowest_gap, parameters, roll_between, simulator
from tests.support.robots import Subject, frames, noise, rested, subject

CRAWL = Path("tribar_crawl") / "crawl.csv"


def rolled(R_WR: Tensor, angle: list[float]) -> Tensor:
    """Frames turned about their own z axes."""
    turn = torch.zeros(len(angle), 3, dtype=torch.float64)
    turn[:, 2] = torch.tensor(angle, dtype=torch.float64)
    return R_WR @ roma.rotvec_to_rotmat(turn)


def assert_at_rest(robot: Subject, found: Settled, *, drift: float = 1e-4) -> None:
    """Everything that a settled state promises."""
    reading = read(robot.structure, robot.theta, found.state)
    assert float(found.speed.max()) < 1e-5
    assert not found.state.v_WB.any()
    assert not found.state.w_R.any()
    assert float(lowest_gap(robot.theta, found.state).abs().max()) < 1e-6
    assert float((reading.ground[..., 2].sum(1) / robot.weight - 1).abs().max()) < 1e-3
    assert float(reading.ground[..., :2].sum(1).abs().max()) < 1e-3 * robot.weight
    assert float(reading.tension.min()) >= 0
    assert torch.allclose(reading.tension, found.tension)
    assert float(balance(robot.structure, robot.theta, found.state).unbalanced.max()) < 0.03
    assert robot.drift(found.state, 10.0) < drift


def test_rests_where_it_was_seen() -> None:
    """From the ideal rest pose: static, carried by the ground, every cable taut, at the observed cable lengths."""
    robot, found = subject(), rested()
    assert_at_rest(robot, found)
    assert float(found.tension.min()) > 1
    wrong = (robot.lengths(found.state) - cap_lengths(robot.cable_caps, robot.p_WE))[:, robot.winched]
    assert float(wrong.abs().max()) < 2e-6
    assert float(found.shift.max()) < 0.01


@pytest.mark.parametrize("height", [0.05, -0.004])
def test_comes_down_or_up_to_the_ground(height: float) -> None:
    """A robot seen above the ground, or in it, settles to the same state."""
    robot = subject()
    moved = robot.settle(robot.p_WE + torch.tensor([0.0, 0.0, height], dtype=torch.float64))
    torch.testing.assert_close(moved.state.p_WB, rested().state.p_WB, rtol=0, atol=1e-6)


def test_rests_from_noisy_caps() -> None:
    """Eight observations with 3 mm of noise, whose rods are too long or short, all come to rest; in one batch."""
    robot = subject()
    assert_at_rest(robot, robot.settle(noise(robot.p_WE, 0.003, batch=8, seed=0)))


def test_a_batch_is_what_each_gives_alone() -> None:
    """Environments do not wait in each other's way: all but the looks after their own end are the same."""
    robot = subject()
    seen = noise(robot.p_WE, 0.002, batch=3, seed=1)
    both = robot.settle(seen).state
    for k in range(3):
        alone = robot.settle(seen[k : k + 1]).state
        torch.testing.assert_close(both.p_WB[k : k + 1], alone.p_WB, rtol=0, atol=2e-5)


def test_observed_lengths_win_over_the_caps() -> None:
    """Sensors that say something else than the caps do: the winches turn until the sensors are right."""
    robot = subject()
    lengths = cap_lengths(robot.cable_caps, robot.p_WE).clone()
    lengths[:, robot.winched] += torch.tensor([4e-3, -6e-3, 3e-3, -5e-3, 2e-3, -3e-3], dtype=torch.float64)
    found = robot.settle(robot.p_WE, lengths=lengths)
    assert_at_rest(robot, found)
    assert float((robot.lengths(found.state) - lengths)[:, robot.winched].abs().max()) < 2e-6


def test_winches_stop_at_their_ends() -> None:
    """A length that no winch can give leaves it at its end, and the robot rests all the same."""
    robot = subject()
    lengths = cap_lengths(robot.cable_caps, robot.p_WE).clone()
    lengths[:, 0] += 0.4
    found = robot.settle(robot.p_WE, lengths=lengths)
    assert float(found.speed.max()) < 1e-5
    assert float(found.state.rest[0, 0]) == pytest.approx(float(robot.theta.rest_max[0, 0]))


def test_a_wrong_roll_is_turned_back() -> None:
    """Rolls planted 25 degrees off, each another way: the tensions turn the rods back to within a degree."""
    robot = subject()
    truth = rested().state
    R_WR = roma.unitquat_to_rotmat(truth.q_WR)
    wrong = replace(truth, q_WR=roma.rotmat_to_unitquat(rolled(R_WR, [0.44, -0.44, 0.35])))
    assert float(roll_between(truth, wrong).abs().min()) > 0.3
    right = roll_relaxed(robot.simulator, robot.theta, wrong)
    assert float(roll_between(truth, right).abs().max()) < 0.02
    torch.testing.assert_close(right.p_WB, truth.p_WB, rtol=0, atol=0)
    axis = roma.unitquat_to_rotmat(right.q_WR)[..., 2]
    torch.testing.assert_close(axis, R_WR[..., 2], rtol=0, atol=1e-6)


def test_a_wrong_roll_settles_as_the_right_one() -> None:
    """The whole way: the same caps with rolls 20 degrees off come to rest within 2 mm of where they should."""
    robot = subject()
    wrong = robot.settle(robot.p_WE, rolled(frames(robot.p_WE), [0.35, -0.35, 0.35]))
    assert_at_rest(robot, wrong)
    apart = end_caps(robot.theta, wrong.state) - end_caps(robot.theta, rested().state)
    assert float(torch.linalg.vector_norm(apart, dim=-1).max()) < 2e-3
    assert float(roll_between(rested().state, wrong.state).abs().max()) < 0.05


def test_turned_and_shifted_observations_give_the_turned_and_shifted_state() -> None:
    """Where on the ground and which way the robot is seen changes nothing else."""
    robot = subject()
    turn = roma.rotvec_to_rotmat(torch.tensor([0.0, 0.0, 2.1], dtype=torch.float64))
    by = torch.tensor([1.2, -0.7, 0.0], dtype=torch.float64)
    found = robot.settle(robot.p_WE @ turn.T + by)
    expected = end_caps(robot.theta, rested().state) @ turn.T + by
    torch.testing.assert_close(end_caps(robot.theta, found.state), expected, rtol=0, atol=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "attachment"), [("threebar-330", "surface"), ("sixbar", "surface"),
                                                  ("threebar", "rod_end")])  # fmt: skip
def test_other_robots_rest(name: str, attachment: Mode) -> None:
    """The long-rod robot, the example of six rods and cables at the rod ends settle as well."""
    robot = subject(name, attachment)
    assert_at_rest(robot, robot.settle(robot.p_WE))


def test_lies_on_the_observation() -> None:
    """Seen from above the settled caps have the observed centre, and no turn about it brings them nearer."""
    robot = subject()
    seen = noise(robot.p_WE, 0.004, batch=2, seed=3)
    found = robot.settle(seen)
    here, there = (p[..., :2] for p in (end_caps(robot.theta, found.state), seen))
    torch.testing.assert_close(here.mean(1), there.mean(1), rtol=0, atol=1e-12)
    here, there = here - here.mean(1, keepdim=True), there - there.mean(1, keepdim=True)

    def apart(angle: float) -> Tensor:
        turn = roma.rotvec_to_rotmat(torch.tensor([0.0, 0.0, angle], dtype=torch.float64))[:2, :2]
        return ((here @ turn.T - there) ** 2).sum((1, 2))

    for angle in (-1e-4, 1e-4, -0.01, 0.01):
        assert (apart(angle) > apart(0.0)).all()


def test_one_rod_without_cables_lies_down() -> None:
    """Nothing in settling needs cables or winches: a rod seen leaning by 9 degrees falls flat, and stays."""
    structure = free_rods()
    theta = parameters(structure)
    seen = torch.tensor([[[0.0, 0.0, 0.02], [0.316, 0.0, 0.07]]], dtype=torch.float64)
    found = settled(simulator(structure), theta, seen, frames(seen), ())
    assert float(found.speed) < 1e-5
    gap = end_caps(theta, found.state)[0, :, 2] - RADIUS
    assert float(gap.abs().max()) < 1e-5


def test_a_settled_state_has_no_derivative() -> None:
    """It is an observation: no graph grows through seconds of relaxation, whatever the parameters ask for."""
    robot = subject()
    theta = replace(robot.theta, friction=robot.theta.friction.clone().requires_grad_())
    found = settled(robot.simulator, theta, robot.p_WE, frames(robot.p_WE), robot.cable_caps)
    assert not found.state.p_WB.requires_grad
    assert torch.equal(found.state.p_WB, rested().state.p_WB)


def test_the_real_robot_rests(real_dir: Path) -> None:
    """The first observation of the real crawl settles within 2 cm of every cap, at the cable lengths seen."""
    robot = subject()
    with (real_dir / CRAWL).open() as lines:
        row = next(csv.DictReader(lines))
    p_WE = torch.tensor([[float(row[f"cap{cap}_{x}_m"]) for x in "xyz"] for cap in range(6)], dtype=torch.float64)[None]
    found = robot.settle(p_WE)
    assert_at_rest(robot, found)
    wrong = (robot.lengths(found.state) - cap_lengths(robot.cable_caps, p_WE))[:, robot.winched]
    assert float(wrong.abs().max()) < 2e-6
    assert float(found.shift.max()) < 0.02


@pytest.mark.parametrize(
    ("p_WE", "lengths", "field"),
    [
        (torch.zeros(1, 4, 3), None, "p_WE"),
        (torch.full((1, 6, 3), torch.nan), None, "p_WE.0.0"),
        (torch.zeros(1, 6, 3), None, "p_WE"),
        (None, torch.zeros(1, 3), "lengths"),
        (None, torch.full((1, 9), torch.inf), "lengths.0"),
    ],
)
def test_bad_observations_are_named(p_WE: Tensor | None, lengths: Tensor | None, field: str) -> None:
    """Wrong shapes, numbers that are none, and rods of no length are refused by name."""
    robot = subject()
    seen = robot.p_WE if p_WE is None else p_WE.to(torch.float64)
    with pytest.raises(EngineInputError) as caught:
        settled(robot.simulator, robot.theta, seen, frames(robot.p_WE), robot.cable_caps,
                lengths=None if lengths is None else lengths.to(torch.float64))  # fmt: skip
    assert caught.value.field == field


def test_a_start_that_flies_apart_is_said() -> None:
    """Where settling leaves the finite numbers the error names step and term, instead of an answer of NaN."""
    robot = subject()
    wild = replace(robot.theta, gravity=robot.theta.gravity * 1e5)
    with pytest.raises(NonFiniteError):
        settled(robot.simulator, wild, robot.p_WE, frames(robot.p_WE), robot.cable_caps)
