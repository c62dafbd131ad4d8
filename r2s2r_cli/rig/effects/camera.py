"""Effects of the camera: where it really is, its scale, its delay, its gaps. None of them touches the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, View, with_delay
from r2s2r_cli.rig.section import NonNegative, Positive, Share, Vector3


class CameraPose(EffectSection):
    """The camera was knocked: it is turned and moved against what its table says."""

    turn_rad: Vector3 = (0.0, 0.0, 0.0)
    """Rotation vector in the axes of frame C [rad]."""
    by_m: Vector3 = (0.0, 0.0, 0.0)
    """In the axes of frame C [m]."""
    at_s: NonNegative = 0.0
    """When it happens [s]."""

    def law(self, scene: Scene) -> Law:
        """A jump in time, where the catalogue has a constant."""
        return _Knock(self)


class _Knock(Law):
    def __init__(self, p: CameraPose) -> None:
        self._p, self._turn, self._by = p, turn(np.array(p.turn_rad)), np.array(p.by_m)

    def see(self, t: float, view: View) -> View:
        return replace(view, p_CC=self._by, R_CC=self._turn) if t >= self._p.at_s else view


class CameraScale(EffectSection):
    """Every depth is too large by a factor."""

    factor: Positive = 1.02

    def law(self, scene: Scene) -> Law:
        """A constant factor on depth; the colour picture is right."""
        return _Scale(self.factor)


class _Scale(Law):
    def __init__(self, factor: float) -> None:
        self._factor = factor

    def see(self, t: float, view: View) -> View:
        return replace(view, scale=view.scale * self._factor)


class CameraDelay(EffectSection):
    """Stamps are late: a frame shows the scene as it was earlier than its stamp says."""

    delay_s: NonNegative = 0.08
    jitter_s: NonNegative = 0.0
    """Further delay, exponential with this mean, drawn for every frame [s]."""

    def law(self, scene: Scene) -> Law:
        """A delay a frame."""
        return _Late(self, scene.rng)


class _Late(Law):
    def __init__(self, p: CameraDelay, rng: np.random.Generator) -> None:
        self._p, self._rng = p, rng

    def see(self, t: float, view: View) -> View:
        return with_delay(view, self._p.delay_s + (self._rng.exponential(self._p.jitter_s) if self._p.jitter_s else 0))


class Dropout(EffectSection):
    """Frames never come: in bursts."""

    share: Share = 0.2
    """Of all frames."""
    burst: Positive = 4.0
    """Mean number of frames that are missing at a stretch."""

    def law(self, scene: Scene) -> Law:
        """Two states with given odds of a change (Gilbert), where the catalogue has independent frames."""
        return _Bursts(self, scene.rng)


class _Bursts(Law):
    def __init__(self, p: Dropout, rng: np.random.Generator) -> None:
        self._rng = rng
        self._end = min(1.0 / p.burst, 1.0)
        self._begin = min(p.share / max(1.0 - p.share, 1e-9) * self._end, 1.0)
        self._lost = False

    def see(self, t: float, view: View) -> View:
        u = self._rng.random()
        self._lost = u >= self._end if self._lost else u < self._begin
        return replace(view, lost=view.lost or self._lost)


def turn(v: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a rotation vector [rad]."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = v / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)
