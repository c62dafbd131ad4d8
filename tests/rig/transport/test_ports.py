"""The rig's ports: what a host does to them, and what they do to a host."""

from __future__ import annotations

import os
import socket
import termios
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from r2s2r_cli.errors import HardwareError, UsageError
from r2s2r_cli.rig.transport import Event, Transport, open_transport
from r2s2r_cli.rig.transport.outbox import Outbox
from r2s2r_cli.rig.transport.pty import PtyTransport
from r2s2r_cli.rig.transport.tcp import TcpTransport
from r2s2r_cli.rig.transport.udp import UdpTransport

PATIENCE_S = 30.0


def wait(transport: Transport, kind: str) -> Event:
    """Poll until something of this kind happens."""
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        for event in transport.poll(0.01):
            if event.kind == kind:
                return event
    raise AssertionError(f"never {kind}")


def until(read: Callable[[], bytes], ending: bytes) -> bytes:
    """Read until it ends so."""
    data, end = b"", time.monotonic() + PATIENCE_S
    while not data.endswith(ending) and time.monotonic() < end:
        data += read()
    return data


@pytest.fixture
def pty() -> Iterator[PtyTransport]:
    """A pty that nobody has open."""
    transport = PtyTransport()
    yield transport
    transport.close()


@pytest.fixture
def tcp() -> Iterator[TcpTransport]:
    """TCP at any free port."""
    transport = TcpTransport()
    yield transport
    transport.close()


def opened(device: str) -> int:
    """The host's end of a pty, as a serial port is opened."""
    fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(fd)
    return fd


def tcp_port(transport: TcpTransport) -> tuple[str, int]:
    """Where to connect."""
    host, _, port = transport.address.removeprefix("socket://").partition(":")
    return host, int(port)


def test_a_pty_sees_its_host_come_speak_and_go(pty: PtyTransport) -> None:
    """Opened, bytes both ways, closed, and the same again with another host, who reads nothing of the first."""
    for _ in range(2):
        fd = opened(pty.address)
        wait(pty, "opened")
        os.write(fd, b"hello\n")
        assert wait(pty, "bytes").data == b"hello\n"
        pty.send(b"good day\n", 0)
        os.set_blocking(fd, True)
        assert until(lambda fd=fd: os.read(fd, 100), b"\n") == b"good day\n"  # type: ignore[misc]
        pty.send(b"unread\n", 0)
        os.close(fd)
        wait(pty, "closed")
        assert not pty.connected


def test_a_pulled_plug_hangs_up_and_comes_back_under_its_name(tmp_path: Path) -> None:
    """After `drop` the host's reads end and the name is gone; after `restore` the name leads to a port that works."""
    name = tmp_path / "robot"
    pty = PtyTransport(name)
    fd = opened(str(name))
    wait(pty, "opened")
    pty.drop()
    assert not name.exists()
    with pytest.raises((OSError, termios.error)):
        assert os.read(fd, 10) == b""
        termios.tcgetattr(fd)
    os.close(fd)
    pty.restore()
    fd = opened(pty.address)
    wait(pty, "opened")
    os.close(fd)
    pty.close()
    assert not name.is_symlink()


def test_a_name_that_is_taken_is_refused(tmp_path: Path) -> None:
    """A file in the way of --device is an error of the port, and stays."""
    (tmp_path / "robot").write_text("mine")
    with pytest.raises(HardwareError, match="cannot have that name"):
        PtyTransport(tmp_path / "robot")
    assert (tmp_path / "robot").read_text() == "mine"


def test_a_name_that_another_has_taken_over_stays(tmp_path: Path) -> None:
    """A second rig replaces the link of the first, and keeps it when the first one ends."""
    name = tmp_path / "robot"
    first, second = PtyTransport(name), PtyTransport(name)
    first.close()
    fd = opened(str(name))
    wait(second, "opened")
    os.close(fd)
    second.close()
    assert not name.is_symlink()


def test_a_host_that_does_not_read_blocks_nobody(pty: PtyTransport, tcp: TcpTransport) -> None:
    """A megabyte to a host that never reads is sent as far as there is room, and then lost, without waiting."""
    fd = opened(pty.address)
    host = socket.create_connection(tcp_port(tcp))
    wait(pty, "opened")
    wait(tcp, "opened")
    for _ in range(16000):
        pty.send(b"x" * 63 + b"\n", 0)
        tcp.send(b"x" * 63 + b"\n", 0)
    assert pty._outbox.lost > 0
    os.close(fd)
    host.close()


def test_outbox_loses_whole_lines_only() -> None:
    """What was begun is ended, what finds no room is lost whole, and the rest comes in order."""
    outbox, sent = Outbox(room=30), bytearray()
    for k in range(5):
        outbox.put(b"line %d ok\n" % k)
    assert outbox.lost == 2
    room = [7, 0, 20, 9]

    def write(data: bytes) -> int:
        if not room or room[0] == 0:
            room[:1] = []
            raise BlockingIOError
        taken = min(room.pop(0), len(data))
        sent.extend(data[:taken])
        return taken

    for _ in range(8):
        outbox.flush(write)
        room.append(100)
    assert bytes(sent) == b"line 0 ok\nline 1 ok\nline 2 ok\n"


def test_tcp_serves_one_host_at_a_time(tcp: TcpTransport) -> None:
    """A second host is turned away, the first keeps talking; when it has gone, the next is served."""
    first = socket.create_connection(tcp_port(tcp))
    wait(tcp, "opened")
    second = socket.create_connection(tcp_port(tcp))
    second.settimeout(PATIENCE_S)
    for _ in range(3):
        tcp.poll(0.05)
    assert second.recv(10) == b""
    first.sendall(b"still here\n")
    assert wait(tcp, "bytes").data == b"still here\n"
    first.close()
    wait(tcp, "closed")
    third = socket.create_connection(tcp_port(tcp))
    wait(tcp, "opened")
    third.close()
    second.close()


def test_tcp_that_is_torn_refuses_and_comes_back(tcp: TcpTransport) -> None:
    """After `drop` the host reads the end and nobody gets in; after `restore` the same port is there again."""
    at = tcp_port(tcp)
    host = socket.create_connection(at)
    host.settimeout(PATIENCE_S)
    wait(tcp, "opened")
    tcp.drop()
    assert host.recv(10) == b""
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(at)
    tcp.restore()
    again = socket.create_connection(at)
    wait(tcp, "opened")
    again.close()
    host.close()


def test_tcp_port_that_is_taken_is_one_clear_error(tcp: TcpTransport) -> None:
    """A port in use is a HardwareError that names it."""
    with pytest.raises(HardwareError, match="cannot be opened") as caught:
        TcpTransport(port=tcp_port(tcp)[1])
    assert str(tcp_port(tcp)[1]) in caught.value.where


@pytest.mark.parametrize("shared", [False, True])
def test_udp_boards_speak_first_from_addresses_of_their_own(shared: bool) -> None:
    """Every board sends from its own socket to the host's fixed address and hears what is sent to that one."""
    host = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    host.bind(("127.0.0.1", 0))
    host.settimeout(PATIENCE_S)
    udp = UdpTransport(port=host.getsockname()[1], boards=3, shared=shared)
    from_ = []
    for board in range(3):
        udp.send(b"board %d" % board, board)
        data, address = host.recvfrom(100)
        assert data == b"board %d" % board
        from_.append(address)
    assert len(set(from_)) == (1 if shared else 3)
    host.sendto(b"to the second", from_[1])
    event = wait(udp, "bytes")
    assert (event.data, event.board) == (b"to the second", None if shared else 1)
    udp.drop()
    udp.send(b"lost", 0)
    udp.restore()
    udp.send(b"back", 2)
    assert host.recv(100) == b"back"
    udp.close()
    host.close()


@pytest.mark.parametrize("transport", [TcpTransport, UdpTransport])
@pytest.mark.parametrize("host", ["nobody.invalid", "::1", "\u00fc" + "x" * 80])
def test_a_host_that_is_none_is_one_clear_error(transport: type[TcpTransport] | type[UdpTransport], host: str) -> None:
    """A name that nobody has is no port in use, and no rig that sends to nobody for ever."""
    with pytest.raises(HardwareError, match="no such host") as caught:
        transport(host)
    assert host in caught.value.where


def test_links_have_names() -> None:
    """An unknown link is refused with those there are; UDP goes to 2390 by default."""
    with pytest.raises(UsageError, match="pty, tcp, udp"):
        open_transport("can")
    udp = open_transport("udp")
    assert udp.address == "udp://127.0.0.1:2390"
    udp.close()
