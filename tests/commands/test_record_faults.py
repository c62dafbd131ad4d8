"""Everything that can break while a robot is recorded, one at a time, on a rig in a process of its own.

In every case: the motors stop within 250 ms where anybody can make them, what was recorded is sealed, exit code 5 with
port and next step; or the recording goes on, and what was lost is counted. The times of the table in
docs/guides/record.md: `pytest -m slow tests/commands/test_record_faults.py --log-cli-level=INFO`.
"""

from __future__ import annotations

import json
import logging
import multiprocessing
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.journal import Journal
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from schemas.robot import Robot
from tests.commands.conftest import invoke
from tests.support.desk import Desk, desk, link_options, project, read_truth, wait_until
from tests.support.soak import drawn

LOG = logging.getLogger(__name__)
KILLS = drawn(15, 50)
LIMIT_S = 0.25
TICK_S = 0.02
RECORDING = "iterations/001/10-record.h5"
LONG = ("--random", "40", "--no-draw", "--force", "--set", "record.rest_s=0.0")


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project of a calibrated robot."""
    return project(tmp_path_factory.mktemp("faults") / "p")


def record(root: Path, address: str, *more: str) -> Any:
    """The result of a recording of 40 targets, which takes a minute of the robot's time."""
    return invoke("record", "--project", str(root), "--port", address, *LONG, *more)


def sealed(root: Path) -> tuple[dict[str, Any], int]:
    """Report of the only run, and how many samples are in the file. Fails where a journal was left behind."""
    assert not list((root / "iterations" / "001").glob("*.journal"))
    header, data = read_artifact(root / RECORDING, "recording")
    (run,) = header.provenance.report["runs"]
    sensors = data.group(run["run"], "sensors")
    return run, 0 if sensors is None else len(sensors["t"])


def stopped_after(rig: Desk, at_s: float, what: str) -> float:
    """How long after `at_s` of the rig's time a motor still had a duty [s]."""
    truth = read_truth(rig.truth)
    driven = truth.t[(truth.duty != 0).any(axis=1) & (truth.t > at_s)]
    after = float(driven[-1] - at_s) if len(driven) else 0.0
    LOG.info("%s: motors off after %.0f ms", what, 1e3 * after)
    return after


def serve(robot: Robot, pipe: Connection) -> None:
    """A rig in lock-step over TCP, until it is killed."""
    from r2s2r_cli.rig.assembly import Outlet, Rig
    from r2s2r_cli.rig.world import World

    with Rig(robot, World(), Outlet(link="tcp", lock=True)) as rig:
        pipe.send(rig.address)
        rig.serve(lambda: False)


@contextmanager
def forked(robot: Robot) -> Iterator[tuple[str, Any]]:
    """The same in a child that has MuJoCo already: address and process."""
    ours, theirs = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(target=serve, args=(robot, theirs), daemon=True)
    child.start()
    try:
        assert ours.poll(120), "the rig did not start"
        yield ours.recv(), child
    finally:
        child.kill()
        child.join()


@pytest.mark.slow
def test_the_plug_is_pulled_at_random_moments(root: Path) -> None:
    """The rig is killed anywhere between the handshake and a second later, KILLS times: exit code 5, the port and a
    hint in the message, and all samples that came are in a sealed file; or none came, and none is there."""
    import mujoco  # noqa: F401 - once, before the forks

    robot, generator = Project.find(root).robot(), np.random.default_rng(5)
    lengths = []
    for _ in range(KILLS):
        (root / RECORDING).unlink(missing_ok=True)
        with forked(robot) as (address, child):
            timer = threading.Timer(generator.uniform(0.0, 1.0), child.kill)
            timer.start()
            result = record(root, address, "--json")
            timer.join()
        assert result.exit_code == 5, result.stderr
        said = json.loads(result.stdout)
        assert address in said["where"] and said["hint"].startswith("r2s2r "), said
        if (root / RECORDING).exists():
            run, samples = sealed(root)
            assert run["samples"] == samples and run["ended"] == said["what"]
            lengths.append(samples)
    assert len(lengths) > KILLS / 3 and np.ptp(lengths) > 100  # moments of all sorts were hit


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "word"),
    [
        ('kind = "sensor_stuck"\nsensor = 1', "0.20 pF"),
        ('kind = "sensor_jump"\nsensor = 1\nby_m = 0.5', "length out of range"),
        ('kind = "board_silent"\nboard = 1', "stale sensors"),
        ('kind = "link_stalled"', ""),
        ('kind = "link_gone"', ""),
    ],
)
def test_a_fault_of_the_robot_stops_it(root: Path, fault: str, word: str) -> None:
    """Four seconds into the run: exit code 5 with the port, motors off within 250 ms, run sealed."""
    at_s = 4.0
    with desk(root, "--link", "tcp", world=f"[[faults]]\n{fault}\nat_s = {at_s}\n") as rig:
        result = record(root, rig.address)
        late = stopped_after(rig, at_s, fault.split()[2])
    assert result.exit_code == 5, result.stderr
    assert word in result.stderr and rig.address in result.stderr and "hint: r2s2r" in result.stderr
    assert late <= LIMIT_S + 2 * TICK_S
    run, samples = sealed(root)
    assert run["ended"] != "complete" and samples > 100


@pytest.mark.slow
@pytest.mark.parametrize("at_s", [3.0, 3.7, 4.4])
def test_a_frozen_sensor_stops_the_robot(root: Path, at_s: float) -> None:
    """Exit code 5; all motors are off within 250 ms of the motor of that cable being driven on the frozen value (while
    it rests nothing depends on the value), and nothing moves again; the run is sealed."""
    with desk(root, "--link", "tcp", world=f'[[faults]]\nkind = "sensor_frozen"\nsensor = 1\nat_s = {at_s}\n') as rig:
        result = record(root, rig.address)
        truth = read_truth(rig.truth)
    assert result.exit_code == 5 and "frozen sensor" in result.stderr and rig.address in result.stderr, result.stderr
    robot = Project.find(root).robot()
    motor = [one.cable for one in robot.motors].index(robot.sensors[1].cable)
    driven = (truth.duty[:, motor] != 0) & (truth.t > at_s)
    assert driven.any()
    on_it = float(np.sum(np.diff(truth.t, prepend=truth.t[0])[driven]))
    LOG.info("sensor_frozen at %g s: motors off after %.0f ms of its motor", at_s, 1e3 * on_it)
    assert on_it <= LIMIT_S + 2 * TICK_S
    assert not truth.duty[truth.t > truth.t[driven][-1] + 2 * TICK_S].any()
    run, samples = sealed(root)
    assert run["ended"] != "complete" and samples > 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wire", "link", "counted"),
    [
        ("garbage = 0.03", "tcp", "corrupt"),
        ("split = 0.1", "tcp", None),
        ("duplicate = 0.1", "tcp", "repeated"),
        ("reorder = 0.05", "tcp", "reordered"),
        ("bit_flip = 0.05", "tcp", "corrupt"),
        ("lost = 0.2", "udp", "lost"),
    ],
)
def test_a_bad_wire_is_lived_with_and_counted(root: Path, wire: str, link: str, counted: str | None) -> None:
    """Our protocol over a wire that harms up to a fifth of the lines: the run is completed, the harm is counted, and
    no length in the recording is one that the robot cannot have."""
    with desk(root, *link_options(link), "--fast", world=f"[wire]\n{wire}\n") as rig:
        result = record(root, rig.address, "--random", "4")
    assert result.exit_code == 0, result.stderr
    run, _ = sealed(root)
    assert counted is None or run[counted] > 20, run
    _, data = read_artifact(root / RECORDING, "recording")
    length = data.group(run["run"], "sensors")["length"]  # type: ignore[index]
    assert np.nanmin(length) > 0.05 and np.nanmax(length) < 0.36


@pytest.mark.slow
def test_a_clock_that_jumps_is_counted_and_harms_nothing(root: Path) -> None:
    """A board's clock leaps by an hour: the stamps of the run are the host's and rise, the jump is in the report."""
    world = '[[faults]]\nkind = "clock_jump"\nboard = 1\nby_s = -3600.0\nat_s = 3.0\n'
    with desk(root, "--link", "tcp", world=world) as rig:
        result = record(root, rig.address, "--random", "3")
    assert result.exit_code == 0, result.stderr
    run, _ = sealed(root)
    assert run["clock_jumps"] >= 1
    _, data = read_artifact(root / RECORDING, "recording")
    assert (np.diff(data.group(run["run"], "sensors")["t"]) >= 0).all()  # type: ignore[index]


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["gone_at_s", "stalled_from_s"])
def test_a_camera_that_goes_stops_the_robot(root: Path, fault: str) -> None:
    """Its cable is pulled in the middle of a run, or it falls silent: exit code 5, motors off within 250 ms (a silent
    one is given up after camera_gone_s, the motors are held until then), lengths and pictures until then sealed. A busy
    machine may pause the host itself: the time is that of the best of three runs."""
    late: list[float] = []
    while len(late) < 3 and min(late, default=np.inf) > LIMIT_S + 2 * TICK_S:
        with desk(root, "--link", "tcp", "--camera-port", "0", world=f"[camera.faults]\n{fault} = 10.0\n") as rig:
            assert rig.camera is not None
            result = record(root, rig.address, "--camera", rig.camera)
            late.append(stopped_after(rig, 10.0, f"camera {fault}"))
        assert result.exit_code == 5, result.stderr
        assert "camera" in result.stderr and "hint: " in result.stderr
        run, _ = sealed(root)
        assert run["camera"]["frames"] > 20
    assert min(late) <= LIMIT_S + 2 * TICK_S


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 130), (signal.SIGINT, 130), (signal.SIGKILL, -9)])
def test_a_host_that_ends_leaves_a_robot_at_rest(root: Path, number: int, code: int) -> None:
    """A polite kill and Ctrl-C: sealed, code 130. A rude kill: the device's own watchdog stops it, `recover` seals."""
    (root / RECORDING).unlink(missing_ok=True)
    with desk(root, "--link", "tcp") as rig:
        command = [sys.executable, "-m", "r2s2r_cli", "record", "--project", str(root), "--port", rig.address, *LONG]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as host:
            wait_until(lambda: rig.truth.exists() and int(read_truth(rig.truth).duty.any(axis=1).sum()) > 50, 20.0)
            host.send_signal(number)
            _, said = host.communicate(timeout=300)
        gone_s = read_truth(rig.truth).t[-1]
        wait_until(lambda: read_truth(rig.truth).t[-1] > gone_s + 1.0)
        assert stopped_after(rig, gone_s, f"host {number.name}") <= LIMIT_S + 2 * TICK_S
    assert host.returncode == code, said
    if number == signal.SIGKILL:
        assert invoke("recover", "--project", str(root)).exit_code == 0
        _, data = read_artifact(root / RECORDING, "recording")
        assert data.groups["runs/random-0"].attributes["recovered"]
        assert len(data.group("random-0", "sensors")["t"]) > 10  # type: ignore[index]
    else:
        run, samples = sealed(root)
        assert run["ended"] == "interrupted" and samples > 10


@pytest.mark.slow
def test_a_full_disk_stops_the_robot_and_keeps_what_it_had(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No room for the 3000th row: exit code 5 with the disk's hint, motors off, what was written is sealed."""
    append, rows, full_s = Journal.append, [], []

    def refuse(journal: Journal, stream: str, row: Any) -> None:
        rows.append(stream)
        if len(rows) > 3000:
            full_s.append(read_truth(rig.truth).t[-1])
            raise ArtifactError("the disk is full", where=str(journal.path), hint="df -h .")
        append(journal, stream, row)

    monkeypatch.setattr(Journal, "append", refuse)
    with desk(root, "--link", "tcp", "--fast") as rig:
        result = record(root, rig.address)
        truth = read_truth(rig.truth)
        assert stopped_after(rig, full_s[0], "disk full") <= LIMIT_S
    assert result.exit_code == 5 and "df -h" in result.stderr, result.stderr
    assert not truth.duty[-1].any()
    run, samples = sealed(root)
    assert run["ended"].startswith("the recording cannot be written") and 100 < samples < 3000
