"""The loop of `record` on a robot of straight lines: what it commands, what it writes down, and how it ends."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest
import torch

from r2s2r_cli.devices.camera import FeedStatistics, Frame
from r2s2r_cli.devices.link import LinkError, Sample
from r2s2r_cli.engine.pid import advance, start_progress, ticks
from r2s2r_cli.errors import ArtifactError, HardwareError, InputError
from r2s2r_cli.stages.record import Session, plans, run_layout
from r2s2r_cli.stages.segments import segments, target_intervals
from schemas.config import RecordSettings
from schemas.policy import PolicyFile
from schemas.robot import Robot
from tests.support.fake_robot import FULL_SPEED, FakeLink, Rows, calibrated
from tests.support.robots import subject


def policy(robot: Robot, *targets: float, name: str = "gait", **step: float) -> PolicyFile:
    """All cables to each of the targets in turn."""
    steps = [{"target": (target,) * len(robot.actuated), **step} for target in targets]
    return PolicyFile.model_validate({"schema_version": 1, "robot": robot.name, "name": name, "steps": steps})


def recorded(link: FakeLink, *policies: PolicyFile, repeats: int = 1, rest: float = 0.5) -> tuple[Session, Rows]:
    """A session that ran to its end, and its rows."""
    session, rows = Session(plans(policies, repeats=repeats, rest=rest), link.robot, link, RecordSettings()), Rows()
    session.record(rows)
    return session, rows


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


@pytest.mark.parametrize(("watchdog", "guaranteed"), [(0.25, True), (5.0, False), (0.0, False), (None, False)])
def test_a_recording_says_whether_the_robot_stops_by_itself(watchdog: float | None, guaranteed: bool) -> None:
    """As the robot says of its watchdog: in the report, in the layout of the file, and where a run was cut off."""

    def die(number: int, sample: Sample) -> Sample:
        if number == 40:
            raise LinkError("the port is gone", where="fake", hint="plug it in")
        return sample

    robot = calibrated()
    link = FakeLink(robot, on_read=die)
    link.facts = dataclasses.replace(link.facts, watchdog=watchdog)
    session = Session(plans([policy(robot, 0.2)], repeats=1, rest=0.0), robot, link, RecordSettings())
    with pytest.raises(LinkError):
        session.record(Rows())
    assert session.report().stops_by_itself == guaranteed
    assert ("cannot guarantee" in session.runs[0].warnings[0]) != guaranteed
    streams = run_layout(session.plans[0], robot, link.facts, None)
    (told,) = [one.attributes["stops_by_itself"] for one in streams if one.path.endswith("/link")]
    assert told == guaranteed


@pytest.mark.parametrize("after", [1, 40, 90])
def test_a_dead_link_ends_the_run_with_what_was_recorded(after: int) -> None:
    """The link dies at any sample: motors are told to stop, all rows before are with the sink, the report says so."""

    def die(number: int, sample: Sample) -> Sample:
        if number == after:
            raise LinkError("the port is gone", where="fake", hint="plug it in")
        return sample

    robot = calibrated()
    link = FakeLink(robot, on_read=die)
    session, rows = (
        Session(plans([policy(robot, 0.2, 0.8)], repeats=2, rest=0.5), robot, link, RecordSettings()),
        Rows(),
    )
    with pytest.raises(LinkError):
        session.record(rows)
    assert link.stops >= 1 and not link.driven.any()
    assert len(rows.of.get("runs/gait-1/sensors", [])) == after - 1
    report = session.report()
    assert [run.ended for run in report.runs] == ["the port is gone"] and report.not_begun == ("gait-2",)
    if after > 1:  # the interval that was cut off is written, and not complete where cables were on their way
        last = rows.of["runs/gait-1/intervals"][-1]
        assert last["last"] == after - 2


class Watched:
    """A feed without frames that notes how often the robot had been stopped when its pictures were left."""

    statistics = FeedStatistics()

    def __init__(self, link: FakeLink) -> None:
        self.link = link
        self.stops = -1

    def frames(self) -> list[Frame]:
        """None."""
        return []

    def hold(self, on: bool) -> None:
        """Off once all is encoded: a backlog takes half a second."""
        self.stops = self.stops if on else self.link.stops

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.parametrize("error", [KeyboardInterrupt(), LinkError("gone", where="fake", hint="plug it in")])
def test_the_motors_stop_before_the_pictures_are_encoded(error: BaseException) -> None:
    """Whatever ends a run in mid-motion: the stop does not wait for the camera's backlog."""

    def end(number: int, sample: Sample) -> Sample:
        if number == 40:
            raise error
        return sample

    robot = calibrated()
    link = FakeLink(robot, on_read=end)
    feed = Watched(link)
    session = Session(plans([policy(robot, 0.2)], repeats=1, rest=0.0), robot, link, RecordSettings(), feed=feed)
    with pytest.raises(type(error)):
        session.record(Rows())
    assert feed.stops == 1


def test_a_full_disk_stops_the_robot() -> None:
    """The journal refuses a row: a hardware error with the disk's own hint, motors off, within a few control ticks."""
    robot = calibrated()
    link = FakeLink(robot)
    taken: list[str] = []

    def sink(stream: str, row: object) -> None:
        taken.append(stream)
        if len(taken) > 100:
            raise ArtifactError("no space left", where="10-record.h5.journal", hint="df -h .")

    slow = link.read

    def read(timeout: float) -> Sample | None:
        time.sleep(0.001)
        return slow(timeout)

    link.read = read  # type: ignore[method-assign]
    session = Session(plans([policy(robot, 0.0, 1.0, 0.0)], repeats=1, rest=0.5), robot, link, RecordSettings())
    with pytest.raises(HardwareError, match="cannot be written") as caught:
        session.record(sink)
    assert caught.value.exit_code == 5 and caught.value.hint == "df -h ."
    assert not link.driven.any() and len(link.commands) < 200


def test_a_sensor_at_0_20_pf_moves_no_motor() -> None:
    """The value of a chip that was not set up is no length: its motor stays off, its cable is not done."""

    def stuck(number: int, sample: Sample) -> Sample:
        capacitance = sample.capacitance.copy()
        capacitance[0] = 0.20e-12
        return Sample(**{**vars(sample), "capacitance": capacitance})

    robot = calibrated()
    link = FakeLink(robot, on_read=stuck)
    session, rows = recorded(link, policy(robot, 0.2, timeout_s=1.0), rest=0.0)
    motor = list(robot.actuated).index(robot.sensors[0].cable)
    assert not rows.column("runs/gait/commands", "control")[:, motor].any()
    assert session.runs[0].timed_out == (1,) and session.runs[0].silent_share[0] == 1.0
    assert f"cable {robot.sensors[0].cable} without reading" in session.runs[0].warnings[0]
    assert np.all(rows.column("runs/gait/sensors", "capacitance")[:, 0] == 0.20e-12)


def test_a_motor_that_does_not_turn_is_named() -> None:
    """Its encoder stands still while it is driven both ways for over half a second each: a warning with its cable, none
    of the others; driven one way alone it may be at the end of its travel."""
    robot = calibrated()
    stuck = np.arange(len(robot.actuated)) == 2

    def hold(number: int, sample: Sample) -> Sample:
        return dataclasses.replace(sample, encoder=np.where(stuck, 17.0, sample.encoder))

    for still, targets in ((False, (0.0,)), (True, (0.0,)), (True, ())):
        link = FakeLink(robot, on_read=hold if still else None)
        session, _ = recorded(link, policy(robot, *(targets or (0.9,))))
        said = [text for text in session.runs[0].warnings if "encoder" in text]
        assert len(said) == (still and bool(targets)) and all(
            f"cable {robot.actuated[2]} was driven" in text for text in said
        )


def test_a_board_whose_clock_is_set_is_counted() -> None:
    """Its clock goes back an hour in the middle: counted once, and the stamps of the run go on."""

    def jump(number: int, sample: Sample) -> Sample:
        return Sample(**{**vars(sample), "t_board": sample.t_board - (3600.0 if number > 50 else 0.0)})

    robot = calibrated()
    link = FakeLink(robot, on_read=jump)
    session, rows = recorded(link, policy(robot, 0.2))
    assert session.runs[0].clock_jumps == 1
    assert (np.diff(rows.column("runs/gait/sensors", "t")) > 0).all()


def test_nothing_is_commanded_before_every_sensor_was_heard() -> None:
    """Three boards: zeros until all have spoken."""
    link = FakeLink(calibrated(), boards=3)
    silent = link.on_read = lambda number, sample: Sample(
        **{**vars(sample), "t_sensor": np.where(sample.fresh & (number < 10), np.nan, sample.t_sensor)}
    )
    assert silent is not None
    _, rows = recorded(link, policy(link.robot, 0.2))
    assert not np.array(link.commands[:2]).any()
    assert rows.column("runs/gait/commands", "t")[0] > 0.04


def test_a_dead_sensor_of_a_passive_cable_holds_up_nothing() -> None:
    """Never heard: the run is the one with all sensors, and it is said which one was missing. One of a winched cable
    lets no motor move."""
    robot = calibrated()
    passive = next(i for i, sensor in enumerate(robot.sensors) if sensor.cable not in robot.actuated)

    def dead(number: int, sample: Sample) -> Sample:
        lost = np.arange(len(robot.sensors)) == passive
        return dataclasses.replace(
            sample, fresh=sample.fresh & ~lost, t_sensor=np.where(lost, np.nan, sample.t_sensor),
            capacitance=np.where(lost, np.nan, sample.capacitance),
        )  # fmt: skip

    link, whole = FakeLink(robot, on_read=dead), FakeLink(robot)
    session, _ = recorded(link, policy(robot, 0.2))
    recorded(whole, policy(robot, 0.2))
    assert np.array_equal(link.commands, whole.commands)
    run = session.runs[0]
    assert run.complete and run.targets_done == 3
    assert run.warnings == (f"sensors without a reading: {passive} (100%) of the control ticks",)


def test_an_uncalibrated_robot_is_refused() -> None:
    """Without the line of a winched cable's sensor there is no length to control."""
    robot = subject().robot
    session = Session(plans([policy(robot, 0.5)], repeats=1, rest=0.0), robot, FakeLink(calibrated()), RecordSettings())
    with pytest.raises(InputError, match="calibrated"):
        session.record(Rows())
