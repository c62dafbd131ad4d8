"""The paper's identification on planted truths; interruption; what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import InputError, NumericalError, UsageError
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.paper import (
    PAPER_FREE,
    PaperFit,
    Preset,
    Settings,
    demonstrations,
    identify_paper,
    preset,
    seen,
    settled_start,
)
from r2s2r_cli.stages.segments import segments, target_intervals
from tests.stages.identify.paper.test_shooting import TARGETS, TRUTH, demo, made, start
from tests.support.robots import subject


def from_speed(speed: float) -> Preset:
    """The synthetic task, begun elsewhere; it shares the compiled engine."""
    task = made()
    numbers = type(task.numbers)(
        task.robot, select([f"motor_speed={speed}"], task.robot), structure=task.world.simulator.structure
    )
    return replace(task, numbers=numbers)


def fit(speed: float, settings: Settings, **options: Any) -> PaperFit:
    """Adam on the short synthetic closed loop."""
    return identify_paper(made().world, from_speed(speed).numbers, [demo()], [start()], settings, **options)


def test_adam_finds_the_planted_motor_speed() -> None:
    """From 0.65 to 0.5 with the paper's rate; the iteration of the smallest loss lies within 3 % of it."""
    found = fit(0.65, Settings(iterations=14))
    assert found.trace.values[0, 0] == 0.65
    assert found.best[0] == pytest.approx(TRUTH, rel=0.03)
    assert np.sign(found.trace.gradients[0, 0]) == 1


def test_a_resumed_fit_goes_on_bit_by_bit() -> None:
    """Two and three iterations are five: values, losses, gradients."""
    kept: dict[str, Any] = {}
    seen_losses: list[float] = []
    whole = fit(0.65, Settings(iterations=4), progress=lambda k, loss: seen_losses.append(loss))
    fit(0.65, Settings(iterations=2), save=kept.update)
    resumed = fit(0.65, Settings(iterations=4), resume=kept)
    for name in ("values", "gradients", "losses", "whole", "kept"):
        assert np.array_equal(getattr(resumed.trace, name), getattr(whole.trace, name))
    assert np.array_equal(resumed.last, whole.last)
    assert seen_losses == whole.trace.losses.tolist()


def test_values_stay_within_their_bounds() -> None:
    """A first step of 0.1 from 0.4 stops at the bound 0.45."""
    task = made()
    frees = select(["motor_speed=0.4,0.35..0.45"], task.robot)
    numbers = type(task.numbers)(task.robot, frees, structure=task.world.simulator.structure)
    found = identify_paper(task.world, numbers, [demo()], [start()], Settings(iterations=1))
    assert found.last.tolist() == [0.45]


def test_a_loss_that_is_no_number_is_refused() -> None:
    """NaN in the observations: exit 6, with the iteration and the value."""
    bad = replace(demo(), p_WE=np.full_like(demo().p_WE, np.nan))
    with pytest.raises(NumericalError) as error:
        identify_paper(made().world, from_speed(0.65).numbers, [bad], [start()], Settings(iterations=1))
    assert "iteration 1, motor_speed 0.65" in error.value.where


def test_numbers_without_a_derivative_are_refused() -> None:
    """A delay is not in the engine: exit 2, and the default method is named."""
    robot = subject().robot
    with pytest.raises(UsageError, match="no derivative"):
        preset(robot, select(["camera_delay=0.01"], robot))


def test_the_presets_numbers() -> None:
    """Motor speed and friction, from robot.toml."""
    robot = subject().robot
    found = preset(robot)
    assert found.numbers.names == PAPER_FREE
    assert found.first.tolist() == [robot.motors[0].speed, robot.contact.friction]


def as_run() -> RunData:
    """The synthetic truth as a recorded run, its clock elsewhere."""
    one, t = demo(), demo().t + 7.0
    row = np.searchsorted(one.spans.t_first, one.t + 1e-9, side="right") - 1
    frame_target = one.targets[one.spans.interval[row] - 1]
    control = np.vstack([one.control, np.zeros(6)])
    intervals = target_intervals(t, frame_target, control=control)
    zero = np.zeros_like(one.p_WE)
    return RunData(
        name="crawl", t=t, observed=one.p_WE, noise=np.full((6, 3), 1e-3), p_WE=one.p_WE, sd_p=zero, v_WE=one.v_WE,
        sd_v=zero, quality=np.zeros((len(t), 6), dtype=int), t_command=one.t_command + 7.0, control=one.control,
        target=frame_target[:-1], intervals=intervals, segments=segments(intervals, t, control),
    )  # fmt: skip


def test_a_recorded_run_becomes_demonstrations() -> None:
    """Its clock starts at its first frame; a gap in the selection cuts it; intervals keep their numbers."""
    run = as_run()
    (both,) = demonstrations(run, Selection("crawl", (1, 2)))
    assert both.name == "crawl:1-2"
    assert both.t == pytest.approx(demo().t)
    assert both.spans.t_next == pytest.approx(demo().spans.t_next)
    assert np.array_equal(both.targets, TARGETS)
    (second,) = demonstrations(run, Selection("crawl", (2,)))
    assert (second.first, second.t[0], second.spans.interval[0]) == (2, 0.0, 2)
    assert second.t_command[0] < 0
    with pytest.raises(InputError, match="nothing to identify from"):
        demonstrations(run, Selection("crawl", (9,)))


def test_a_run_starts_at_rest_as_it_was_seen() -> None:
    """The settled start lies on the first observed caps."""
    task = made()
    state = settled_start(task, demo().p_WE[0])
    p_WE = state.p_WB.new_tensor(demo().p_WE[0])
    caps = seen(task.world, task.numbers.theta(task.first), fly_states(state, task))
    assert float((caps[0] - p_WE).norm(dim=-1).max()) < 1e-3


def fly_states(state: Any, task: Preset) -> Any:
    """A state as flat rows."""
    from r2s2r_cli.engine import pack_state

    return pack_state(task.world.simulator.structure, state)
