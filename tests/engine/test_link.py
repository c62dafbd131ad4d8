"""Commands that come late, and those that were sent before the controller took over."""

from __future__ import annotations

from functools import lru_cache

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import ClosedLoopRun, EngineInputError, cap_lengths, closed_loop
from r2s2r_cli.engine.flat import pack_state
from r2s2r_cli.engine.link import Link
from tests.support.robots import rested, subject

PERIOD, STEP, ROWS = 0.02, 1e-3, 20
TARGETS = torch.tensor([[0.6, 1.0, 0.7, 0.8, 1.0, 0.5]], dtype=torch.float64)


@lru_cache
def run(delay: float = 0.0, *, sent: int = 0, lead: int = 0, plain: bool = False) -> ClosedLoopRun:
    """One shape; `sent` ticks of full commands before the controller takes over."""
    robot = subject()
    before = torch.linspace(-1, 1, sent, dtype=torch.float64)[None, :, None].expand(1, -1, 6) if sent else None
    with torch.no_grad():
        return closed_loop(
            robot.simulator, robot.theta, rested().state, robot.pid(), TARGETS, torch.zeros(1), torch.full((1,), 2.0),
            step=STEP, tail=0.1, link=None if plain else Link(delay, before, lead),
        )  # fmt: skip


def replayed(rows: Tensor) -> Tensor:
    """Flat states at the ticks under commands (row, actuated) of 1 ms."""
    robot = subject()
    with torch.no_grad():
        path = robot.simulator.rollout(robot.theta, rested().state, rows[None], step=STEP, every=ROWS)
    return pack_state(robot.structure, path.states, leading=2)[0]


def flat(one: ClosedLoopRun) -> Tensor:
    """Flat states at the ticks."""
    return pack_state(subject().structure, one.trajectory.states, leading=2)[0]


def late(commands: Tensor, delay: float) -> Tensor:
    """Rows (row, actuated) of 1 ms of commands that hold from their tick on, `delay` later: means over each row."""
    fine = 10  # parts of a row
    moments = (torch.arange(len(commands) * ROWS * fine) + 0.5) * STEP / fine - delay
    tick = torch.floor(moments / PERIOD).long()
    rows = torch.where((tick >= 0)[:, None], commands[tick.clamp(min=0)], torch.zeros(1, 6, dtype=torch.float64))
    return rows.unflatten(0, (-1, fine)).mean(dim=1)


def test_no_delay_is_no_link() -> None:
    """With a link that does nothing every number is the same."""
    assert torch.equal(flat(run()), flat(run(plain=True))) and torch.equal(run().u, run(plain=True).u)


@pytest.mark.parametrize("delay", [0.04, 0.0537])
def test_commands_arrive_later(delay: float) -> None:
    """The robot moves as under a replay of the commands as sent, shifted; a part of a step is averaged over it."""
    made = run(delay)
    assert torch.allclose(flat(made), replayed(late(made.u[0], delay)), rtol=0, atol=1e-9)
    assert not torch.allclose(flat(made)[:30], flat(run())[:30], rtol=0, atol=1e-4)


def test_the_controller_sees_its_delay() -> None:
    """With a late winch the cables go on after `done`: the shape takes longer, and ends further on."""
    assert int(run(0.2).ticks[0]) > int(run().ticks[0])


def test_what_was_sent_before_still_arrives() -> None:
    """Three commands under way at the start act first; the controller's own come after them."""
    made, sent = run(0.06, sent=3), torch.linspace(-1, 1, 3, dtype=torch.float64)[:, None].expand(-1, 6)
    rows = torch.cat([sent, made.u[0]])[: len(made.u[0])].repeat_interleave(ROWS, dim=0)
    assert torch.allclose(flat(made), replayed(rows), rtol=0, atol=1e-9)


def test_the_controller_takes_over_at_its_tick() -> None:
    """Of five given commands two act inside the simulation; after them the controller begins afresh."""
    made, sent = run(sent=5, lead=2), torch.linspace(-1, 1, 5, dtype=torch.float64)
    assert torch.equal(made.u[0, :2, 0], sent[3:])
    later = flat(made)[2]
    robot = subject()
    u, _ = robot.pid().tick(robot.pid().start(made.length[:, 2]), made.length[:, 2], TARGETS)
    assert torch.equal(made.u[:, 2], u) and not torch.equal(later, flat(made)[0])
    assert int(made.ticks[0]) == int((made.index[0] == 0).sum()) - 2


def test_environments_have_links_of_their_own() -> None:
    """A batch of two delays and leads is each alone."""
    robot = subject()
    sent = torch.linspace(-1, 1, 5, dtype=torch.float64)[None, :, None].expand(1, -1, 6)
    with torch.no_grad():
        both = closed_loop(
            robot.simulator, robot.theta, rested().state, robot.pid(), TARGETS, torch.zeros(1), torch.full((1,), 2.0),
            step=STEP, link=Link(torch.tensor([[0.0], [0.0537]]), sent, torch.tensor([2, 0])),
        )  # fmt: skip
    for k, alone in enumerate((run(sent=5, lead=2), run(0.0537, sent=5))):
        count = int(both.ticks[k])
        assert count == int(alone.ticks[0])
        assert torch.allclose(both.u[k, :count], alone.u[0, :count], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_derivative_by_the_delay() -> None:
    """Autograd through the late commands against a central difference, between two ticks."""
    robot = subject()

    def end(delay: Tensor) -> Tensor:
        made = closed_loop(
            robot.simulator, robot.theta, rested().state, robot.pid(), TARGETS, torch.zeros(1), torch.full((1,), 0.2),
            step=STEP, link=Link(delay.reshape(1, 1)),
        )  # fmt: skip
        return cap_lengths(robot.cable_caps, made.trajectory.end_caps()[0, -1])[0]

    at = torch.tensor(0.0335, dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(end(at), at)
    with torch.no_grad():
        difference = (end(at + 1e-4) - end(at - 1e-4)) / 2e-4
    assert abs(float(slope)) > 1e-4 and float(slope) == pytest.approx(float(difference), rel=1e-3)


@pytest.mark.parametrize("bad", [{"delay": -0.01}, {"delay": float("nan")}, {"lead": 1}])
def test_times_that_cannot_be(bad: dict[str, float]) -> None:
    """A command cannot come before it was sent, nor be given where none is known."""
    with pytest.raises(EngineInputError):
        Link(**bad)  # type: ignore[arg-type]
