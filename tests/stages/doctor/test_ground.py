"""The plane of a depth frame: recovered from planted ones, with noise, holes, tilt, and things that stand on it."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.stages.estimate.vision.plane import find_ground, points_C

LENS = Intrinsics(160, 120, 150.0, 150.0, 80.0, 60.0)


def scene(tilt: float, distance: float, *, noise: float = 0.0, holes: float = 0.0, boxes: float = 0.0) -> np.ndarray:
    """Depth counts [0.25 mm] of a plane tilted about x. noise: [1/m]; holes, boxes: share of the pixels."""
    rng = np.random.default_rng(3)
    normal = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    x, y = (np.arange(160) + 0.5 - 80) / 150, (np.arange(120) + 0.5 - 60) / 150
    z = -distance / (normal[0] * x[None, :] + normal[1] * y[:, None] + normal[2])
    z[:, : int(160 * boxes)] -= 0.1 + 0.1 * rng.random((120, int(160 * boxes)))
    z = z + noise * z**2 * rng.standard_normal(z.shape)
    z[rng.random(z.shape) < holes] = 0
    return np.rint(z / 0.00025).astype(np.uint16)


@pytest.mark.parametrize(("tilt", "distance"), [(0.0, 1.44), (0.5, 1.2), (-0.3, 2.4)])
def test_a_planted_plane_is_found(tilt: float, distance: float) -> None:
    """Normal within 0.05 degrees, distance within 1 mm, noise within a tenth, with 30 % holes and 20 % clutter."""
    ground = find_ground(points_C(scene(tilt, distance, noise=0.0012, holes=0.3, boxes=0.2), LENS, 0.00025))
    assert ground is not None
    assert ground.tilt == pytest.approx(abs(tilt), abs=np.radians(0.05))
    assert ground.normal_C @ [0, -np.sin(tilt), -np.cos(tilt)] == pytest.approx(1.0, abs=1e-6)
    assert ground.distance == pytest.approx(distance, abs=1e-3)
    assert ground.share == pytest.approx(0.8, abs=0.02)
    z = distance / np.cos(tilt)
    assert ground.noise_sd == pytest.approx(0.0012 * z**2, rel=0.2)


def test_heights_are_over_the_plane_towards_the_camera() -> None:
    """A point 5 cm nearer to the camera than the floor under it is 5 cm high."""
    ground = find_ground(points_C(scene(0.0, 1.44), LENS, 0.00025))
    assert ground is not None
    assert ground.height(np.array([[0.0, 0.0, 1.39], [0.3, -0.2, 1.44]])) == pytest.approx([0.05, 0.0], abs=1e-4)


@pytest.mark.parametrize("depth", [np.zeros((120, 160)), np.full((120, 160), 9.0)], ids=["nothing", "a point"])
def test_no_plane_is_none(depth: np.ndarray) -> None:
    """Nothing seen, and pixels too few: no ground."""
    few = depth.astype(np.uint16)
    few[2:] = 0
    assert find_ground(points_C(few, LENS, 0.00025)) is None


def test_points_are_those_of_the_pinhole() -> None:
    """Back-projection uses pixel centres at u + 0.5, and unknown depth is no point."""
    depth = np.zeros((120, 160), dtype=np.uint16)
    depth[60, 95] = 4000
    p = points_C(depth, LENS, 0.00025)
    assert p[60, 95] == pytest.approx([15.5 / 150, 0.5 / 150, 1.0])
    assert np.isfinite(p[..., 2]).sum() == 1
