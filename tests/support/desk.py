"""A rig in a process of its own, as a user starts it, and a project that knows its sensors. For tests of `record`."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from r2s2r_cli.stages.init.robots import robot_toml
from tests.support.fake_robot import OFFSET, SLOPE
from tests.support.host_rig import free_udp_port

QUIET = """
[sensors]
day_sd_m = 0.0
drift_sd_m = 0.0
bow_sd_m = 0.0
noise_sd_m = 0.0
lag_s = 0.0
dropout_share = 0.0
"""
"""World file of a rig whose sensors have nothing but their converter."""


@dataclass(frozen=True)
class Desk:
    """A running rig. address: for --port; camera: for --camera, None without; truth: its log."""

    address: str
    camera: str | None
    truth: Path
    process: subprocess.Popen[str]

    def kill(self) -> None:
        """Pull the plug."""
        self.process.kill()
        self.process.wait()


def project(root: Path, name: str = "threebar") -> Path:
    """A project of a robot whose sensors are calibrated by the lines that the rig has by itself; its folder."""
    from tests.commands.conftest import invoke

    assert invoke("init", str(root), "--robot", name).exit_code == 0
    path = root / "robot.toml"
    line = f"slope_f_per_m = {SLOPE!r}\noffset_f = {OFFSET!r}\n"
    text = re.sub(r"(\[\[sensors\]\].*\ncable = \d+\n)", lambda found: found[0] + line, robot_toml(name, "surface"))
    path.write_text(text)
    return root


def link_options(link: str) -> tuple[str, ...]:
    """Options of `r2s2r rig` for a link that no other test of this machine has: UDP's usual port is one for all."""
    return ("--link", link, *(("--port", str(free_udp_port())) if link == "udp" else ()))


@contextlib.contextmanager
def desk(root: Path, *options: str, world: str = "", seconds: float = 240.0) -> Iterator[Desk]:
    """`r2s2r rig` for the project at `root`, gone at the end whatever happened."""
    (root / "world.toml").write_text(world)
    truth = root / "truth.csv"
    command = [sys.executable, "-m", "r2s2r_cli", "rig", "--project", str(root), "--world", str(root / "world.toml"),
               "--truth", str(truth), "--seconds", str(seconds), "--json", *options]  # fmt: skip
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            said = _document(process)
            yield Desk(said["device"], said["camera"], truth, process)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.communicate(timeout=60)
            process.kill()


def _document(process: subprocess.Popen[str]) -> dict[str, str]:
    """What it prints before it serves: one JSON document over several lines."""
    assert process.stdout is not None and process.stderr is not None
    text = ""
    while True:
        line = process.stdout.readline()
        if not line:
            raise AssertionError(f"the rig did not start: {process.stderr.read()}")
        text += line
        with contextlib.suppress(json.JSONDecodeError):
            found: dict[str, str] = json.loads(text)
            break
    for stream in (process.stdout, process.stderr):
        threading.Thread(target=_drain, args=(stream,), daemon=True).start()
    return found


def _drain(stream: IO[str]) -> None:
    with contextlib.suppress(ValueError):
        while stream.readline():
            pass


@dataclass(frozen=True)
class Truth:
    """The rig's own log: t (row,) [s], length (row, cable) [m], duty (row, motor), caps (row, cap, 3) [m]."""

    t: np.ndarray
    length: np.ndarray
    duty: np.ndarray
    caps: np.ndarray


def read_truth(path: Path) -> Truth:
    """Of the log, without a last row that was cut off."""
    lines = path.read_text().splitlines()
    names = lines[0].split(",")
    rows = [row for row in (line.split(",") for line in lines[1:]) if len(row) == len(names) and row[-1]]
    table = np.array(rows, dtype=float).reshape(-1, len(names))

    def columns(word: str) -> np.ndarray:
        return table[:, [i for i, name in enumerate(names) if re.fullmatch(word, name)]]

    caps = columns(r"cap\d+_[xyz]_m")
    return Truth(
        table[:, 0], columns(r"length\d+_m"), columns(r"duty\d+"), caps.reshape(len(table), caps.shape[1] // 3, 3)
    )


def aligned_error(t: np.ndarray, length: np.ndarray, truth: Truth) -> np.ndarray:
    """Recorded lengths (sample, cable) [m] minus the true ones, at the shift of the clocks that fits best.

    NaN where a sample does not have the sensor. The run is part of the log; its clock began at an unknown moment.
    """

    def error(shift: float) -> np.ndarray:
        true = np.column_stack([np.interp(t + shift, truth.t, column) for column in truth.length.T])
        return np.asarray(length - true)

    def spread(shift: float) -> float:
        return float(np.nanmean(np.nanvar(error(shift), axis=0)))

    shifts = np.arange(0.0, max(truth.t[-1] - t[-1], 0.0) + 0.5, 0.02)
    best = min(shifts, key=spread)
    return error(min(best + np.arange(-0.02, 0.021, 0.002), key=spread))


def wait_until(happened: object, seconds: float = 60.0) -> None:
    """Poll a condition; AssertionError where it does not come about."""
    end = time.monotonic() + seconds
    while not happened():  # type: ignore[operator]
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.01)
