"""Ports of the operating system: lines arrive whole, and every death is a LinkError that names the port."""

from __future__ import annotations

import errno
import os
import socket
import termios
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from r2s2r_cli.devices.link import LinkError
from r2s2r_cli.errors import ExitCode, UsageError
from r2s2r_cli.hardware.transport import Transport, port_name, transport
from r2s2r_cli.hardware.transport.gone import port_errors

SOON = 2.0
"""[s] within which something must come that is on its way."""


def lines(port: Transport, count: int) -> list[bytes]:
    """The next lines of a port."""
    found = [port.receive(SOON) for _ in range(count)]
    return [message.line for message in found if message is not None]


class Ends:
    """Both ends of a stream: `port`, open, and what is at the other end."""

    def __init__(self, kind: str) -> None:
        if kind == "pty":
            self.master, slave = os.openpty()
            tty.setraw(slave)
            self.port = transport(os.ttyname(slave))
            self.port.open()
            os.close(slave)
        else:
            server = socket.create_server(("127.0.0.1", 0))
            self.port = transport(f"socket://127.0.0.1:{server.getsockname()[1]}")
            self.port.open()
            other, _ = server.accept()
            server.close()
            self.master = other.detach()

    def say(self, data: bytes) -> None:
        """From the other end."""
        os.write(self.master, data)

    def vanish(self) -> None:
        """The other end is gone."""
        if self.master >= 0:
            os.close(self.master)
        self.master = -1


@pytest.fixture(params=["pty", "tcp"])
def ends(request: pytest.FixtureRequest) -> Iterator[Ends]:
    """A stream of each kind."""
    made = Ends(request.param)
    yield made
    made.port.close()
    made.vanish()


def test_lines_arrive_whole_and_in_both_directions(ends: Ends) -> None:
    """A line in two pieces is one line; what we send is there at the other end; silence is None."""
    ends.say(b"rest of a line\nhel")
    assert ends.port.receive(0.01) is None
    ends.say(b"lo\nworld\n")
    assert lines(ends.port, 2) == [b"hello", b"world"]
    assert ends.port.receive(0.0) is None
    ends.port.send(b"command\n")
    assert os.read(ends.master, 100) == b"command\n"


def test_an_unplugged_port_is_one_error_in_every_call(ends: Ends) -> None:
    """Reading, writing, and reading again after the other end has gone: LinkError, exit code 5, port named."""
    ends.say(b"a\nb\n")
    assert lines(ends.port, 1) == [b"b"]
    ends.vanish()
    for _ in range(2):
        with pytest.raises(LinkError) as caught:
            ends.port.receive(SOON)
        assert ends.port.name in caught.value.where and caught.value.exit_code == ExitCode.HARDWARE
        assert caught.value.hint.startswith("r2s2r doctor ports")
    with pytest.raises(LinkError):
        for _ in range(100):
            ends.port.send(b"x" * 1000)
    ends.port.close()
    ends.port.close()
    for call in (lambda: ends.port.receive(0.0), lambda: ends.port.send(b"x")):
        with pytest.raises(LinkError):
            call()


def test_a_robot_that_does_not_read_is_an_error_and_not_a_wait(ends: Ends) -> None:
    """Once the buffers are full, writing ends by its time-out."""
    with pytest.raises(LinkError, match="does not take"):
        for _ in range(10_000):
            ends.port.send(b"x" * 4096)


def test_a_host_that_nobody_knows_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its name stands in the error, not the resolver's number."""

    def resolve(*_: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "create_connection", resolve)
    with pytest.raises(LinkError, match="no such host") as caught:
        transport("socket://nohost:5").open()
    assert caught.value.received == "nohost" and "nohost" in caught.value.hint


def test_an_address_of_our_own_that_nobody_knows_is_none_of_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of UDP as well no number of the resolver, which the operating system's list calls unknown."""

    class Nameless:
        def __init__(self, *_: object) -> None: ...

        def bind(self, _: object) -> None:
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

        def close(self) -> None: ...

    monkeypatch.setattr(socket, "socket", Nameless)
    with pytest.raises(LinkError, match="does not have that address") as caught:
        transport("udp://nohost:2390").open()
    assert "Unknown error" not in caught.value.received and caught.value.hint == "ip -brief address"


def test_what_cannot_be_opened_is_told_with_its_remedy(tmp_path: Path) -> None:
    """No such port, no port at all, nobody listening, a name that is none."""
    (tmp_path / "file").write_text("")
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        nobody = f"socket://127.0.0.1:{unused.getsockname()[1]}"
        for name, what in (
            (str(tmp_path / "none"), "no such port"), (str(tmp_path / "file"), "no port"),
            (str(tmp_path), "no port"), (nobody, "nobody listens"), ("udp://192.0.2.1:2390", "not have that address"),
        ):  # fmt: skip
            with pytest.raises(LinkError, match=what) as caught:
                transport(name).open()
            assert name in caught.value.where and caught.value.hint
    for name in ("", "udp://host:99999", "socket://host", "http://host:1", "udp://h:1/x"):
        with pytest.raises(UsageError):
            port_name(name)


def test_a_port_belongs_to_one_program() -> None:
    """A second opening of a serial port, and of a UDP address, says who is in the way."""
    master, slave = os.openpty()
    first, second = (transport(os.ttyname(slave)) for _ in range(2))
    first.open()
    with pytest.raises(LinkError, match="another program") as caught:
        second.open()
    assert caught.value.hint.startswith("fuser")
    first.close()
    second.open()
    second.close()
    os.close(master)
    os.close(slave)
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind(("127.0.0.1", 0))
    with pytest.raises(LinkError, match="another program"):
        transport(f"udp://127.0.0.1:{one.getsockname()[1]}").open()
    one.close()


def test_datagrams_carry_the_address_of_their_board() -> None:
    """A datagram is a line, with or without its end; answers go to the address it came from; a huge one is counted."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        number = probe.getsockname()[1]
    port = transport(f"udp://127.0.0.1:{number}")
    port.open()
    boards = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for i, board in enumerate(boards):
        board.bind(("127.0.0.1", 0))
        board.sendto(b"x" * 600, ("127.0.0.1", number))
        board.sendto(b"board %d" % i + b"\n" * i, ("127.0.0.1", number))
    found = [port.receive(SOON) for _ in boards]
    assert [message.line for message in found if message] == [b"board 0", b"board 1"]
    assert port.overlong == 2
    for message, board in zip(found, boards, strict=True):
        assert message is not None and message.source == board.getsockname()
        port.send(b"answer", message.source)
        assert board.recv(100) == b"answer"
        board.close()
        port.send(b"to a board that is gone", message.source)
    port.send(b"nowhere", None)
    assert port.receive(0.05) is None
    port.close()


@pytest.mark.parametrize(
    "error",
    [
        serial.SerialException("device reports readiness to read but returned no data"), OSError(errno.EIO, "plain"),
        termios.error(5, "Input/output error"), TypeError("integer is required"), serial.PortNotOpenError(),
        ValueError("negative file descriptor"), ConnectionResetError(errno.ECONNRESET, "reset"),
    ],
    ids=lambda error: type(error).__name__,
)  # fmt: skip
def test_every_family_of_exceptions_of_a_dead_port_is_the_same_error(error: Exception) -> None:
    """Four families and more; the reason of the operating system stays readable."""
    with pytest.raises(LinkError, match="the link to the robot broke") as caught, port_errors("/dev/ttyX", "reading"):
        raise error
    assert caught.value.where == "/dev/ttyX, reading" and caught.value.received


def test_bugs_stay_bugs() -> None:
    """What is no matter of the port goes through."""
    with pytest.raises(KeyError), port_errors("/dev/ttyX", "reading"):
        raise KeyError("bug")


def test_other_urls_of_pyserial_work_without_a_file_descriptor() -> None:
    """loop:// gives back what it is sent: whole lines, silence as None, one error once closed."""
    port = transport("loop://")
    port.open()
    port.send(b"part\nwhole ")
    assert port.receive(0.03) is None
    port.send(b"line\n")
    assert lines(port, 1) == [b"whole line"]
    port.close()
    with pytest.raises(LinkError):
        port.send(b"x")
