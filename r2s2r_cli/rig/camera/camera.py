"""The rig's camera at work: caps in, a colour picture and depth counts out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.rig.camera import pinhole, render
from r2s2r_cli.rig.camera.color import ColorSensor
from r2s2r_cli.rig.camera.depth import MARGIN_PX, DepthSensor
from r2s2r_cli.rig.camera.pinhole import Pinhole
from r2s2r_cli.rig.camera.scene import Scene
from r2s2r_cli.rig.camera.settings import CameraSettings
from schemas.robot import Robot

MAX_MOMENTS = 3
"""Moments of one exposure that are drawn: blur costs time, and nobody sees a fourth."""


@dataclass(frozen=True)
class Picture:
    """color: RGB uint8 (v, u, 3). depth: counts uint16 (v, u), 0 where unknown."""

    color: np.ndarray
    depth: np.ndarray


@dataclass(frozen=True)
class _Place:
    """What is the same as long as the camera stands still: its pose, and the floor as it sees it."""

    X_WC: np.ndarray
    inverse: np.ndarray
    picture: np.ndarray


class RigCamera:
    """One camera; equal seeds and equal frame numbers give equal pictures of equal robots (but for `smear`)."""

    def __init__(self, robot: Robot, settings: CameraSettings, *, seed: int = 0) -> None:
        self.settings = settings
        self._seed = seed
        self._scene = Scene(robot, settings)
        rng = np.random.default_rng([seed, 0])
        self._depth, self._color = DepthSensor(settings, rng), ColorSensor(settings, rng)
        self._lens = pinhole.true(settings)
        self._depth_lens = self._lens.shifted(*settings.depth.misregistration_px)
        self._places: dict[bool, _Place] = {}

    def capture(self, number: int, t: float, p_WE: np.ndarray, v_WE: np.ndarray | None = None) -> Picture:
        """The picture whose exposure has its middle at rig time t [s].

        number: of the frame, from 0; it picks the noise. p_WE: cap centres [m], v_WE: their velocities [m/s] (cap, 3).
        """
        rng = np.random.default_rng([self._seed, 1, number])
        place = self._place(t)
        solids = self._scene.solids(p_WE, t)
        moments = self._moments(place.X_WC, p_WE, v_WE)
        # What gets in the way may come or go within the exposure: each moment has solids, and colours, of its own.
        drawn = [self._scene.solids(p_WE + dt * v_WE, t + dt) if v_WE is not None and dt else solids for dt in moments]
        views = [(render.draw(self._lens, one.seen_from(place.X_WC)), one.rgb) for one in drawn]
        seen = render.draw(self._depth_lens, solids.seen_from(place.X_WC), MARGIN_PX)
        return Picture(self._color.report(place.picture, views, t, rng), self._depth.report(place.inverse, seen, rng))

    def _moments(self, X_WC: np.ndarray, p_WE: np.ndarray, v_WE: np.ndarray | None) -> list[float]:
        """Times about the middle of the exposure [s] at which the robot is drawn: one for each pixel it moves."""
        exposure = self.settings.color.exposure_s
        if v_WE is None or exposure <= 0:
            return [0.0]
        near = max(float(pinhole.into(X_WC, p_WE)[:, 2].min()), render.NEAREST_M)
        pixels = exposure * float(np.abs(v_WE).max()) * self._lens.fx / near
        count = int(np.clip(np.ceil(pixels), 1, MAX_MOMENTS))
        return [exposure * ((i + 0.5) / count - 0.5) for i in range(count)]

    def _place(self, t: float) -> _Place:
        settings = self.settings
        moved = t >= settings.knocked_at_s and (any(settings.shift_m) or any(settings.turn_rad))
        if moved not in self._places:
            X_WC = pinhole.knocked(settings) if moved else pinhole.pose(settings)
            normal = np.array(settings.floor_normal, dtype=float)
            length = float(np.linalg.norm(normal))
            n_C = X_WC[:3, :3].T @ (normal / length)
            offset = settings.floor_offset_m / length - normal @ X_WC[:3, 3] / length

            def inverse(lens: Pinhole) -> np.ndarray:
                return render.plane_depth(lens, n_C, offset)

            picture = self._color.floor(self._lens, X_WC, inverse(self._lens))
            self._places[moved] = _Place(X_WC, inverse(self._depth_lens), picture)
        return self._places[moved]
