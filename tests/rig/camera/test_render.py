"""The renderer against closed forms: depths of spheres, cylinders and planes at the pixels where they are known."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.rig.camera import pinhole, render
from r2s2r_cli.rig.camera.pinhole import Pinhole
from r2s2r_cli.rig.camera.scene import Scene, Solids
from r2s2r_cli.rig.camera.settings import CameraSettings, Occluder
from tests.support.rig_robots import known

LENS = Pinhole(160, 120, 150.0, 140.0, 81.0, 58.5)


def solids(*, spheres: list[tuple] = (), cylinders: list[tuple] = ()) -> Solids:  # type: ignore[assignment]
    """Spheres (center, radius) and cylinders (middle, axis, half length, radius), white, in frame C."""
    three, one = (-1, 3), (-1,)
    columns = [*zip(*spheres, strict=True)] or [(), ()]
    bars = [*zip(*cylinders, strict=True)] or [(), (), (), ()]
    axes = np.reshape(np.array(bars[1], dtype=float), three)
    return Solids(
        np.reshape(np.array(columns[0], dtype=float), three), np.reshape(np.array(columns[1], dtype=float), one),
        np.reshape(np.array(bars[0], dtype=float), three), axes / np.linalg.norm(axes, axis=1, keepdims=True),
        np.reshape(np.array(bars[2], dtype=float), one), np.reshape(np.array(bars[3], dtype=float), one),
        np.full((len(columns[0]) + len(bars[0]), 3), 255.0),
    )  # fmt: skip


def seen(things: Solids, lens: Pinhole = LENS) -> tuple[np.ndarray, np.ndarray]:
    """Depth and label of the whole picture."""
    view = render.draw(lens, things)
    z, label = np.full((lens.height, lens.width), np.inf), np.full((lens.height, lens.width), -1)
    z[view.rows, view.columns], label[view.rows, view.columns] = view.z, view.label
    return z, label


def points(z: np.ndarray, lens: Pinhole = LENS) -> np.ndarray:
    """Points of frame C at the pixels that have a depth, (n, 3), by the projection written out again."""
    v, u = np.nonzero(np.isfinite(z))
    depth = z[v, u]
    return np.column_stack([(u + 0.5 - lens.cx) / lens.fx * depth, (v + 0.5 - lens.cy) / lens.fy * depth, depth])


def marched(lens: Pinhole, inside: object, step: float = 2e-4, far: float = 1.6) -> np.ndarray:
    """Depth by walking along every ray until `inside(points)` is true; inf where it never is."""
    x, y = lens.rays()
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], np.ones((lens.height, lens.width))), axis=-1)
    z = np.full(rays.shape[:2], np.inf)
    for depth in np.arange(0.3, far, step):
        z[np.isinf(z) & inside(depth * rays)] = depth  # type: ignore[operator]
    return z


@pytest.mark.parametrize("center", [(0, 0, 1), (0.3, -0.2, 0.9), (-0.45, 0.3, 0.8)])
def test_sphere_points_lie_on_the_sphere(center: tuple[float, float, float]) -> None:
    """Every pixel of a sphere lies on its near side, and as many pixels see it as its cone has."""
    z, _ = seen(solids(spheres=[(center, 0.1)]))
    p = points(z)
    assert np.abs(np.linalg.norm(p - center, axis=1) - 0.1).max() < 1e-9
    assert ((p - center) * p).sum(axis=1).max() < 1e-9  # normals look at the camera
    x, y = LENS.rays()
    ray = np.stack(np.broadcast_arrays(x[None, :], y[:, None], np.ones_like(z)), axis=-1)
    off = np.linalg.norm(np.cross(ray, center), axis=-1) / np.linalg.norm(ray, axis=-1)
    assert np.array_equal(np.isfinite(z), off <= 0.1)


@pytest.mark.parametrize(
    ("middle", "axis"),
    [
        ((0, 0, 1), (1, 0, 0)),
        ((0.1, 0.05, 0.9), (0.5, -0.7, 0.3)),
        ((0.2, 0.1, 1), (0.1, 0.1, 1)),
        ((0, 0, 1), (0, 0, 1)),
    ],
)
def test_cylinder_is_what_marching_finds(middle: tuple[float, ...], axis: tuple[float, ...]) -> None:
    """Depth of a cylinder, flat ends included, agrees with walking along the rays."""
    lens = Pinhole(64, 48, 60.0, 60.0, 32.0, 24.0)
    a, w, half, radius = np.array(middle), np.array(axis) / np.linalg.norm(axis), 0.15, 0.06

    def inside(p: np.ndarray) -> np.ndarray:
        s = (p - a) @ w
        off = np.linalg.norm(p - a - s[..., None] * w, axis=-1)
        return np.asarray((np.abs(s) <= half) & (off <= radius))

    z, _ = seen(solids(cylinders=[(middle, axis, half, radius)]), lens)
    walked = marched(lens, inside, step=1e-3)
    both = np.isfinite(z) & np.isfinite(walked)
    assert both.sum() > 30
    assert (np.isfinite(z) != np.isfinite(walked)).sum() <= 2  # rays that graze less than a step
    assert np.abs(z[both] - walked[both]).max() < 1.1e-3


def test_the_nearer_solid_hides_the_other() -> None:
    """Of two solids on one ray the nearer is seen, whichever comes first in the list."""
    near, far = ((0, 0, 0.8), 0.05), ((0, 0, 1.0), 0.08)
    for order in ([near, far], [far, near]):
        z, label = seen(solids(spheres=order))
        assert z[58, 80] == pytest.approx(0.75, abs=1e-4)
        assert label[58, 80] == order.index(near)


def test_plane_depth_is_that_of_its_points() -> None:
    """Points at the plane's depths lie on the plane; above its horizon there is none."""
    normal, offset = np.array([0.1, 0.9, -0.4]), -0.5
    normal /= np.linalg.norm(normal)
    inverse = render.plane_depth(LENS, normal, offset)
    z = np.where(inverse > 0, 1 / np.maximum(inverse, 1e-9), np.inf)
    assert 0 < np.isinf(z).mean() < 1
    assert np.abs(points(z) @ normal - offset)[points(z)[:, 2] < 10].max() < 1e-5


def test_a_solid_out_of_the_picture_is_not_drawn() -> None:
    """Solids beside, behind and too close to the camera leave the picture empty."""
    z, _ = seen(solids(spheres=[((3, 0, 1), 0.1), ((0, 0, -1), 0.1), ((0, 0, 0.1), 0.09)]))
    assert np.isinf(z).all()


def test_pose_puts_the_target_at_the_principal_point() -> None:
    """The point looked at is in the middle, up in the world is up in the picture, and x is to the right."""
    settings = CameraSettings(position_m=(0.4, -1.0, 0.8), look_at_m=(0.1, 0.1, 0.05), picture_up=(0, 0, 1))
    X_WC = pinhole.pose(settings)
    assert np.allclose(X_WC[:3, :3].T @ X_WC[:3, :3], np.eye(3)) and np.linalg.det(X_WC[:3, :3]) > 0
    target = pinhole.into(X_WC, np.array([0.1, 0.1, 0.05]))
    assert np.allclose(target[:2], 0) and target[2] == pytest.approx(np.linalg.norm([0.3, 1.1, 0.75]))
    assert pinhole.into(X_WC, np.array([0.1, 0.1, 0.15]))[1] < 0  # higher: smaller v
    assert pinhole.into(X_WC, np.array([0.2, 0.1, 0.05]))[0] > 0


def test_robot_caps_are_drawn_where_they_are() -> None:
    """Seen caps lie on spheres about the cap centres in the world, in the colour of their rod."""
    three = known()
    settings = CameraSettings().ideal()
    p_WE, X_WC = np.array(three.rest_caps_m), pinhole.pose(settings)
    things, lens = Scene(three, settings).solids(p_WE, 0.0), pinhole.true(settings)
    z, label = seen(things.seen_from(X_WC), lens)
    for cap in range(6):
        shown = points(np.where(label == cap, z, np.inf), lens) @ X_WC[:3, :3].T + X_WC[:3, 3]
        assert len(shown) > 40  # a cap in full has 170 pixels
        assert np.abs(np.linalg.norm(shown - p_WE[cap], axis=1) - three.rods[cap // 2].cap_radius_m).max() < 1e-9
    red, green, blue = things.rgb[0], things.rgb[2], things.rgb[4]
    assert red.argmax() == 0 and green.argmax() == 1 and blue.argmax() == 2
    assert np.array_equal(things.rgb[0], things.rgb[1])


def test_occluders_come_move_and_go() -> None:
    """A capsule hides what is under it from its first to its last moment, and moves meanwhile."""
    bar = Occluder(a_m=(-0.1, 0, 0.5), b_m=(0.1, 0, 0.5), radius_m=0.05, v_m_per_s=(0, 0.1, 0), from_s=1, until_s=3)
    three = known()
    settings = CameraSettings(occluders=(bar,))
    scene = Scene(three, settings)
    caps = np.array(three.rest_caps_m)
    counts = [len(scene.solids(caps, t).center) for t in (0.5, 1.0, 2.9, 3.0)]
    assert counts == [6, 8, 8, 6]
    assert np.allclose(scene.solids(caps, 2.0).center[-2:], [[-0.1, 0.1, 0.5], [0.1, 0.1, 0.5]])
    assert len(scene.solids(caps, 2.0).middle) == len(scene.solids(caps, 0.0).middle) + 1
