"""`r2s2r rig` as a user meets it: a process of its own, with the physics."""

from __future__ import annotations

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.errors import ExitCode
from schemas.results_rig import RigResult
from tests.commands.conftest import document, invoke
from tests.support.rig_host import RawHost, line

COMMAND = [sys.executable, "-m", "r2s2r_cli", "rig"]


@contextmanager
def running(folder: Path, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The command in a process of its own; killed at the end, if it still runs."""
    child = subprocess.Popen(
        [*COMMAND, *arguments], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # Under nohup a suite ignores SIGHUP, and so would what it starts.
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )  # fmt: skip
    try:
        yield child
    finally:
        child.kill()
        child.communicate()


@pytest.mark.parametrize(
    "number", [signal.SIGINT, *(pytest.param(one, marks=pytest.mark.slow) for one in (signal.SIGTERM, signal.SIGHUP))]
)
def test_it_prints_the_device_and_ends_when_told(project: Path, number: signal.Signals) -> None:
    """One line on stdout, which can be opened; Ctrl-C, SIGTERM and a closed terminal end it well, and the name of the
    device goes: later it could lead to another terminal."""
    with running(project, "--device", "robot") as child:
        assert child.stdout is not None
        assert child.stdout.readline() == "robot\n"
        with RawHost(str(project / "robot")) as host:
            host.until(b",H,1,")
        child.send_signal(number)
        out, err = child.communicate(timeout=120)
    assert (child.returncode, out) == (0, "")
    assert "speaks checked" in err
    assert not (project / "robot").is_symlink()


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_lock_step_from_end_to_end(project: Path, times: int) -> None:
    """Winches wind, sensors and the log of the truth show it; the same run in another process is the same bytes (the
    bytes of equal seeds in one process: tests/rig/test_server.py)."""
    runs = []
    for name in ("a.csv", "b.csv")[:times]:
        heard = []
        with running(project, "--fast", "--link", "tcp", "--json", "--truth", name, "--seed", "3") as child:
            assert child.stdout is not None
            text = ""
            while not text.endswith("}\n"):
                text += child.stdout.readline()
            told = RigResult.model_validate(json.loads(text))
            assert (told.lock_step, told.boards, told.camera, told.pid) == (True, 3, None, child.pid)
            with RawHost(told.device) as host:
                host.send(line("0,H,1,test"))
                host.until(b",20000*")
                for k in range(1, 51):
                    host.send(line(f"{2 * k - 1},C,0.8,0,0,0,0,0"))
                    host.send(line(f"{2 * k},T,{k}"))
                    heard += host.until(b",T,%d," % k)
        runs.append(heard)
    assert runs == [runs[0]] * times
    samples = [one.split(b"*")[0].split(b",") for one in runs[0] if b",S," in one]
    capacitance = np.array([float(fields[6]) for fields in samples if fields[6]])
    with (project / "a.csv").open() as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    assert rows[0]["t_s"] < 0.03 and abs(rows[-1]["t_s"] - 1.0) < 0.03
    wound = rows[0]["length0_m"] - rows[-1]["length0_m"]
    assert 0.02 < wound < 0.08
    # 0.03 pF/mm where robot.toml has no calibration; lag and noise of the sensor are a few millimetres.
    assert abs((capacitance[0] - capacitance[-1]) / 30.0 - wound) < 0.01
    assert rows[25]["duty0"] == pytest.approx(203 / 255, abs=0.01)
    if times == 2:
        assert (project / "a.csv").read_bytes() == (project / "b.csv").read_bytes()


def test_without_mujoco_it_says_what_to_install(tmp_path: Path) -> None:
    """The README's first installation is without the extra `rig`; nothing imports MuJoCo before it asks."""
    code = "import sys; sys.modules['mujoco'] = None; from r2s2r_cli.__main__ import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, "rig", "--link", "tcp", "--world", "none.toml"], cwd=tmp_path, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    assert done.returncode == ExitCode.INPUT
    assert "MuJoCo is not installed" in done.stderr
    assert "[rig]'" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_cannot_be_is_refused(project: Path, tmp_path: Path) -> None:
    """Unknown keys, robots without a place in a protocol, ports that are taken: codes, and what to do."""
    (tmp_path / "w.toml").write_text("sead = 3\n")
    wrong = invoke("rig", "--world", str(tmp_path / "w.toml"))
    assert wrong.exit_code == ExitCode.INPUT and "sead" in wrong.stderr
    with socket.create_server(("127.0.0.1", 0)) as taken:
        busy = invoke("rig", "--link", "tcp", "--port", str(taken.getsockname()[1]))
    assert busy.exit_code == ExitCode.HARDWARE and "Address already in use" in busy.stderr
    assert invoke("rig", "--link", "tcp", "--device", "robot").exit_code == ExitCode.USAGE
    assert invoke("init", "six", "--robot", "sixbar").exit_code == 0
    assert invoke("rig", "--robot", "six/robot.toml", "--protocol", "legacy").exit_code == ExitCode.INPUT


def test_the_bench_table_calibrates_the_robot(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--points` writes what `calibrate` takes: lines within millimetres; a file in the way stays."""
    assert document("rig", "--points", "points.csv")["points"] == "points.csv"
    typed = ["rig", "--points", "points.csv", "--seed", "3"]
    monkeypatch.setattr(sys, "argv", ["r2s2r", *typed])
    refused = invoke(*typed)
    assert refused.exit_code == ExitCode.USAGE
    assert refused.stderr.endswith("hint: r2s2r rig --points points-2.csv --seed 3\n")  # of the same world
    assert invoke("calibrate", "--points", "points.csv").exit_code == 0
    robot = tomllib.loads((project / "robot.toml").read_text())
    assert [2e-11 < sensor["slope_f_per_m"] < 4e-11 for sensor in robot["sensors"]] == [True] * 9


@pytest.mark.slow
def test_a_killed_rig_leaves_a_dead_port(project: Path) -> None:
    """SIGKILL is the pulled plug: the host's reads end at once."""
    with running(project, "--seconds", "60") as child:
        assert child.stdout is not None
        with RawHost(child.stdout.readline().strip()) as host:
            host.until(b",H,1,")
            os.kill(child.pid, signal.SIGKILL)
            end = time.monotonic() + 120
            with pytest.raises(EOFError):
                while time.monotonic() < end:
                    host.read(0.5)
