"""The rig's loop, from outside: lock-step over every link, and the faults of the link itself. No physics here."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from r2s2r_cli.rig.clock import RealClock, TickClock
from r2s2r_cli.rig.server import STEP_S, Server
from r2s2r_cli.rig.transport import open_transport
from r2s2r_cli.rig.transport.port import Port
from r2s2r_cli.rig.wire import PROTOCOLS, device_codec
from r2s2r_cli.rig.world import Wire, World
from tests.support.rig_host import RawHost, bound, line
from tests.support.rig_machine import Machine
from tests.support.rig_robots import known

LINKS = ("pty", "tcp", "udp")
TICK_S = 0.02


class Served(NamedTuple):
    """Both ends: a host, what it drives, and the loop between."""

    host: RawHost
    machine: Machine
    server: Server


@contextmanager
def served(link: str, protocol: str, world: World, *, lock: bool = True, name: Path | None = None) -> Iterator[Served]:
    """A rig without physics in a thread, and a host that is connected to it."""
    machine = Machine()
    codec = device_codec(protocol, known(), machine, boards=3, tick_us=20000 if lock else 0)
    port = bound() if link == "udp" else None
    transport = open_transport(link, port=port.getsockname()[1] if port else None, boards=3, name=name)
    clock = TickClock(TICK_S) if lock else RealClock()
    over = threading.Event()
    server = Server(machine, codec, Port(transport, codec, world, lock=lock), world, clock=clock)
    thread = threading.Thread(target=server.run, args=(over.is_set,))
    thread.start()
    try:
        with RawHost(transport.address, port) as host:
            yield Served(host, machine, server)
    finally:
        over.set()
        thread.join()
        transport.close()


def greet(host: RawHost, link: str, protocol: str) -> None:
    """Until the host knows of lock-step, and over UDP of a board's address."""
    if protocol == "checked":
        if link == "udp":
            host.until(b",H,1,")
        host.send(line("0,H,1,test"))
        host.until(b",20000*")
    else:
        host.until(b"#lockstep 20000")


def ask(k: int, protocol: str) -> tuple[bytes, bytes]:
    """How tick k is asked for, and what its answer has in it."""
    if protocol == "checked":
        return line(f"{2 * k},T,{k}"), f",T,{k},".encode()
    return b"          #tick %d\n" % k, b"#tick %d " % k


def drive(k: int, protocol: str, speed: float) -> bytes:
    """A command of one speed for all motors."""
    if protocol == "checked":
        return line(",".join([str(2 * k - 1), "C", *[f"{speed:.3f}"] * 6]))
    if protocol == "boards":
        return ("0 0 0 " + f"{99 * speed:.2f} " * 6 + "0 0 0\n").encode()
    return b"".join(b"          d %d %.2f\n" % (i, 99 * speed) for i in range(1, 7))


def session(link: str, protocol: str, world: World, ticks: int = 40) -> list[bytes]:
    """What a host hears that drives all motors for some ticks, from the first tick on."""
    heard: list[bytes] = []
    with served(link, protocol, world) as (host, machine, _):
        greet(host, link, protocol)
        for k in range(1, ticks + 1):
            for part in drive(k, protocol, 0.02 * k).splitlines(keepends=True):
                host.send(part, everywhere=protocol == "boards")
            question, answer = ask(k, protocol)
            host.send(question)
            heard += host.until(answer)
        heard += [b"duty %.3f at %.3f" % (duty[0], t) for t, duty in machine.log if duty.any()]
    return heard


@pytest.mark.parametrize("protocol", PROTOCOLS)
@pytest.mark.parametrize("link", LINKS)
def test_lock_step_over_every_link_in_every_protocol(link: str, protocol: str) -> None:
    """Forty ticks: answered in turn at their times, with the samples of each in between and the motors obeying."""
    heard = session(link, protocol, World())
    _, mark = ask(1, protocol)
    answers = [one for one in heard if mark.replace(b"1", b"")[:3] in one and b"lockstep" not in one]
    times = [int(one.partition(b"*")[0].replace(b",", b" ").split()[-1]) for one in answers]
    assert times == [20000 * k for k in range(1, 41)]
    samples = {"checked": b",S,", "boards": b" 0.00 ", "legacy": b"S 0x"}[protocol]
    boards = 1 if protocol == "legacy" else 3
    assert sum(samples in one for one in heard) >= 40 * boards - 3
    assert any(one.startswith((b"duty 0.8", b"duty 0.79")) for one in heard)


@pytest.mark.parametrize(
    ("link", "protocol"), [("pty", "checked"), ("udp", "boards"), ("udp", "checked"), ("tcp", "legacy")]
)
def test_equal_seeds_give_equal_bytes(link: str, protocol: str) -> None:
    """Two sessions with every fault of the wire are the same to the last byte; another seed gives another one."""
    wire = Wire(
        lost=0.1, garbage=0.1, split=0.1, duplicate=0.1, reorder=0.1, bit_flip=0.1, delay_s=0.004, delay_jitter_s=0.01
    )
    first, again, other = (session(link, protocol, World(seed=seed, wire=wire)) for seed in (5, 5, 6))
    assert first == again
    assert first != other


def test_a_tick_asked_twice_is_answered_twice_and_counts_once() -> None:
    """Repeats are answered with the same time; a number out of turn is passed over."""
    with served("tcp", "boards", World()) as (host, machine, _):
        greet(host, "tcp", "boards")
        host.send(b"#tick 1\n#tick 1\n#tick 3\n#tick 2\n")
        heard = [one for one in host.until(b"#tick 2") if one.startswith(b"#tick")]
        assert heard == [b"#tick 1 20000", b"#tick 1 20000", b"#tick 2 40000"]
        assert machine.t == pytest.approx(0.04)


def test_time_stands_still_between_ticks() -> None:
    """Half a second of the wall without a tick is no time for the world: the watchdog does not bite."""
    with served("tcp", "checked", World()) as (host, machine, _):
        greet(host, "tcp", "checked")
        host.send(drive(1, "checked", 1.0))
        host.send(ask(1, "checked")[0])
        host.until(b",T,1,")
        time.sleep(0.5)
        assert machine.duty.all()
        for k in range(2, 14):
            host.send(ask(k, "checked")[0])
            host.until(b",T,%d," % k)
        assert not machine.duty.any()


@pytest.mark.parametrize("link", ["pty", "tcp"])
def test_a_host_that_hangs_up_stops_the_motors(link: str) -> None:
    """Our protocol: the stream closes, the motors stop at once; the next host is served."""
    with served(link, "checked", World(), lock=False) as (host, machine, _):
        for _ in range(2):
            host.open()
            host.send(line("0,H,1,test"))
            host.until(b",K,0,0,")
            host.send(drive(1, "checked", 1.0))
            host.until(b",K,1,0,")
            assert machine.duty.all()
            host.close()
            wait_still(machine)


@pytest.mark.parametrize("link", LINKS)
def test_silence_stops_the_motors_in_time(link: str) -> None:
    """A host that no longer commands, its port open: all off within a quarter of a second of its last command.

    Where this machine is so busy that the loop itself was late, by that much more.
    """
    with served(link, "checked", World(), lock=False) as (host, machine, server):
        host.until(b",H,1,")
        host.send(line("0,H,1,test"))
        host.until(b",K,0,0,")
        host.send(drive(1, "checked", 1.0))
        host.until(b",K,1,0,")
        wait_still(machine)
        (on, _), (off, duty) = [entry for entry in machine.log if entry[0] > 0][-2:]
        assert not duty.any()
        assert 0.2 < off - on <= 0.25 + max(server.latest_s - 2 * STEP_S, 0.0)


@pytest.mark.parametrize("link", ["pty", "tcp"])
def test_a_torn_link_comes_back_when_it_is_mended(link: str, tmp_path: Path) -> None:
    """`link_gone`: the host reads the end, and the motors of our protocol stop; after `for_s` there is a port again."""
    fault = {"kind": "link_gone", "at_s": 0.3, "for_s": 0.3}
    world, name = World.model_validate({"faults": [fault]}), tmp_path / "robot" if link == "pty" else None
    with served(link, "checked", world, lock=False, name=name) as (host, machine, _):
        host.send(line("0,H,1,test"))
        with pytest.raises(EOFError):
            while True:
                host.send(line("1,B"))
                host.read(0.05)
        assert not machine.duty.any()
        host.close()
        end = time.monotonic() + 30.0
        while True:
            try:
                host.open()
                break
            except OSError:
                assert time.monotonic() < end
                time.sleep(0.05)
        host.until(b",H,1,")


def test_a_stalled_link_says_nothing_and_goes_on() -> None:
    """`link_stalled`: for its time nothing is read or sent while the port stays open; the watchdog bites meanwhile."""
    fault = {"kind": "link_stalled", "at_s": 0.2, "for_s": 0.5}
    with served("tcp", "checked", World.model_validate({"faults": [fault]}), lock=False) as (host, machine, _):
        host.send(line("0,H,1,test"))
        k, gap, last, moved = 1, 0.0, time.monotonic(), False
        while machine.t < 1.0:
            host.send(drive(k, "checked", 0.5))
            k += 1
            if host.read(0.02):
                gap, last = max(gap, time.monotonic() - last), time.monotonic()
            moved |= machine.t < 0.2 and bool(machine.duty.all())
        assert moved
        assert gap > 0.45
        assert any(0.2 < t < 0.7 and not duty.any() for t, duty in machine.log)


def wait_still(machine: Machine) -> None:
    """Until no motor has a duty."""
    end = time.monotonic() + 30.0
    while machine.duty.any() and time.monotonic() < end:
        time.sleep(0.001)
    assert not machine.duty.any()
