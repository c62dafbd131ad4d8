"""What ends a session of `record` or keeps it from moving: the link, the disk, sensors and motors that fail."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pytest

from r2s2r_cli.devices.camera import FeedStatistics, Frame
from r2s2r_cli.devices.link import LinkError, Sample
from r2s2r_cli.errors import ArtifactError, HardwareError, InputError
from r2s2r_cli.stages.record import Session, plans, run_layout
from schemas.config import RecordSettings
from tests.support.fake_robot import FakeLink, Rows, calibrated
from tests.support.robots import subject
from tests.support.sessions import policy, recorded


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
