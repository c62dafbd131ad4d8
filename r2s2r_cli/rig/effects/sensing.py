"""Effects of the stretch sensors, beyond the ordinary errors of the table `[sensors]`."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.section import Positive, Shift


class SensorBias(EffectSection):
    """Sensors show too long or too short."""

    lengths_m: tuple[Shift, ...]
    """One a cable [m]; missing ones are 0."""
    settles_s: Positive | None = None
    """With this time constant the bias comes in after the start [s]; left out: it is there from the start."""

    def law(self, scene: Scene) -> Law:
        """A bias that warms up."""
        return _Bias(self, len(scene.robot.cables))


class _Bias(Law):
    def __init__(self, p: SensorBias, n: int) -> None:
        self._by, self._tau = per(p.lengths_m, n, 0.0), p.settles_s

    def sense(self, t: float, length: np.ndarray) -> np.ndarray:
        share = 1.0 if self._tau is None else -np.expm1(-max(t, 0.0) / self._tau)
        return length + share * self._by


class SensorGain(EffectSection):
    """Sensors show a change of length too large or too small."""

    factors: tuple[Positive, ...]
    """One a cable; missing ones are 1."""
    about_m: Positive = 0.15
    """Length that is shown right [m]."""

    def law(self, scene: Scene) -> Law:
        """A factor about a length at which it was set."""
        return _Gain(self, len(scene.robot.cables))


class _Gain(Law):
    def __init__(self, p: SensorGain, n: int) -> None:
        self._factor, self._about = per(p.factors, n, 1.0), p.about_m

    def sense(self, t: float, length: np.ndarray) -> np.ndarray:
        return self._about + self._factor * (length - self._about)


class SensorSaturation(EffectSection):
    """Sensors hardly stretch beyond a length."""

    above_m: Positive = 0.2
    """Where the flat part begins [m]."""
    rest_m: Positive = 0.005
    """What a very long cable shows beyond it [m]."""

    def law(self, scene: Scene) -> Law:
        """A smooth bend, where the catalogue has a clip."""
        return _Bend(self)


class _Bend(Law):
    def __init__(self, p: SensorSaturation) -> None:
        self._p = p

    def sense(self, t: float, length: np.ndarray) -> np.ndarray:
        over = np.maximum(length - self._p.above_m, 0.0)
        return np.where(over > 0, self._p.above_m + self._p.rest_m * np.tanh(over / self._p.rest_m), length)
