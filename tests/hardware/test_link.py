"""The life of a link, on a robot in memory: handshake, run, loss, return, and the stop at every exit."""

from __future__ import annotations

import dataclasses
import time
from binascii import crc_hqx

import numpy as np
import pytest

from r2s2r_cli.devices.link import LinkError, LinkState, RobotLink, SafetyStop
from r2s2r_cli.errors import ExitCode
from r2s2r_cli.hardware import farewell
from r2s2r_cli.hardware.codec import codec
from r2s2r_cli.hardware.link import Link
from tests.support.wire_robot import OFFSET, SLOPE, FakeRobot, calibrated


def link_to(robot: FakeRobot, *, timeout: float = 0.3, protocol: str = "checked") -> Link:
    """The host's side."""
    return Link(robot, codec(protocol, sensors=9, motors=6), robot.robot, handshake_timeout=timeout)


def test_connect_run_leave() -> None:
    """The greeting becomes facts, samples become lengths in SI, commands reach the motors, leaving stops them."""
    robot = FakeRobot()
    link = link_to(robot)
    assert isinstance(link, RobotLink) and link.state is LinkState.CLOSED
    with link:
        assert link.state is LinkState.RUNNING
        facts = link.facts
        assert (facts.protocol, facts.version, facts.device, facts.robot) == ("checked", "1", "v2", "threebar")
        assert facts.watchdog == 0.25 and not facts.lock_step and facts.remarks == ()
        robot.sample()
        sample = link.read(1.0)
        assert sample is not None and sample.due and sample.complete and sample.fresh.all()
        np.testing.assert_allclose((sample.capacitance - OFFSET) / SLOPE, 0.15, atol=2e-5)
        assert sample.voltage == 7.4 and sample.t_board == pytest.approx((robot.seq - 1) * 1e-3)
        link.command(np.linspace(-1, 1, 6))
        assert link.read(0.0) is None
    assert link.state is LinkState.CLOSED
    assert robot.heard[-1].split(",")[1].startswith("X") and robot.stops >= 2
    np.testing.assert_allclose(robot.duties, [np.linspace(-1, 1, 6) * 0.8], atol=1e-4)


def test_signs_speeds_and_orders_are_those_of_robot_toml() -> None:
    """Motors in another order than their cables, one wound the other way, one slower: all as the page says."""
    robot = calibrated()
    motors = [m.model_copy(update={"sign": -1 if m.cable == 2 else 1, "speed": 0.5 if m.cable == 4 else 0.8})
              for m in robot.motors[::-1]]  # fmt: skip
    fake = FakeRobot(robot.model_copy(update={"motors": tuple(motors)}))
    with link_to(fake) as link:
        link.command(np.array([1, 0.5, 0.25, 0, -1, -0.5]))
        fake.sample()
        sample = link.read(1.0)
    assert fake.duties == [[-0.4, -0.5, 0, -0.2, 0.4, 0.8]]
    assert sample is not None
    np.testing.assert_array_equal(sample.encoder, [5, 4, 3, 2, 1, 0])


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"mute": True}, "does not answer"), ({"deaf": True}, "does not answer"), ({"version": 2}, "another version"),
        ({"motors": 4}, "number of motors"), ({"dead": True}, "cannot be opened"),
    ],
)  # fmt: skip
def test_a_handshake_that_fails_says_why_and_leaves_the_robot_stopped(change: dict[str, object], what: str) -> None:
    """LinkError, exit code 5, the port named, something to paste."""
    robot = FakeRobot()
    vars(robot).update(change)
    link = link_to(robot, timeout=0.05)
    with pytest.raises(LinkError, match=what) as caught:
        link.__enter__()
    error = caught.value
    assert error.exit_code == ExitCode.HARDWARE and "/dev/fake" in error.where and error.hint
    assert link.state is LinkState.LOST
    assert robot.dead or any(line.split("*")[0].endswith(",X") for line in robot.heard)
    with pytest.raises(LinkError, match="no link"):
        link.command(np.zeros(6))


def test_another_protocol_is_recognised() -> None:
    """A robot of the authors on the port: the error says which protocol it speaks, and the hint has it."""
    robot = FakeRobot()
    robot.deaf = True
    robot.open = lambda: robot.out.extend([b"**S" + b" 0x28c" * 9] * 3)  # type: ignore[method-assign]
    with pytest.raises(LinkError, match="not the protocol checked") as caught:
        link_to(robot, timeout=0.05).__enter__()
    assert "which is legacy" in caught.value.received and "--protocol legacy" in caught.value.hint


@pytest.mark.parametrize("line", [b"5,B,1000,1,0,0*", b"**S" + b" 0x28c" * 9], ids=["checked", "legacy"])
def test_status_texts_may_be_another_protocol(line: bytes) -> None:
    """To `boards` whatever it does not know is a status text: where another protocol knows it, the hint has that."""
    robot = FakeRobot()
    robot.deaf = True
    if line.endswith(b"*"):
        line += b"%04X" % crc_hqx(line[:-1], 0xFFFF)
    robot.open = lambda: robot.out.extend([line] * 3)  # type: ignore[method-assign]
    with pytest.raises(LinkError, match="not the protocol boards") as caught:
        link_to(robot, timeout=0.05, protocol="boards").__enter__()
    other = "checked" if b"," in line else "legacy"
    assert f"which is {other}" in caught.value.received and f"--protocol {other}" in caught.value.hint


def test_another_robot_of_the_same_size_is_remarked() -> None:
    """The name is compared, and a difference told; it is no error, for names are free."""
    robot = FakeRobot()
    robot.calls = "patrick"
    with link_to(robot) as link:
        assert link.facts.remarks == ("the robot calls itself patrick, robot.toml is of threebar",)


def test_a_dead_port_is_an_error_that_tells_of_the_motors_and_can_be_mended() -> None:
    """read and command raise LinkError; the state is lost; reconnect shakes hands again and counts."""
    robot = FakeRobot()
    with link_to(robot) as link:
        robot.dead = True
        with pytest.raises(LinkError) as caught:
            link.read(1.0)
        assert "stops by itself after 250 ms" in caught.value.received
        assert link.state is LinkState.LOST
        with pytest.raises(LinkError):
            link.reconnect(timeout=0.0)
        robot.dead = False
        link.reconnect(timeout=1.0)
        assert link.state is LinkState.RUNNING and link.statistics.reconnects == 1
        robot.sample()
        assert link.read(1.0) is not None
        robot.dead = True
        with pytest.raises(LinkError):
            link.command(np.zeros(6))


@pytest.mark.parametrize(("ms", "said"), [(0, "watchdog is off"), (5000, "watchdog is 5000 ms")])
def test_a_watchdog_is_what_the_robot_says_of_it(monkeypatch: pytest.MonkeyPatch, ms: int, said: str) -> None:
    """None, or one that takes seconds: it does not stop by itself. It is remarked, and no dead link claims it."""
    monkeypatch.setattr(farewell, "RESCUE", 0.1)
    robot = FakeRobot()
    robot.watchdog_ms = ms
    with link_to(robot) as link:
        assert not link.facts.stops_by_itself and said in link.facts.remarks[0]
        link.command(np.ones(6))
        robot.dead = True
        with pytest.raises(LinkError) as caught:
            link.read(1.0)
        assert "SWITCH THE ROBOT OFF" in caught.value.received
    robot = FakeRobot()
    robot.watchdog_ms = 240
    with link_to(robot) as link:
        assert link.facts.stops_by_itself and link.facts.remarks == ()


@pytest.mark.parametrize("back", [0.5, None])
def test_a_network_that_is_away_for_a_while_is_waited_for(monkeypatch: pytest.MonkeyPatch, back: float | None) -> None:
    """Half a second without one: the stop arrives when it is back. One that stays away is not waited for long."""

    class Away(FakeRobot):
        until = 0.0

        def send(self, data: bytes, to: tuple[str, int] | None = None) -> None:
            if time.monotonic() < self.until:
                raise LinkError("the link to the robot broke", where="fake", received="no network", hint="wait")
            self.heard.append(data.decode())

    monkeypatch.setattr(farewell, "RESCUE", 1.0)
    robot = Away()
    robot.out.extend([b"S" + b" 0x28c" * 9] * 2)
    robot.open = lambda: None  # type: ignore[method-assign]
    with link_to(robot, protocol="legacy") as link:
        robot.until = time.monotonic() + (back or 60.0)
        robot.heard.clear()
        with pytest.raises(LinkError) as caught:
            link.command(np.ones(6))
        assert ("SWITCH THE ROBOT OFF" in caught.value.received) == (back is None)
        assert bool(robot.heard) == (back is not None)


def test_without_a_watchdog_a_stop_is_said_on_a_new_connection(monkeypatch: pytest.MonkeyPatch) -> None:
    """The authors' robots keep their last command: the port is opened again for the stop, else: switch it off."""

    class Flaky(FakeRobot):
        """Dies at a read, and is there again when opened."""

        def open(self) -> None:
            self.dead = False
            self.out.extend([b"S" + b" 0x28c" * 9] * 2)

        def obey(self, line: str) -> None:
            self.heard.append(line)

    monkeypatch.setattr(farewell, "RESCUE", 0.1)
    robot = Flaky()
    with link_to(robot, protocol="legacy") as link:
        link.command(np.ones(6))
        link.read(0.1)
        robot.dead = True
        with pytest.raises(LinkError) as caught:
            link.read(0.1)
        assert "a stop was sent on a new connection" in caught.value.received
        assert robot.heard[-1] == " " * 10 + "s"
        robot.dead, robot.open = True, FakeRobot.open.__get__(robot)  # type: ignore[method-assign]
        link._state = LinkState.RUNNING
        with pytest.raises(LinkError) as caught:
            link.read(0.1)
        assert "SWITCH THE ROBOT OFF" in caught.value.received


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ZeroDivisionError, SystemExit, None])
def test_every_exit_stops(kind: type[BaseException] | None) -> None:
    """Ctrl-C, a bug, an exit and the end of the block: the last word is a stop, said until acknowledged."""
    robot = FakeRobot()
    link = link_to(robot)
    if kind is None:
        with link:
            link.command(np.ones(6))
    else:
        with pytest.raises(kind), link:
            link.command(np.ones(6))
            raise kind
    assert robot.heard[-1].split("*")[0].endswith(",X") and link.state is LinkState.CLOSED


def test_a_stop_that_gets_lost_is_said_again() -> None:
    """A robot that stays silent at the end is told several times."""
    robot = FakeRobot()
    with link_to(robot) as link:
        link.command(np.ones(6))
        robot.deaf = True
        before = len(robot.heard)
    assert sum(line.split("*")[0].endswith(",X") for line in robot.heard[before:]) >= 5


def test_an_emergency_stop_that_was_lost_is_said_again() -> None:
    """Until the robot says that it has heard it: else the next host would drive it without a reset."""

    class Lossy(FakeRobot):
        lost = 0

        def send(self, data: bytes, to: tuple[str, int] | None = None) -> None:
            if b",E*" in data and not self.lost:
                self.lost += 1
                return
            super().send(data, to)

    robot = Lossy()
    with link_to(robot) as link:
        link.command(np.ones(6))
        link.emergency_stop()
        assert robot.lost == 1 and not robot.latched
    assert robot.latched and robot.emergencies == 1
    with pytest.raises(SafetyStop, match="latched"):
        link_to(robot).__enter__()


def test_the_emergency_stop_is_latched_until_it_is_reset() -> None:
    """Here and on the device; everything is refused; only `reset` goes on, also after a new start of the host."""
    robot = FakeRobot()
    with link_to(robot) as link:
        link.emergency_stop()
        assert robot.emergencies == 1
        for call in (lambda: link.command(np.zeros(6)), lambda: link.read(0.0)):
            with pytest.raises(SafetyStop, match="emergency stop") as caught:
                call()
            assert "--reset" in caught.value.hint and caught.value.exit_code == ExitCode.HARDWARE
        assert not robot.duties
    with pytest.raises(SafetyStop, match="latched"):
        link_to(robot).__enter__()
    link = link_to(robot)
    with pytest.raises(SafetyStop):
        link.__enter__()
    link.reset()
    assert link.state is LinkState.RUNNING
    link.command(np.zeros(6))
    assert len(robot.duties) == 1


def test_what_the_device_says_of_itself_ends_the_run() -> None:
    """Its own emergency stop, a restart in mid-run, a refused command."""
    robot = FakeRobot()
    with link_to(robot) as link:
        robot.sample(state=3)
        with pytest.raises(SafetyStop, match="device's emergency stop"):
            link.read(1.0)
    robot = FakeRobot()
    with link_to(robot) as link:
        robot.seq = 0
        robot.say("H", 1, "threebar", "v2", 1, 6, 9, 250, 0, 0)
        with pytest.raises(LinkError, match="started anew"):
            link.read(1.0)
    robot = FakeRobot()
    with link_to(robot) as link:
        robot.say("K", 1, 3, 0)
        with pytest.raises(LinkError, match="refuses commands") as caught:
            link.read(1.0)
        assert "no hello yet" in caught.value.received


def test_damage_on_the_way_is_counted_and_ignored() -> None:
    """A wrong sum, a line twice, a line late, a line lost: what comes out is the new samples in order."""
    robot = FakeRobot()
    with link_to(robot) as link:
        while link.read(0.0):
            pass
        before = link.statistics
        for _ in range(6):
            robot.sample()
        lines = list(robot.out)
        robot.out.clear()
        flipped = lines[2].replace(b"7400", b"7401")
        robot.out.extend([lines[0], lines[0], lines[1], flipped, lines[4], lines[3], b"garbage", lines[5]])
        found = [link.read(1.0) for _ in range(4)]
        assert link.read(0.0) is None
        stamps = [sample.t_board for sample in found if sample]
        assert stamps == sorted(stamps) and len(stamps) == 4
        after = link.statistics
    change = {key: getattr(after, key) - getattr(before, key)
              for key in ("received", "lost", "repeated", "reordered", "corrupt")}  # fmt: skip
    assert change == {"received": 4, "lost": 1, "repeated": 1, "reordered": 1, "corrupt": 2}


def test_boards_are_merged_and_one_of_them_leads() -> None:
    """Each board's samples refresh its own sensors; a tick is due once a round; where the leader dies another leads."""
    robot = FakeRobot()
    nan = float("nan")
    with link_to(robot) as link:
        t = 0.0
        due = []
        for i in range(30):
            board = i % 3
            if board == 0 and i > 14:
                continue  # the leader has fallen silent
            robot.sample(board=board, capacitance=[20.0 + i if k // 3 == board else nan for k in range(9)])
            message = robot.receive(0.0)
            assert message is not None
            t += 0.02 / 3
            link.inbox.take(dataclasses.replace(message, t=100 + t * (1.5 if i > 14 else 1)))
            sample = link.inbox.next_sample()
            assert sample is not None and sample.board == board
            np.testing.assert_array_equal(sample.fresh, np.arange(9) // 3 == board)
            due.append((i, sample.due))
        assert sample.complete and (sample.capacitance[:3] < sample.capacitance[3:].min()).all()
    assert [i for i, is_due in due if is_due and i <= 14] == [0, 3, 6, 9, 12]
    late = [i % 3 for i, is_due in due if is_due and i > 16]
    assert late and len(set(late)) == 1


def test_lock_step_goes_by_the_world() -> None:
    """Time is the device's; each tick has one due sample, the last; a lost question is asked again."""
    robot = FakeRobot(lock_us=20_000)
    with link_to(robot) as link:
        assert link.facts.lock_step and link.now() == pytest.approx(0.02)
        found = [link.read(0.1) for _ in range(6)]
        assert [sample.due for sample in found if sample] == [False, True] * 3
        assert [sample.t_host for sample in found if sample] == pytest.approx([0.04, 0.04, 0.06, 0.06, 0.08, 0.08])
        link.command(np.zeros(6))
        assert robot.k == 4
        robot.sample = lambda **_: None  # type: ignore[method-assign, assignment]
        assert link.read(0.1) is None, "the world has gone on for 0.1 s and nobody has sent a sample"
        assert link.now() == pytest.approx(0.18)
        assert link.read(1e-20) is None and link.now() == pytest.approx(0.2), "any time-out above 0 goes on"
        assert link.read(0.0) is None and link.now() == pytest.approx(0.2)
        assert link.statistics.clock_offset is None
