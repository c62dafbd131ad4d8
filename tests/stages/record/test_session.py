"""The loop of `record` on a robot of straight lines: what it commands and what it writes down."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from r2s2r_cli.engine.pid import advance, start_progress, ticks
from r2s2r_cli.stages.segments import segments, target_intervals
from tests.support.fake_robot import FULL_SPEED, FakeLink, calibrated
from tests.support.robots import subject
from tests.support.sessions import policy, recorded


def test_targets_are_reached_and_the_rest_shape_frames_them() -> None:
    """Rest, the targets, rest: every cable ends within the tolerance of each, and the motors are off at the end."""
    robot = calibrated()
    link = FakeLink(robot)
    session, rows = recorded(link, policy(robot, 0.2, 0.7))
    target = rows.column("runs/gait/intervals", "target")[:, 0]
    assert target.tolist() == [1.0, 0.2, 0.7, 1.0]
    ends = rows.column("runs/gait/intervals", "last").astype(int)
    position = rows.column("runs/gait/motors", "position")[ends]
    assert np.all(np.abs(position - target[:, None]) < robot.pid.tolerance + FULL_SPEED * 0.02 / robot.pid.range_m)
    assert rows.column("runs/gait/intervals", "complete").all()
    assert link.stops >= 1 and not link.driven.any()
    run = session.runs[0]
    assert (run.ended, run.targets_done, run.timed_out, run.late) == ("complete", 4, (), 0)
    assert run.rate_hz == pytest.approx(robot.pid.rate_hz)


def test_the_lengths_written_are_those_of_the_robot() -> None:
    """Through the line of its sensor every capacitance is the length of the cable that the sensor table names."""
    robot = calibrated()
    link = FakeLink(robot)
    seen: list[np.ndarray] = []
    link.on_read = lambda number, sample: (seen.append(link.length.copy()), sample)[1]
    _, rows = recorded(link, policy(robot, 0.5))
    cable = rows.column("runs/gait/sensors:table", "cable").astype(int)
    length = rows.column("runs/gait/sensors", "length")
    assert np.allclose(length, np.array(seen)[: len(length)][:, cable], atol=1e-12)
    assert np.isfinite(rows.column("runs/gait/sensors", "capacitance")).all()


def test_every_command_is_written_as_it_was_sent() -> None:
    """One row of commands a control tick, with the speeds that the link was given."""
    link = FakeLink(calibrated(), boards=3)
    session, rows = recorded(link, policy(link.robot, 0.4))
    control = rows.column("runs/gait/commands", "control")
    assert np.array_equal(control, np.array(link.commands)[-len(control) :])
    assert len(control) == session.runs[0].ticks == pytest.approx(session.runs[0].samples / 3, abs=2)


def test_held_motors_are_written_as_held() -> None:
    """Ten samples in doubt in mid-motion: zeros are sent and written, counted and said; then the run goes on."""
    doubt = "the sensor of cable 3 may be frozen"
    link = FakeLink(calibrated())
    link.on_read = lambda number, sample: dataclasses.replace(sample, doubt=doubt if 45 <= number < 55 else "")
    session, rows = recorded(link, policy(link.robot, 0.0))
    control = rows.column("runs/gait/commands", "control")
    still = np.flatnonzero((control == 0).all(axis=1))
    at = still[(still > 40) & (still < 60)]
    assert len(at) == 10 and np.ptp(at) == 9 and control[at[0] - 1].all() and control[at[-1] + 1].all()
    assert np.array_equal(control, np.array(link.commands)[-len(control) :])
    (run,) = session.runs
    assert run.held == 10 and run.ended == "complete"
    assert run.warnings == (f"the motors were held for 10 of {run.ticks} control ticks: {doubt}",)


def test_unsynchronised_boards_leave_gaps_in_their_rows() -> None:
    """A sample of one of three boards holds its own sensors; the others are NaN in that row, not repeated."""
    link = FakeLink(calibrated(), boards=3)
    _, rows = recorded(link, policy(link.robot, 0.4))
    board = rows.column("runs/gait/sensors", "board").astype(int)
    missing = np.isnan(rows.column("runs/gait/sensors", "capacitance"))
    own = np.arange(len(link.robot.sensors)) % 3
    assert np.array_equal(missing, board[:, None] != own)


def test_every_motor_is_heard_though_a_tick_falls_on_one_board() -> None:
    """Each board tells of its own motors: the row of a tick has the latest of all, none of them older than a round."""
    link = FakeLink(calibrated(), boards=3)
    session, rows = recorded(link, policy(link.robot, 0.4))
    encoder = rows.column("runs/gait/motors", "encoder")
    counts = encoder - np.arange(encoder.shape[1])
    assert np.array_equal(np.ptp(counts, axis=1), np.full(len(counts), 2.0))  # three boards, one sample apart each
    assert (np.diff(counts, axis=0) == 3).all()
    assert not [text for text in session.runs[0].warnings if "encoder" in text]


def test_intervals_and_segments_are_those_of_the_commands() -> None:
    """What was written while the run went on is what the whole run gives afterwards."""
    link = FakeLink(calibrated())
    _, rows = recorded(link, policy(link.robot, 0.2, 0.8, 0.8, 0.3))
    t, target, control = (rows.column("runs/gait/commands", name) for name in ("t", "target", "control"))
    whole = target_intervals(t, target, control=control)
    parts = segments(whole, t, control)
    for table, stream in ((whole, "intervals"), (parts, "segments")):
        for name, column in vars(table).items():
            assert np.array_equal(rows.column(f"runs/gait/{stream}", name), column), (stream, name)
    assert len(whole) == 5  # the two equal targets are one interval


def test_a_target_that_is_out_of_reach_is_given_up_after_its_timeout() -> None:
    """A motor that does not turn: the run goes on after the time-out, and says which target and which cable it was."""
    robot = calibrated()
    link = FakeLink(robot)
    full = link.command
    link.command = lambda speed: full(np.where(np.arange(len(speed)) == 2, 0.0, speed))  # type: ignore[method-assign]
    session, rows = recorded(link, policy(robot, 0.3, 0.9, timeout_s=2.0), rest=0.0)
    assert session.runs[0].timed_out == (1,)
    t_first, t_last = rows.column("runs/gait/intervals", "t_first"), rows.column("runs/gait/intervals", "t_last")
    assert t_last[0] - t_first[0] == pytest.approx(2.0 - link.period, abs=1e-6)
    said = f"1 of 2 targets given up after their time-out: 1 (cable {robot.actuated[2]} too long)."
    assert session.runs[0].warnings[0].startswith(said)


def test_commands_and_transitions_are_those_of_the_engine_s_controller() -> None:
    """The controller of the simulator, on the recorded lengths, gives every recorded command, done flag and step."""
    robot = calibrated()
    link = FakeLink(robot)
    _, rows = recorded(link, policy(robot, 0.2, 0.7, hold_s=0.1), rest=0.3)
    pid, period = subject().pid(), 1.0 / robot.pid.rate_hz
    hold, timeout = (ticks(torch.tensor(rows.column("runs/gait/policy", name)), period) for name in ("hold", "timeout"))
    targets = torch.tensor(rows.column("runs/gait/policy", "target"))
    length = torch.tensor(rows.column("runs/gait/sensors", "length"))[:, None]
    memory, progress = pid.start(length[0]), start_progress(1)
    cable = rows.column("runs/gait/sensors:table", "cable").astype(int)
    control, done = [], []
    for row in length:
        by_cable = torch.zeros_like(row)
        by_cable[:, cable] = row
        u, memory = pid.tick(memory, by_cable, progress.target(targets))
        control.append(u[0].numpy())
        done.append(memory.done[0].numpy())
        progress, change = advance(progress, memory.done, hold, timeout)
        memory = memory.restarted(change.changed)
    assert progress.finished(len(targets)).all()
    assert np.array_equal(rows.column("runs/gait/commands", "done"), np.array(done))
    assert np.allclose(rows.column("runs/gait/commands", "control"), np.array(control), atol=1e-9)


def test_repeats_take_turns_and_have_names_of_their_own() -> None:
    """Two policies three times: a-1, b-1, a-2 ...; each run counts its own time from 0."""
    robot = calibrated()
    link = FakeLink(robot)
    session, rows = recorded(link, policy(robot, 0.4, name="a"), policy(robot, 0.6, name="b"), repeats=3, rest=0.0)
    assert [run.run for run in session.runs] == ["a-1", "b-1", "a-2", "b-2", "a-3", "b-3"]
    assert all(rows.column(f"runs/{run.run}/commands", "t")[0] < 0.1 for run in session.runs)
    assert session.report().not_begun == ()
