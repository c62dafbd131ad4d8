"""Masses and inertias of the rig against closed forms, and against integrals over the solids."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.model import body_of
from r2s2r_cli.stages.calibrate.masses import mass_properties
from schemas.robot import Lump, Rod
from tests.support.rig_robots import known


def rod(*parts: dict[str, Any]) -> Rod:
    """A rod of 1 m made of these parts."""
    lumps = tuple(Lump(name=f"p{i}", **part) for i, part in enumerate(parts))
    return Rod(name="r", length_m=1.0, radius_m=0.01, cap_radius_m=0.02, parts=lumps)


SPHERE = {"shape": "sphere", "mass_kg": 2.0, "offset_m": 0.0, "radius_m": 0.3}
CYLINDER = {"shape": "cylinder", "mass_kg": 3.0, "offset_m": 0.0, "radius_m": 0.1, "length_m": 0.8}
TUBE = {"shape": "tube", "mass_kg": 3.0, "offset_m": 0.0, "radius_m": 0.2, "length_m": 0.8, "inner_radius_m": 0.1}


@pytest.mark.parametrize(
    ("part", "across", "along"),
    [
        (SPHERE, 2 / 5 * 2.0 * 0.09, 2 / 5 * 2.0 * 0.09),
        (CYLINDER, 3.0 * (3 * 0.01 + 0.64) / 12, 3.0 * 0.01 / 2),
        (TUBE, 3.0 * (3 * (0.04 + 0.01) + 0.64) / 12, 3.0 * (0.04 + 0.01) / 2),
    ],
)
def test_one_solid_has_its_textbook_inertia(part: dict[str, Any], across: float, along: float) -> None:
    """Sphere, cylinder and tube about their own centres, where the closed forms are those of any textbook."""
    body = body_of(rod(part))
    np.testing.assert_allclose(body.inertia, [across, across, along], rtol=1e-14)
    np.testing.assert_array_equal(body.p_RB, 0.0)


@pytest.mark.parametrize("part", [SPHERE, CYLINDER, TUBE], ids=["sphere", "cylinder", "tube"])
def test_inertia_is_the_integral_over_the_solid(part: dict[str, Any]) -> None:
    """Points drawn evenly in the solid have the same second moments, to the accuracy of the draw."""
    generator = np.random.default_rng(3)
    p = generator.uniform(-0.5, 0.5, size=(400_000, 3))
    distance, r = np.hypot(p[:, 0], p[:, 1]), part["radius_m"]
    if part["shape"] == "sphere":
        inside = np.linalg.norm(p, axis=1) < r
    else:
        inside = (
            (distance < r) & (distance > part.get("inner_radius_m", 0.0)) & (np.abs(p[:, 2]) < part["length_m"] / 2)
        )
    x, y, z = p[inside].T
    drawn = part["mass_kg"] * np.array([(y**2 + z**2).mean(), (x**2 + z**2).mean(), (x**2 + y**2).mean()])
    np.testing.assert_allclose(body_of(rod(part)).inertia, drawn, rtol=0.02)


def test_two_points_and_a_ball_obey_the_parallel_axes() -> None:
    """Centre of mass and moments of three parts against sums written out by hand."""
    point = {"shape": "point", "mass_kg": 1.0}
    body = body_of(rod({**point, "offset_m": -0.4}, {**point, "offset_m": 0.2}, {**SPHERE, "offset_m": 0.3}))
    com = (-0.4 + 0.2 + 2.0 * 0.3) / 4.0
    across = (0.4 + com) ** 2 + (0.2 - com) ** 2 + 2.0 * (0.3 - com) ** 2 + 2 / 5 * 2.0 * 0.09
    assert body.mass == 4.0
    np.testing.assert_allclose(body.p_RB, [0.0, 0.0, com])
    np.testing.assert_allclose(body.inertia, [across, across, 2 / 5 * 2.0 * 0.09])


@pytest.mark.parametrize("name", ["threebar", "threebar-330", "sixbar"])
def test_rig_and_engine_agree_on_every_rod(name: str) -> None:
    """Two pieces of code that share only robot.toml find the same bodies; the totals are those of the parts."""
    robot = known(name)
    for own in robot.rods:
        body, other = body_of(own), mass_properties(own.parts)
        assert body.mass == pytest.approx(sum(part.mass_kg for part in own.parts), rel=1e-15)
        np.testing.assert_allclose(body.mass, other.mass, rtol=1e-14)
        np.testing.assert_allclose(body.p_RB, [0.0, 0.0, other.com], atol=1e-15)
        expected = [other.inertia_transverse, other.inertia_transverse, other.inertia_axial]
        np.testing.assert_allclose(body.inertia, expected, rtol=1e-12)


def test_a_rod_of_points_is_refused() -> None:
    """Points on the axis have no inertia about it: the message names the rod and what to give."""
    points = ({"shape": "point", "mass_kg": 1.0, "offset_m": side} for side in (-0.3, 0.3))
    with pytest.raises(InputError, match="rod r has no moment of inertia about its z axis") as caught:
        body_of(rod(*points))
    assert "radius_m" in caught.value.hint
