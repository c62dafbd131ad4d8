"""The camera as a process sees it from outside: frames over TCP (docs/reference/protocols.md, section camera)."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
import time
from collections import deque
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import HardwareError
from r2s2r_cli.rig.camera import wire
from r2s2r_cli.rig.camera.camera import Picture, RigCamera
from r2s2r_cli.rig.camera.client import Client
from r2s2r_cli.rig.camera.clock import Exposure, Shutter
from r2s2r_cli.rig.camera.settings import CameraSettings
from r2s2r_cli.rig.closing import Closing
from schemas.robot import Robot

ALIVE_S = 0.25
"""A sign of life comes at least this often, by the wall clock, whatever the rig's time does."""


@dataclass(frozen=True)
class _Shot:
    """An exposure, and where the robot was: p_WE [m], v_WE [m/s], (cap, 3)."""

    exposure: Exposure
    p_WE: np.ndarray
    v_WE: np.ndarray


class CameraService(Closing):
    """The rig's main loop says where the robot is (`observe`); hosts that connect get pictures.

    Real time: pictures are drawn and sent in threads of their own; a host that reads too slowly loses frames, and
    sees so by their numbers. lossless (lock-step): `observe` draws the picture itself and waits for the host, so that
    what is sent depends on the seed alone. While nobody watches nothing is drawn, and frames are counted all the same.
    """

    def __init__(
        self, robot: Robot, settings: CameraSettings, *, seed: int = 0, host: str = "127.0.0.1", port: int = 0,
        lossless: bool = False,
    ) -> None:  # fmt: skip
        """Listens at once; port 0: any free one. Raises HardwareError where the port cannot be had."""
        self._settings, self._lossless = settings, lossless
        self._camera, self._shutter = RigCamera(robot, settings, seed=seed), Shutter(settings, seed=seed)
        self._serial = f"rig-{seed}"
        self._last: tuple[float, np.ndarray] | None = None
        self._pending: deque[_Shot] = deque()
        self._frozen: Picture | None = None
        self._clients: list[Client] = []
        self._lock = threading.Lock()
        self._gone = self._stalled = self._closing = False
        self._newest: queue.Queue[_Shot | None] = queue.Queue()
        self.drawn = 0
        """Pictures made so far."""
        try:
            self._listener = socket.create_server((host, port))
        except OSError as error:
            raise HardwareError(
                "the rig's camera cannot listen", where=f"{host}:{port}", expected="a free port",
                received=error.strerror or str(error), hint="r2s2r rig --camera-port 0",
            ) from error  # fmt: skip
        self.address: tuple[str, int] = self._listener.getsockname()[:2]
        self._threads = [threading.Thread(target=self._accept, name="camera-accept", daemon=True),
                         threading.Thread(target=self._sign_of_life, name="camera-alive", daemon=True)]  # fmt: skip
        if not lossless:
            self._threads.append(threading.Thread(target=self._draw_on, name="camera-draw", daemon=True))
        for thread in self._threads:
            thread.start()

    @property
    def watched(self) -> bool:
        """Whether a host is connected."""
        with self._lock:
            return any(client.open for client in self._clients)

    def observe(self, t: float, p_WE: np.ndarray) -> None:
        """The robot's caps p_WE [m], (cap, 3), are there at rig time t [s]. Call it at every step or tick, in order."""
        if self._shutter.gone(t) and not self._gone:
            self._gone = True
            self._unplug()
        self._stalled = self._shutter.stalled(t)
        now = np.array(p_WE, dtype=float)
        before, p_before = self._last or (t, now)
        v_WE = (now - p_before) / (t - before) if t > before else np.zeros_like(now)
        while self._shutter.next.t <= t:
            exposure = self._shutter.next
            self._shutter.advance()
            self._pending.append(_Shot(exposure, now + v_WE * (exposure.t - t), v_WE))
        self._last = (t, now)
        while self._pending and self._shutter.release(self._pending[0].exposure) <= t:
            shot = self._pending.popleft()
            if shot.exposure.lost or self._gone or self._shutter.stalled(shot.exposure.t) or not self.watched:
                continue
            if self._lossless:
                self._send(shot)
            else:
                self._newest.put(shot)

    def close(self) -> None:
        """End it all."""
        self._closing = True
        self._newest.put(None)
        self._unplug()
        for thread in self._threads:
            thread.join(timeout=2.0)

    def _unplug(self) -> None:
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            clients, self._clients = self._clients, []
        for client in clients:
            client.close()

    def _send(self, shot: _Shot) -> None:
        exposure = shot.exposure
        if self._shutter.frozen(exposure.t) and self._frozen is not None:
            picture = self._frozen
        else:
            picture = self._camera.capture(exposure.number, exposure.t, shot.p_WE, shot.v_WE)
            self.drawn += 1
        self._frozen = picture
        self._to_all(wire.frame(exposure, picture))

    def _to_all(self, pieces: list[bytes | memoryview]) -> None:
        with self._lock:
            self._clients = [client for client in self._clients if client.open]
            clients = list(self._clients)
        for client in clients:
            client.put(pieces)

    def _draw_on(self) -> None:
        while (shot := self._newest.get()) is not None:
            while self._newest.qsize():  # behind: the newest counts
                newer = self._newest.get()
                if newer is None:
                    return
                shot = newer
            self._send(shot)

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            client = Client(connection, wire.greeting(self._settings, self._serial), lossless=self._lossless)
            with self._lock:
                self._clients.append(client)
                gone = self._gone or self._closing
            if gone:
                client.close()

    def _sign_of_life(self) -> None:
        drawn = -1
        while not self._closing and not self._gone:
            time.sleep(ALIVE_S)
            if drawn == self.drawn and not self._stalled and not self._closing:
                exposure = self._shutter.next
                with self._lock:
                    clients = [client for client in self._clients if client.open]
                for client in clients:
                    client.hint(wire.alive(exposure.number, exposure.stamp))
            drawn = self.drawn
