"""Host and rig together: every protocol over every link, and the rig's faults against the duties of the host."""

from __future__ import annotations

import os
import random
import re
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.devices.lengths import Lengths
from r2s2r_cli.devices.link import LinkError, LinkState, SafetyStop
from r2s2r_cli.hardware.guard import GuardedLink
from r2s2r_cli.hardware.open_link import open_link
from r2s2r_cli.rig.world import World
from tests.support.host_rig import follow, running_rig
from tests.support.rig_farm import rig_farm
from tests.support.soak import drawn
from tests.support.wire_robot import calibrated

TARGET = np.array([0.3, 1, 1, 1, 1, 1])
LINKS, PROTOCOLS = ("pty", "tcp", "udp"), ("checked", "legacy", "boards")


@pytest.mark.parametrize(
    ("link", "protocol", "shared"),
    [
        *(
            pytest.param(link, protocol, False, marks=() if i == j else pytest.mark.slow)  # each once in the fast suite
            for i, link in enumerate(LINKS) for j, protocol in enumerate(PROTOCOLS)
        ),
        ("udp", "boards", True), *(pytest.param("udp", name, True, marks=pytest.mark.slow) for name in PROTOCOLS[:2]),
    ],
)  # fmt: skip
def test_the_controller_reaches_its_target_in_every_protocol_over_every_link(
    link: str, protocol: str, shared: bool
) -> None:
    """2 s of the world: cable 0 is wound to its target, nothing is lost, what is measured is what is, motors end at 0.

    The sensors are off by their own errors: 5 mm of bias, 2 mm of bend; 20 mm is four of the whole.
    """
    robot = calibrated()
    with running_rig(robot, link=link, protocol=protocol, shared=shared) as rig:
        with GuardedLink(open_link(rig.address, robot, protocol=protocol), robot) as host:
            samples = follow(host, robot, TARGET, 2.0)
            truth = rig.truth()[0]
            counts = host.statistics
        assert not rig.duty.any()
    lengths = Lengths.of(robot)(samples[-1].capacitance)
    assert np.abs(lengths - truth.length).max() < 0.02
    wanted = robot.pid.min_length_m + 0.3 * robot.pid.range_m
    assert abs(lengths[0] - wanted) < 2 * robot.pid.tolerance * robot.pid.range_m
    assert (counts.corrupt, counts.lost or 0, counts.overlong) == (0, 0, 0)
    assert 90 <= sum(sample.due for sample in samples) <= 100, "the boards' own clocks give the rate"


@pytest.mark.parametrize(
    ("fault", "what", "limit"),
    [
        ({"kind": "sensor_stuck", "sensor": 3}, "0.20 pF", 0.2),
        ({"kind": "sensor_frozen", "sensor": 3}, "frozen", 0.8),
        ({"kind": "sensor_jump", "sensor": 3, "by_m": 0.3}, "out of range", 0.08),
        ({"kind": "board_silent", "board": 1}, "no good reading", 0.2),
    ],
)  # fmt: skip
@pytest.mark.parametrize("protocol", ["checked", "boards"])
def test_a_fault_of_the_sensors_stops_the_rig(fault: dict[str, object], what: str, limit: float, protocol: str) -> None:
    """From 0.5 s on a sensor lies while all motors reel in: they stop within the time of that duty, and stay off."""
    robot = calibrated()
    world = World.model_validate({"faults": [{**fault, "at_s": 0.5}]})
    with running_rig(robot, world, protocol=protocol) as rig:
        with pytest.raises(SafetyStop, match=what), open_link(rig.address, robot, protocol=protocol) as link:
            host = GuardedLink(link, robot)
            host.restart()
            back_and_forth(host)
        stopped = rig.truth()[0].t
        duty = rig.duty
    reached = [0, 2, 4, 5] if (fault["kind"], protocol) == ("board_silent", "boards") else range(6)
    assert not duty[reached].any(), "a board of the authors that is deaf cannot be stopped, all others are"
    assert 0.5 < stopped <= 0.5 + limit + 0.05, "two ticks for the question, the stop and the goodbye"


def back_and_forth(host: GuardedLink) -> None:
    """All motors at full speed, the direction changing every 0.3 s, so that no cable leaves its range; 5 s at most."""
    end = host.now() + 5.0
    while host.now() < end:
        sample = host.read(0.1)
        if sample is not None and sample.due:
            host.command(np.full(6, 1.0 if host.now() % 0.6 < 0.3 else -1.0))


@pytest.mark.parametrize("link", ["pty", pytest.param("udp", marks=pytest.mark.slow)])
def test_a_bad_wire_is_borne_and_counted(link: str) -> None:
    """A fifth of all lines lost, others doubled, late, cut, damaged: the target is reached, all damage is caught.

    No reading that comes through is off: what is measured stays within the noise of what is measured without faults.
    """
    robot = calibrated()
    wire = {"lost": 0.2, "garbage": 0.02, "split": 0.02, "duplicate": 0.05, "reorder": 0.05, "bit_flip": 0.05}
    world = World.model_validate({"wire": wire})
    with running_rig(robot, world, link=link) as rig, GuardedLink(open_link(rig.address, robot), robot) as host:
        samples = follow(host, robot, TARGET, 4.0)
        truth, counts = rig.truth()[0], host.statistics
    lengths = Lengths.of(robot)
    measured = np.array([lengths(sample.capacitance) for sample in samples])
    assert np.nanmax(np.abs(np.diff(measured, axis=0))) < 0.025, "a damaged number came through"
    assert np.abs(measured[-1] - truth.length).max() < 0.02
    assert counts.lost and counts.corrupt and counts.repeated and counts.device_corrupt
    assert 0.1 < counts.lost / (counts.received + counts.lost) < 0.4


@pytest.mark.parametrize(
    ("kind", "link"),
    [
        ("link_gone", "pty"), ("link_stalled", "udp"),
        *(pytest.param(kind, link, marks=pytest.mark.slow) for kind, link in (
            ("link_gone", "tcp"), ("link_gone", "udp"), ("link_stalled", "pty"), ("link_stalled", "tcp"),
        )),
    ],
)  # fmt: skip
def test_a_link_that_goes_ends_as_one_error_and_comes_back(kind: str, link: str, tmp_path: Path) -> None:
    """In real time, after 0.3 s, for 0.6 s: LinkError or stale sensors; the rig's motors are off; reconnect works."""
    robot = calibrated()
    world = World.model_validate({"faults": [{"kind": kind, "at_s": 0.8, "for_s": 0.7}]})
    device = tmp_path / "robot" if link == "pty" else None
    with (
        running_rig(robot, world, link=link, lock=False, device=device) as rig,
        GuardedLink(open_link(rig.address, robot), robot) as host,
    ):
        with pytest.raises((LinkError, SafetyStop)) as caught:
            back_and_forth(host)
        assert rig.address in caught.value.where and caught.value.hint
        deadline = time.monotonic() + 30
        while rig.duty.any() and time.monotonic() < deadline:
            time.sleep(0.005)
        assert not rig.duty.any()
        if isinstance(caught.value, SafetyStop):
            host.reset()
        else:
            assert host.state is LinkState.LOST
            host.reconnect(timeout=30.0)
        assert len(follow(host, robot, TARGET, 0.2)) > 5


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ["checked", "boards"])
def test_unpluggings_at_random_moments(protocol: str) -> None:
    """The rig's process is killed under a running controller at 8 moments in each protocol (25 in a soak test), over
    all links in turn.

    One clear error each time, exit code 5, and what became of the motors where a port died.
    """
    robot, draw = calibrated(), random.Random(protocol)
    with rig_farm() as farm:
        for i in range(drawn(8, 25)):
            pid, address = farm.grow(LINKS[i % 3], protocol)
            killer = threading.Timer(draw.uniform(0.05, 0.4), farm.kill, (pid,))
            with pytest.raises((LinkError, SafetyStop)) as caught:
                killer.start()
                with GuardedLink(open_link(address, robot, protocol=protocol), robot) as host:
                    back_and_forth(host)
            killer.join()
            error = caught.value
            assert address in error.where and error.exit_code == 5 and error.hint
            assert isinstance(error, SafetyStop) or "stop" in error.received.lower() or "handshake" in error.where


@pytest.mark.parametrize("protocol", PROTOCOLS[:2])
def test_a_host_that_follows_another_unseen_is_answered(protocol: str) -> None:
    """The port is closed and opened again between two looks at it: as if somebody had held it open meanwhile. A rig in
    lock-step that waits for the first host's next tick would wait for ever."""
    robot = calibrated()
    with running_rig(robot, protocol=protocol) as rig:
        with open_link(rig.address, robot, protocol=protocol) as link:
            follow(link, robot, TARGET, 0.1)
            held = os.open(rig.address, os.O_RDWR | os.O_NOCTTY)
        try:
            with open_link(rig.address, robot, protocol=protocol) as link:
                assert len(follow(link, robot, TARGET, 0.1)) > 0
        finally:
            os.close(held)


def _guide(name: str) -> dict[str, Any]:
    """What the first Python block of a guide defines."""
    page = (Path(__file__).parents[2] / "docs" / "guides" / name).read_text()
    found = re.search(r"^```python\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {}
    exec(found[1], names)  # the guide is ours
    return names


def test_the_library_of_the_guide_works() -> None:
    """The Python block of docs/guides/connect.md, as it stands there, drives the rig to a target."""
    robot = calibrated()
    with running_rig(robot) as rig:
        length = _guide("connect.md")["to_target"](rig.address, robot, TARGET)
        assert not rig.duty.any()
    position = (length[:6] - robot.pid.min_length_m) / robot.pid.range_m
    assert np.abs(position - TARGET).max() < 1.5 * robot.pid.tolerance


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_the_script_of_the_guide_finds_a_wrong_sign(protocol: str) -> None:
    """The script of docs/guides/record.md: every motor shortens its own cable, but the one whose sign is wrong."""
    robot = calibrated()
    wrong = robot.motors[2].model_copy(update={"sign": -robot.motors[2].sign})
    told = robot.model_copy(update={"motors": (*robot.motors[:2], wrong, *robot.motors[3:])})
    with running_rig(robot, protocol=protocol) as rig:
        found = np.array(list(_guide("record.md")["changes"](rig.address, told, protocol)))
    own = np.diag(found)
    assert (np.delete(own, 2) < -0.005).all() and own[2] > 0.005, own
    assert (np.abs(found).argmax(axis=1) == np.arange(len(own))).all()
