"""States to start from at the start of a window in a run: where the caps were seen, and with which velocities."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    State,
    cap_velocities,
    end_caps,
    read,
    window_state,
)
from tests.support.engine import G, lowest_gap, roll_between
from tests.support.robots import noise, rested, subject


@lru_cache
def midway() -> tuple[State, Tensor]:
    """The robot in motion: its state after 0.6 s of winding, cables slack on the way, and 1 ms later its caps."""
    robot = subject()
    u = torch.tensor([[[1.0, -1.0, 1.0, -1.0, 1.0, -1.0]]], dtype=torch.float64)
    run = robot.simulator.rollout(robot.theta, rested().state, u, hold=600, every=600)
    return run.at(1), end_caps(robot.theta, run.at(1))


def seen_midway(seed: int = 4) -> Tensor:
    """Its caps as a tracker sees them: 2 mm of noise."""
    return noise(midway()[1], 0.002, batch=1, seed=seed)


def test_a_window_starts_where_the_caps_were_seen() -> None:
    """Middles and axes are the observed ones, but for caps below the ground, which are lifted."""
    robot = subject()
    seen = seen_midway()
    state = window_state(robot.simulator, robot.theta, seen, midway()[0])
    found = end_caps(robot.theta, state)
    below = (robot.theta.cap_radius.flatten(1) - found[..., 2]).max()
    assert float(below) < 1e-12
    lifted = (found - seen)[..., 2].mean()
    assert 0 <= float(lifted) < 0.006
    middle = (found - seen).unflatten(1, (-1, 2)).mean(2)
    torch.testing.assert_close(middle, torch.tensor([0.0, 0.0, float(lifted)], dtype=torch.float64).expand_as(middle),
                               rtol=0, atol=1e-9)  # fmt: skip


def test_a_cap_seen_in_the_ground_is_lifted_and_one_above_it_stays() -> None:
    """A window in mid-run does not drop a robot to the ground: it may be about to fall."""
    robot = subject()
    state = rested().state
    for height, expected in ((-0.004, 0.0), (0.003, 0.003)):
        seen = end_caps(robot.theta, state) + torch.tensor([0.0, 0.0, height], dtype=torch.float64)
        lowest = float(lowest_gap(robot.theta, window_state(robot.simulator, robot.theta, seen, state)))
        assert lowest == pytest.approx(expected, abs=1e-6)


def test_roll_is_carried_into_a_window() -> None:
    """Caps as simulated give back the simulated orientation, roll included; noisy ones a roll close to it."""
    robot = subject()
    carried, p_WE = midway()
    same = window_state(robot.simulator, robot.theta, p_WE, carried)
    torch.testing.assert_close(roma.unitquat_to_rotmat(same.q_WR), roma.unitquat_to_rotmat(carried.q_WR),
                               rtol=0, atol=1e-9)  # fmt: skip
    noisy = window_state(robot.simulator, robot.theta, seen_midway(), carried)
    assert float(roll_between(carried, noisy).abs().max()) < 0.01


def test_velocities_are_carried_or_taken_from_the_caps() -> None:
    """Without observed velocities those of the simulation; with them rods whose caps move so, spin about z apart."""
    robot = subject()
    carried, p_WE = midway()
    assert float(carried.v_WB.abs().max()) > 0.01
    kept = window_state(robot.simulator, robot.theta, p_WE, carried)
    assert torch.equal(kept.v_WB, carried.v_WB)
    assert torch.equal(kept.w_R, carried.w_R)
    v_WE = cap_velocities(robot.theta, carried)
    seen = window_state(robot.simulator, robot.theta, p_WE, carried, v_WE=v_WE)
    torch.testing.assert_close(cap_velocities(robot.theta, seen), v_WE, rtol=0, atol=1e-6)
    assert float(seen.w_R[..., 2].abs().max()) < 1e-12


def test_winches_that_paid_out_stay_paid_out() -> None:
    """Cables that the pose leaves slack keep the rest length their winch had; taut ones get that of their tension."""
    robot = subject()
    out = -torch.ones(1, 1, 6, dtype=torch.float64)
    carried = robot.simulator.rollout(robot.theta, rested().state, out, hold=1000, every=1000).at(1)
    before = read(robot.structure, robot.theta, carried).tension[0, robot.winched]
    found = window_state(robot.simulator, robot.theta, end_caps(robot.theta, carried), carried)
    after = read(robot.structure, robot.theta, replace(found, v_WB=0 * found.v_WB, w_R=0 * found.w_R))
    tension, length = after.tension[0, robot.winched], after.length[0, robot.winched]
    slack = (before == 0) & (tension == 0)
    assert int(slack.sum()) >= 2
    assert torch.equal(found.rest[0, slack], carried.rest[0, slack])
    torch.testing.assert_close(found.rest[0, ~slack], (length - tension / 2000.0)[~slack], rtol=0, atol=1e-9)


def test_noise_does_not_pull_a_hanging_cable_taut() -> None:
    """Cables that hang 30 mm loose stay so under 2 mm of noise, though some tension would balance the noisy pose."""
    robot, (carried, p_WE) = subject(), midway()
    length = read(robot.structure, robot.theta, carried).length[:, robot.winched]
    hanging = torch.tensor([[True, False, False, True, False, False]])
    paid_out = replace(carried, rest=torch.where(hanging, length + 0.03, carried.rest))
    seen = noise(p_WE, 0.002, batch=8, seed=3)
    found = window_state(robot.simulator, robot.theta, seen, paid_out)
    assert torch.equal(found.rest[:, hanging[0]], paid_out.rest[:, hanging[0]].expand(8, -1))
    tight = window_state(robot.simulator, robot.theta, seen, paid_out, loose=0.1)
    assert float((tight.rest - paid_out.rest)[:, hanging[0]].min()) < -0.02


def test_a_window_starts_without_a_jump() -> None:
    """Rest lengths carried as they are make of 2 mm of noise a jump of 10 to 20 g in the first ms (2000 N/m cables);
    consistent tensions leave what the passive cables do: a fifth over 16 draws, and less in every single one."""
    robot, (carried, p_WE) = subject(), midway()
    seen = noise(p_WE, 0.002, batch=16, seed=7)
    state = window_state(robot.simulator, robot.theta, seen, carried, v_WE=torch.zeros_like(seen))

    def jump(start: State) -> Tensor:
        still = torch.zeros(1, 1, 6, dtype=torch.float64)
        run = robot.simulator.rollout(robot.theta, start, still)
        return torch.linalg.vector_norm(cap_velocities(robot.theta, run.at(1)), dim=-1).amax(1) / 1e-3

    made, naive = jump(state), jump(replace(state, rest=carried.rest.expand(16, -1)))
    assert float(naive.mean()) > 10 * G
    assert float((made / naive).max()) < 0.7
    assert float(made.mean()) < 0.25 * float(naive.mean())
