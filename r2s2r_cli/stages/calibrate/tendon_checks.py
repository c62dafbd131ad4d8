"""What is probably wrong with tendon curves that can be read: a load cell that was not zeroed, another unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.calibrate.tendons import Average, Curve, force_of
from schemas.robot import Robot

MIN_POINTS = 6
"""A cubic with a constant has four coefficients: fewer points say nothing about its error."""
OFFSET_SIGMA = 4.0
"""Standard errors that a constant must be away from zero: 1 of 16,000 zeroed load cells gets there by noise."""
OFFSET_SHARE = 0.02
"""Of the range of the force: a smaller constant moves the stiffness by less than tendons differ."""
STIFFNESS_FACTOR = 10.0
"""A unit is off by 10 at least; tendons of one robot are not."""


def zero_offset(curve: Curve) -> float:
    """Force at zero displacement [N] of the cubic with a constant; 0 where it cannot be told from zero.

    Least squares of force = c + k1 x + k2 x^2 + k3 x^3, with the standard error of c from the residuals.
    """
    x, force = curve.displacement, curve.force
    reach = float(force.max() - force.min())
    if len(np.unique(x)) < MIN_POINTS or reach <= 0:
        return 0.0
    design = np.vander(x / x.max(), 4, increasing=True)
    k = np.linalg.lstsq(design, force, rcond=None)[0]
    residual = force - design @ k
    variance = float(residual @ residual) / (len(x) - 4)
    error = float(np.sqrt(variance * np.linalg.pinv(design.T @ design)[0, 0]))
    offset = float(k[0])
    return offset if abs(offset) > max(OFFSET_SIGMA * error, OFFSET_SHARE * reach) else 0.0


def tendon_warnings(curves: Sequence[Curve], mean: Average, robot: Robot) -> list[str]:
    """One sentence for each curve that was not zeroed, and for a stiffness far from robot.toml's."""
    found = []
    for curve in curves:
        offset = zero_offset(curve)
        if offset:
            found.append(
                f"tendon curve {curve.name} does not begin at zero: its force at zero displacement is {offset:.3g} N, "
                "which the fit through the origin takes for stiffness; zero the load cell, or subtract it"
            )
    return found + _stiffness(mean, robot)


def _stiffness(mean: Average, robot: Robot) -> list[str]:
    """Force at the end of the common range, against what robot.toml gives there."""
    x = mean.x_common
    measured = float(force_of(mean.k, np.array(x))) / x
    for cable in robot.cables:
        if cable.kind == "passive":
            k = np.array([cable.stiffness_n_per_m, cable.stiffness2_n_per_m2, cable.stiffness3_n_per_m3])
            stated = float(force_of(k, np.array(x))) / x
            if measured > 0 and stated > 0 and not 1 / STIFFNESS_FACTOR <= measured / stated <= STIFFNESS_FACTOR:
                text = (
                    f"the tendons have {measured:.3g} N/m up to {1e3 * x:.0f} mm, robot.toml has {stated:.3g} N/m: is "
                    "the displacement in the unit of its column, and the force in newtons?"
                )
                return [text]
            break
    return []
