"""The camera in a process of its own, for real time: drawing pictures must not hold up the boards and the wire.

`python -m r2s2r_cli.rig.camera_process` is the other end: it reads one line of JSON from its input, says the port, or
what went wrong, in one line of JSON, and then takes a row of numbers for every look at the robot until its input ends.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import struct
import subprocess
import sys
from typing import BinaryIO

import numpy as np

from r2s2r_cli.errors import HardwareError
from r2s2r_cli.rig.camera.service import CameraService
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.closing import Closing
from schemas.robot import Robot

_MODULE = "r2s2r_cli.rig.camera_process"
_PATIENCE_S = 5.0


class CameraProcess(Closing):
    """`CameraService` behind a pipe. It ends with this process, however that ends."""

    def __init__(self, robot: Robot, settings: CameraSettings, *, seed: int, host: str, port: int) -> None:
        """Listens when it returns. Raises HardwareError where the port cannot be had, or the process does not start."""
        self._row = struct.Struct(f"<{1 + 3 * robot.n_caps}d")
        self._child = subprocess.Popen(
            [sys.executable, "-m", _MODULE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0,
            start_new_session=True,  # Ctrl-C is for the rig, which then ends this
        )  # fmt: skip
        assert self._child.stdin is not None and self._child.stdout is not None  # noqa: S101 - both are pipes
        self._pipe = self._child.stdin.fileno()
        self._closed = False
        task = {
            "robot": robot.model_dump(mode="json"), "settings": settings.model_dump(mode="json"), "seed": seed,
            "host": host, "port": port,
        }  # fmt: skip
        with contextlib.suppress(BrokenPipeError):  # it died, which the answer tells
            self._write_all(json.dumps(task).encode() + b"\n")
        answer = json.loads(self._child.stdout.readline() or b"{}")
        self._child.stdout.close()
        if "address" not in answer:
            self.close()
            facts = answer or {"what": "the rig's camera did not start", "hint": "r2s2r rig   # without --camera-port"}
            raise HardwareError(facts.pop("what"), **facts)
        self.address: tuple[str, int] = (answer["address"][0], answer["address"][1])
        os.set_blocking(self._pipe, False)
        self.missed = 0
        """Looks that the camera was too busy to take, or that came after its end."""

    def observe(self, t: float, p_WE: np.ndarray) -> None:
        """The caps p_WE [m], (cap, 3), are there at the rig's time t [s]. Never waits."""
        if self._closed:
            self.missed += 1
            return
        try:
            os.write(self._pipe, self._row.pack(t, *np.ravel(p_WE)))  # so short a row is written whole or not at all
        except (BlockingIOError, BrokenPipeError):
            self.missed += 1

    def close(self) -> None:
        """End it."""
        if self._closed or self._child.stdin is None:
            return
        self._closed = True
        self._child.stdin.close()
        try:
            self._child.wait(_PATIENCE_S)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()

    def _write_all(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._pipe, data) :]


def _answer(facts: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()


def _serve(source: BinaryIO) -> None:
    task = json.loads(source.readline())
    robot = Robot.model_validate_json(json.dumps(task["robot"]))
    settings = CameraSettings.model_validate_json(json.dumps(task["settings"]))
    row = struct.Struct(f"<{1 + 3 * robot.n_caps}d")
    try:
        service = CameraService(robot, settings, seed=task["seed"], host=task["host"], port=task["port"])
    except HardwareError as error:
        _answer({"what": error.what, "where": error.where, "expected": error.expected, "received": error.received,
                 "hint": error.hint})  # fmt: skip
        return
    with service:
        _answer({"address": service.address})
        while len(data := source.read(row.size)) == row.size:
            t, *numbers = row.unpack(data)
            service.observe(t, np.array(numbers).reshape(-1, 3))


def main() -> None:
    """Serve until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _serve(sys.stdin.buffer)


if __name__ == "__main__":
    main()
