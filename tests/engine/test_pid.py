"""The latched controller: closed forms of its law, its memory, and the event-based steps of a policy."""

from __future__ import annotations

import pytest
import torch

from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.pid import (
    LatchedPid,
    PidMemory,
    Progress,
    Transition,
    advance,
    start_progress,
    steps_a_tick,
    ticks,
)

PID = LatchedPid(
    p=6.0, i=0.01, d=0.5, tolerance=0.12, min_length=0.095, range=0.1, period=0.02,
    cable_caps=((3, 5), (1, 3), (2, 5)), actuated=(0, 2),
)  # fmt: skip


def lengths(*positions: float) -> torch.Tensor:
    """Lengths of all three cables [m], (1, 3), the two actuated ones at these positions."""
    first, second = (0.095 + 0.1 * x for x in positions)
    return torch.tensor([[first, 9.0, second]], dtype=torch.float64)


def targets(*values: float) -> torch.Tensor:
    """(1, 2)."""
    return torch.tensor([values], dtype=torch.float64)


def run(positions: list[tuple[float, float]], target: torch.Tensor) -> tuple[torch.Tensor, PidMemory]:
    """Commands of every tick, (tick, 2), and the memory after the last."""
    memory = PID.start(lengths(0, 0))
    commands = []
    for now in positions:
        u, memory = PID.tick(memory, lengths(*now), target)
        commands.append(u[0])
    return torch.stack(commands), memory


def test_the_law_is_that_of_the_robot() -> None:
    """Two ticks in closed form: p e + i sum(e) + d (e - e before), the error before the first one counting as 0."""
    soft = LatchedPid(**{**vars(PID), "p": 1.5})
    memory = soft.start(lengths(0, 0))
    first, memory = soft.tick(memory, lengths(0.5, 0.4), targets(0.1, 0.8))
    second, memory = soft.tick(memory, lengths(0.3, 0.5), targets(0.1, 0.8))
    e1, e2 = torch.tensor([0.4, -0.4]), torch.tensor([0.2, -0.3])
    torch.testing.assert_close(first[0], (1.5 * e1 + 0.01 * e1 + 0.5 * e1).double())
    torch.testing.assert_close(second[0], (1.5 * e2 + 0.01 * (e1 + e2) + 0.5 * (e2 - e1)).double(), atol=1e-7, rtol=0)
    torch.testing.assert_close(memory.total[0], (e1 + e2).double(), atol=1e-7, rtol=0)


def test_too_long_cables_are_reeled_in() -> None:
    """The sign of the project: a cable longer than its target gets +1, a shorter one -1, and no more than that."""
    commands, _ = run([(1.0, 0.0)], targets(0.0, 1.0))
    assert commands[0].tolist() == [1.0, -1.0]


@pytest.mark.parametrize("error", [0.1199, -0.1199])
def test_within_the_tolerance_a_cable_is_done(error: float) -> None:
    """The band is open and symmetric: just inside the motor stops, just outside it runs."""
    commands, memory = run([(0.5 + error, 0.5 + error * 1.002)], targets(0.5, 0.5))
    assert memory.done[0].tolist() == [True, False]
    assert commands[0, 0] == 0
    assert commands[0, 1] != 0


def test_done_is_latched() -> None:
    """A cable that leaves the band again stays stopped, and neither sums errors nor remembers new ones."""
    commands, memory = run([(0.5, 0.0), (0.9, 0.0), (0.2, 0.0)], targets(0.5, 1.0))
    assert commands[:, 0].tolist() == [0.0, 0.0, 0.0]
    assert (memory.total[0, 0], memory.previous[0, 0]) == (0, 0)
    assert memory.total[0, 1] == pytest.approx(-3.0)


def test_a_short_cable_is_done_at_target_zero_only() -> None:
    """Shorter than position 0 counts as arrived where 0 was asked for, far outside the tolerance as well."""
    _, memory = run([(-0.5, -0.5)], targets(0.0, 0.1))
    assert memory.done[0].tolist() == [True, False]


def test_a_new_target_starts_afresh() -> None:
    """Where the target is left sum, error before and latch are gone; the other environments keep theirs."""
    memory = PidMemory(torch.ones(2, 2), torch.ones(2, 2), torch.ones(2, 2, dtype=torch.bool))
    after = memory.restarted(torch.tensor([True, False]))
    assert after.total.tolist() == after.previous.tolist() == [[0.0, 0.0], [1.0, 1.0]]
    assert after.done.tolist() == [[False, False], [True, True]]


def test_a_blocked_step_winds_up_harmlessly() -> None:
    """Without anti-windup the sum of a blocked cable grows, and the next target knows nothing of it."""
    _, memory = run([(1.0, 0.0)] * 300, targets(0.0, 0.0))
    assert memory.total[0, 0] == pytest.approx(300.0)
    fresh, _ = PID.tick(memory.restarted(torch.tensor([True])), lengths(0.85, 0.0), targets(1.0, 0.0))
    assert fresh[0, 0] == pytest.approx(6 * -0.15 + 0.01 * -0.15 + 0.5 * -0.15)


def test_environments_do_not_mix() -> None:
    """A batch gives every environment what it gets alone."""
    generator = torch.Generator().manual_seed(3)
    length = 0.095 + 0.1 * torch.rand(5, 3, generator=generator, dtype=torch.float64)
    target = torch.rand(5, 2, generator=generator, dtype=torch.float64)
    both, memory = PID.tick(PID.start(length), length, target)
    for k in range(5):
        alone, own = PID.tick(PID.start(length[k : k + 1]), length[k : k + 1], target[k : k + 1])
        assert torch.equal(alone[0], both[k])
        assert torch.equal(own.done[0], memory.done[k])


def test_the_command_is_differentiable_where_it_is_smooth() -> None:
    """Two ticks against finite differences, away from clamp and tolerance; clamped and done commands have slope 0."""
    soft = LatchedPid(**{**vars(PID), "p": 1.5})
    target = targets(0.2, 0.8)

    def second(length: torch.Tensor) -> torch.Tensor:
        _, memory = soft.tick(soft.start(length[:1]), length[:1], target)
        return soft.tick(memory, length[1:], target)[0]

    at = torch.cat([lengths(0.5, 0.4), lengths(0.45, 0.5)]).requires_grad_()
    assert torch.autograd.gradcheck(second, (at,))
    for positions in ((1.0, 0.0), (0.2, 0.8)):
        length = lengths(*positions).requires_grad_()
        u, _ = PID.tick(PID.start(length), length, target)
        (slope,) = torch.autograd.grad(u.sum(), length)
        assert not slope.any()


def test_gains_can_be_learned() -> None:
    """Gains and geometry may be tensors: du/dp is the error, du/d(min_length) is -(p + i + d) / range."""
    p = torch.tensor(1.5, dtype=torch.float64, requires_grad=True)
    low = torch.tensor(0.095, dtype=torch.float64, requires_grad=True)
    pid = LatchedPid(**{**vars(PID), "p": p, "min_length": low})
    u, _ = pid.tick(pid.start(lengths(0, 0)), lengths(0.5, 0.0), targets(0.2, 0.0))
    dp, dlow = torch.autograd.grad(u[0, 0], (p, low))
    assert dp == pytest.approx(0.3)
    assert dlow == pytest.approx(-(1.5 + 0.01 + 0.5) / 0.1)


def steps(done: list[list[bool]], holds: list[int], timeouts: list[int]) -> list[tuple[int, Transition]]:
    """Index after, and the transition of, every tick of one environment whose cables report `done`."""
    progress, seen = start_progress(1), []
    for now in done:
        progress, what = advance(progress, torch.tensor([now]), torch.tensor(holds), torch.tensor(timeouts))
        seen.append((int(progress.index), what))
    return seen


def test_the_step_waits_for_the_slowest_cable() -> None:
    """The next target comes with the tick in which the last cable is done, not before."""
    seen = steps([[False, False], [True, False], [True, True], [False, False]], [0, 0], [99, 99])
    assert [index for index, _ in seen] == [0, 0, 1, 1]
    assert [bool(what.changed) for _, what in seen] == [False, False, True, False]


def test_a_hold_waits_after_the_last_cable() -> None:
    """A hold of two ticks goes on two ticks after all cables were done."""
    seen = steps([[True, True]] * 4, [2, 0], [99, 99])
    assert [index for index, _ in seen] == [0, 0, 1, 2]


def test_a_timeout_gives_the_step_up() -> None:
    """After its ticks a step that is not done is left, and says so; one that is done in time does not."""
    seen = steps([[True, False]] * 3 + [[True, True]], [0, 0], [3, 3])
    assert [index for index, _ in seen] == [0, 0, 1, 2]
    assert [bool(what.timed_out) for _, what in seen] == [False, False, True, False]


def test_a_hold_is_not_cut_by_the_timeout() -> None:
    """The timeout is for cables that are not done; a hold longer than it is kept."""
    seen = steps([[True, True]] * 6, [4], [2])
    assert [index for index, _ in seen] == [0, 0, 0, 0, 1, 1]
    assert not any(bool(what.timed_out) for _, what in seen)


def test_after_the_last_step_nothing_happens() -> None:
    """A finished environment stays finished, while another of the batch goes on."""
    progress = Progress(torch.tensor([2, 1]), torch.tensor([0, 5]), torch.tensor([0, 0]))
    after, what = advance(progress, torch.ones(2, 2, dtype=torch.bool), torch.zeros(2, dtype=torch.long),
                          torch.full((2,), 9))  # fmt: skip
    assert after.index.tolist() == [2, 2]
    assert what.changed.tolist() == [False, True]
    assert after.finished(2).tolist() == [True, True]
    assert after.target(torch.tensor([[0.1], [0.2]])).tolist() == [[pytest.approx(0.2)], [pytest.approx(0.2)]]


def test_times_become_whole_ticks() -> None:
    """Rounded up, but a quotient that is whole up to rounding stays: 0.06 s are three ticks of 0.02 s."""
    assert ticks(torch.tensor([0.0, 0.06, 0.061, 0.001], dtype=torch.float64), 0.02).tolist() == [0, 3, 4, 1]
    with pytest.raises(EngineInputError, match="holds"):
        ticks(torch.tensor([float("nan")]), 0.02)


def test_the_engine_step_divides_the_control_period() -> None:
    """20 ms are 20 steps of 1 ms; 3 ms do not fit, and a step longer than the period neither."""
    assert steps_a_tick(0.02, 1e-3) == 20
    for step in (3e-3, 0.05):
        with pytest.raises(EngineInputError, match="step"):
            steps_a_tick(0.02, step)


@pytest.mark.parametrize("wrong", [{"range": 0.0}, {"tolerance": -0.1}, {"period": 0.0}, {"actuated": (0, 3)}])
def test_an_impossible_controller_is_refused(wrong: dict[str, float]) -> None:
    """A controller that no robot can have names the field."""
    with pytest.raises(EngineInputError, match=rf"pid\.{next(iter(wrong))}"):
        LatchedPid(**{**vars(PID), **wrong})


def test_a_simple_winch_reaches_random_targets() -> None:
    """In a loop with winches that follow the command every random target is reached, in about distance over speed."""
    generator = torch.Generator().manual_seed(0)
    speed, period = 0.06, PID.period
    wanted = torch.randint(0, 2, (8, 2), generator=generator).double()
    position, progress = torch.full((1, 2), 0.5, dtype=torch.float64), start_progress(1)
    holds, limits = torch.zeros(8, dtype=torch.long), torch.full((8,), 300)
    memory, count = PID.start(lengths(0, 0)), 0
    while not bool(progress.finished(8)):
        u, memory = PID.tick(memory, lengths(*position[0].tolist()), progress.target(wanted))
        progress, what = advance(progress, memory.done, holds, limits)
        assert not bool(what.timed_out)
        memory = memory.restarted(what.changed)
        position = position - u * speed * period / 0.1
        count += 1
    assert count * period < 8 * (0.1 / speed + 0.1)
