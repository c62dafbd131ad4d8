"""The rig's camera in a process of its own: it listens, sees what it is told, and never outlives the rig."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from r2s2r_cli.errors import HardwareError
from r2s2r_cli.hardware.camera.choose import choose_camera
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.camera_process import CameraProcess
from tests.support.rig_robots import known

PATIENCE_S = 60.0


def test_it_shows_the_robot_where_it_was_said_to_be() -> None:
    """Pictures of a robot that stands still, then nothing but silence and one clear error once the rig is closed."""
    robot = known()
    p_WE = np.array(robot.rest_caps_m)
    with CameraProcess(robot, CameraSettings(), seed=1, host="127.0.0.1", port=0) as camera:
        with choose_camera("rig://{}:{}".format(*camera.address)) as host:
            frame, start = None, time.monotonic()
            while frame is None and time.monotonic() - start < PATIENCE_S:
                camera.observe(time.monotonic() - start, p_WE)
                frame = host.read(0.01)
            assert frame is not None and frame.color.std() > 1
        at = camera.address
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(at)
    camera.observe(99.0, p_WE)
    assert camera.missed >= 1


def test_a_port_that_is_taken_is_one_clear_error() -> None:
    """What the other process found comes back as the HardwareError that it was."""
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(HardwareError, match="cannot listen") as caught:
            CameraProcess(known(), CameraSettings(), seed=1, host="127.0.0.1", port=port)
    assert str(port) in caught.value.where


@pytest.mark.slow
def test_it_ends_when_the_rig_is_killed() -> None:
    """SIGKILL of the process that started it closes its port."""
    code = (
        "import time; from tests.support.rig_robots import known;"
        "from r2s2r_cli.rig.camera.settings import CameraSettings;"
        "from r2s2r_cli.rig.camera_process import CameraProcess;"
        "c = CameraProcess(known(), CameraSettings(), seed=1, host='127.0.0.1', port=0);"
        "print(c.address[1], flush=True); time.sleep(60)"
    )
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    port = int(child.stdout.readline())
    socket.create_connection(("127.0.0.1", port)).close()
    os.kill(child.pid, signal.SIGKILL)
    child.communicate()
    end = time.monotonic() + PATIENCE_S
    with pytest.raises(ConnectionRefusedError):
        while time.monotonic() < end:
            socket.create_connection(("127.0.0.1", port)).close()
            time.sleep(0.05)
