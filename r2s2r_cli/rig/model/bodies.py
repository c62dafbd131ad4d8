"""Mass, centre of mass and inertia of a rod from its lumped parts, as the rig sums them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from schemas.robot import Lump, Rod


@dataclass(frozen=True)
class Body:
    """mass [kg]; p_RB: centre of mass [m], (3,), frame R; inertia: principal moments about it [kg m^2], (3,), axes of R
    (a rod is a body of revolution about its z axis)."""

    mass: float
    p_RB: np.ndarray
    inertia: np.ndarray


def body_of(rod: Rod) -> Body:
    """Sum of the parts of a rod. Raises InputError where the sum is no rigid body: all mass in points of the axis."""
    masses = np.array([part.mass_kg for part in rod.parts])
    offsets = np.array([part.offset_m for part in rod.parts])
    mass = masses.sum()
    centre = masses @ offsets / mass
    away = np.zeros((len(masses), 3))
    away[:, 2] = offsets - centre
    # Huygens and Steiner: a part adds m (|d|^2 - d d^T), of which the diagonal is all there is on one axis.
    moved = masses[:, None] * ((away**2).sum(axis=1, keepdims=True) - away**2)
    inertia = (np.array([_moments(part) for part in rod.parts]) + moved).sum(axis=0)
    if not (inertia > 0).all():
        raise InputError(
            f"rod {rod.name} has no moment of inertia about its {'xyz'[int(np.argmin(inertia))]} axis",
            where=f"robot.toml: parts of rod {rod.name}", expected="at least one sphere, cylinder or tube",
            received=", ".join(sorted({part.shape for part in rod.parts})),
            hint=f"give a part of rod {rod.name} a shape and radius_m in robot.toml",
        )  # fmt: skip
    return Body(float(mass), np.array([0.0, 0.0, centre]), inertia)


def _moments(part: Lump) -> tuple[float, float, float]:
    """Principal moments of a homogeneous solid about its own centre, z along the rod [kg m^2]."""
    m, r, inner, length = part.mass_kg, part.radius_m, part.inner_radius_m, part.length_m
    if part.shape == "point":
        return 0.0, 0.0, 0.0
    if part.shape == "sphere":
        return (2 / 5 * m * r * r,) * 3
    hole = inner if part.shape == "tube" else 0.0
    axial = m * (r * r + hole * hole) / 2
    across = axial / 2 + m * length * length / 12
    return across, across, axial
