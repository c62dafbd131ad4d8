"""The battery that runs down."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene
from r2s2r_cli.rig.section import NonNegative, Positive, Share


class BatterySag(EffectSection):
    """Voltage falls with the square of the charge that is gone, and under load."""

    motor_s: Positive = 300.0
    """How long one motor at full drive can run [s]; six of them a sixth of it."""
    fall: Share = 0.25
    """Part of the voltage that is lost when all charge is gone, at rest."""
    per_motor: NonNegative = 0.01
    """Part that each motor at full drive takes off while it runs: the battery's resistance."""
    used: Share = 0.0
    """Part of the charge that is gone at the rig's time 0."""

    def law(self, scene: Scene) -> Law:
        """Quadratic in the charge, where the catalogue has a line in time."""
        return _Battery(self)


class _Battery(Law):
    def __init__(self, p: BatterySag) -> None:
        self._p, self._used = p, p.used

    def volts(self, dt: float, share: float, load: np.ndarray) -> float:
        running = float(load.sum())
        self._used = min(self._used + running * dt / self._p.motor_s, 1.0)
        return float(share * max(1.0 - self._p.fall * self._used**2 - self._p.per_motor * running, 0.0))
