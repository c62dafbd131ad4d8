"""The parts of the tracker's eyes against closed forms: lens, poses, solids, noise, and shares of colour at a rim."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.camera.bank import smooth
from r2s2r_cli.stages.estimate.vision.blend import shares
from r2s2r_cli.stages.estimate.vision.colors import mask, ranges_of
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise, measured
from r2s2r_cli.stages.estimate.vision.plane import Ground, find_ground, noise_per_m
from r2s2r_cli.stages.estimate.vision.solids import Body, ball_depth
from r2s2r_cli.stages.estimate.vision.world import camera_pose, disagreement, from_world, levelled, to_world
from schemas.robot import HsvRange
from tests.stages.estimate.vision_scenes import ROBOT

NOWHERE = np.zeros((1, 1), dtype=bool)


@pytest.mark.parametrize("distortion", [(), (0.1, -0.05, 0.002, -0.003, 0.01)], ids=["none", "five"])
def test_rays_and_pixels_are_each_others_inverse(distortion: tuple[float, ...]) -> None:
    """A point along the ray of a pixel is seen at the middle of that pixel, distorted or not."""
    lens = Lens(Intrinsics(64, 48, 60.0, 61.0, 31.0, 25.0, distortion))
    v, u = np.indices((48, 64))
    rays = np.stack([lens.x, lens.y, np.ones_like(lens.x)], axis=-1)
    assert lens.project(1.7 * rays) == pytest.approx(np.stack([u, v], axis=-1) + 0.5, abs=0.02 if distortion else 1e-9)


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.9])
def test_a_stated_pose_gives_place_and_heading_and_the_ground_the_rest(yaw: float) -> None:
    """Stated 0.8 degrees and 6 mm wrong: heights are those of the ground that is seen, x, y and heading as stated; a
    stated pose that is right stays what it is."""
    n = np.array([0.1, -0.3, -0.95]) / np.linalg.norm([0.1, -0.3, -0.95])
    ground = Ground(n, 1.3, NOWHERE, 1.0, 0.0)
    c, s = np.cos(yaw), np.sin(yaw)
    true = np.eye(4)
    true[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ camera_pose(ground)[:3, :3]
    true[:3, 3] = 0.4, -0.2, 1.3
    assert levelled(true, ground) == pytest.approx(true, abs=1e-12)
    tilt = np.radians(0.8)
    wrong = true.copy()
    wrong[:3, :3] = (
        np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]]) @ true[:3, :3]
    )
    wrong[2, 3] += 0.006
    found = levelled(wrong, ground)
    assert disagreement(found, ground) == pytest.approx((0.0, 0.0), abs=1e-7)
    assert found[:2, 3] == pytest.approx(true[:2, 3])
    assert found[:3, :3] == pytest.approx(true[:3, :3], abs=1e-4)


@pytest.mark.parametrize("normal", [(0, 0, -1), (0.2, -0.5, -0.8), (-0.95, 0.1, -0.3), (0, -1, -0.01)])
def test_the_world_has_its_ground_at_zero(normal: tuple[float, float, float]) -> None:
    """A rotation, no mirror; the plane at z = 0, the camera above at its distance; there and back is exact."""
    n = np.array(normal) / np.linalg.norm(normal)
    ground = Ground(n, 1.3, NOWHERE, 1.0, 0.0)
    X = camera_pose(ground)
    R = X[:3, :3]
    assert pytest.approx(np.eye(3), abs=1e-12) == R @ R.T and np.linalg.det(R) == pytest.approx(1.0)
    p_C = np.random.default_rng(0).standard_normal((5, 3))
    assert to_world(X, p_C)[0][:, 2] == pytest.approx(ground.height(p_C))
    assert to_world(X, np.zeros(3))[0] == pytest.approx([0, 0, 1.3])
    cov = np.diag([1.0, 4.0, 9.0])
    p, back = from_world(X, *to_world(X, p_C, np.tile(cov, (5, 1, 1))))
    assert p == pytest.approx(p_C) and back[2] == pytest.approx(cov)
    angle, height = disagreement(X, ground)
    assert angle == pytest.approx(0.0, abs=1e-6) and height == pytest.approx(0.0)


def test_a_ball_is_met_where_its_equation_says() -> None:
    """Points at the depth lie on the ball, on its near side; rays past the cone of its half angle miss it."""
    center, radius = np.array([0.1, -0.2, 1.5]), 0.05
    x, y = np.meshgrid(np.linspace(-0.2, 0.3, 201), np.linspace(-0.4, 0.2, 201))
    z = ball_depth(x, y, center, radius)
    ray = np.stack([x, y, np.ones_like(x)], axis=-1)
    on = np.isfinite(z)
    p = ray[on] * z[on][:, None]
    assert np.linalg.norm(p - center, axis=-1) == pytest.approx(radius)
    assert ((p - center) * ray[on]).sum(axis=-1).max() <= 1e-12
    angle = np.arccos(ray @ center / np.linalg.norm(ray, axis=-1) / np.linalg.norm(center))
    assert (on == (angle <= np.arcsin(radius / np.linalg.norm(center)))).all()


def test_what_hides_a_cap_is_what_a_march_along_the_rays_meets_first() -> None:
    """The robot without one cap, met by steps of 0.4 mm, agrees with the closed form where that is before the cap."""
    body, rng = Body(ROBOT), np.random.default_rng(3)
    p = np.array(ROBOT.rest_caps_m) + np.array([0, 0, -1.2])
    p_C = p * np.array([1, -1, -1])  # seen from above
    cap = int(np.argmax(p_C[:, 2]))
    x, y = np.meshgrid(p_C[cap, 0] / p_C[cap, 2] + np.linspace(-0.03, 0.03, 16),
                       p_C[cap, 1] / p_C[cap, 2] + np.linspace(-0.03, 0.03, 16))  # fmt: skip
    x, y = x + 1e-4 * rng.random(x.shape), y
    z = body.nearest(x, y, p_C, cap, np.zeros(6))
    steps = np.arange(0.9, p_C[cap, 2] - 1e-3, 4e-4)
    q = np.stack([x, y, np.ones_like(x)], axis=-1)[..., None, :] * steps[:, None]
    within = np.zeros(q.shape[:-1], dtype=bool)
    for other in set(range(6)) - {cap}:
        within |= np.linalg.norm(q - p_C[other], axis=-1) < body.cap_radius[other]
    for part in body.parts:
        even, odd = p_C[2 * part.rod], p_C[2 * part.rod + 1]
        w = (odd - even) / np.linalg.norm(odd - even)
        off = q - ((even + odd) / 2 + part.offset * w)
        along = off @ w
        within |= (np.abs(along) < part.half) & (np.linalg.norm(off - along[..., None] * w, axis=-1) < part.radius)
    marched = np.where(within.any(axis=-1), steps[within.argmax(axis=-1)], np.inf)
    shown = z < p_C[cap, 2] - 1e-3
    assert 0.1 < shown.mean() < 0.9
    agree = np.isfinite(marched) == shown
    assert agree.mean() > 0.97  # thin rods are grazed between two steps
    both = shown & np.isfinite(marched)
    assert np.median(np.abs(z[both] - marched[both])) < 4e-4


@pytest.mark.parametrize(("white", "shared", "length"), [(8.5e-4, 8.5e-4, 6.0), (1e-3, 2e-4, 3.0), (3e-4, 3e-3, 10.0)])
def test_planted_noise_is_measured(white: float, shared: float, length: float) -> None:
    """Both parts within 8 % and the length within 15 % of what was planted, with a fifth of the pixels unknown."""
    rng = np.random.default_rng(1)
    shape = (240, 320)
    error = np.array([white * rng.standard_normal(shape) + shared * smooth(rng.standard_normal(shape), length)
                      for _ in range(2)])  # fmt: skip
    error[rng.random(error.shape) < 0.2] = np.nan
    found = measured(error)
    assert found.white == pytest.approx(white, rel=0.08)
    assert found.shared == pytest.approx(shared, rel=0.08 if shared > 3e-4 else 0.25)
    assert found.length_px == pytest.approx(length, rel=0.15 if shared > 3e-4 else 0.6)


def test_the_covariance_is_that_of_the_noise() -> None:
    """Variance on the diagonal, 1/e of the shared part at its length, and no direction without noise."""
    noise = DepthNoise(2e-3, 1e-3, 5.0)
    u = np.array([0.0, 5.0, 50.0])
    C = noise.covariance(u, np.zeros(3), np.zeros(3))
    assert C[0, 0] == pytest.approx(5e-6) and C[0, 1] == pytest.approx(1e-6 / np.e) and C[0, 2] < 1e-12
    assert np.linalg.eigvalsh(C).min() > 0


@pytest.mark.parametrize("beside", [(30, 30, 30), (120, 118, 112), (20, 60, 190)], ids=["dark", "floor", "blue"])
def test_half_of_a_pixel_on_the_rim_is_cap_whatever_lies_beside(beside: tuple[int, int, int]) -> None:
    """A red ball with a dull surface's shade, mixed into its surroundings over 2 px: the share is one half on the rim,
    all round and beside anything, with no shift towards light or dark."""
    R, fine = 8.0, 8
    v, u = (np.indices((24 * fine, 24 * fine)) + 0.5) / fine - 12.0
    a, b = (u - 0.3) / R, (v + 0.2) / R
    q = np.sqrt(np.maximum(1 - a * a - b * b, 0))
    shade = 0.45 + 0.55 * np.clip(-0.3 * a - 0.4 * b + 0.866 * q, 0, 1)
    picture = np.where((a * a + b * b < 1)[..., None], shade[..., None] * np.array([217, 33, 60]), np.array(beside))
    box = np.ones(2 * fine) / (2 * fine)  # mixes over two pixels, each way
    for axis in (0, 1):
        picture = np.apply_along_axis(np.convolve, axis, picture, box, "same")
    at = slice(fine // 2, None, fine)
    color, a, b = np.rint(picture[at, at]), a[at, at], b[at, at]
    rho = np.hypot(a, b)
    share = shares(color, rho < 0.8, a, b, R)
    assert share is not None
    on = np.abs(rho - 1) * R < 0.8
    off = (1 - rho[on]) * R - (share[on] - 0.5)  # the ramp rises by about one a pixel after the stretch
    assert abs(off.mean()) < 0.15
    for along in (a, b):  # no shift either way: a third of what moves the mask
        slope = float((off * along[on]).sum() / (along[on] ** 2).sum())
        assert abs(slope) < 0.12


@pytest.mark.parametrize("noise", [0.0047, 0.0013])
def test_a_noisy_camera_widens_what_counts_as_ground(noise: float) -> None:
    """With four times the usual noise a tilted floor keeps its inliers, and its normal is good to 0.1 degrees."""
    rng, lens = np.random.default_rng(4), Lens(Intrinsics(320, 240, 300.0, 300.0, 160.0, 120.0))
    n = np.array([0.1, -0.2, -0.97]) / np.linalg.norm([0.1, -0.2, -0.97])
    inverse = -(n[0] * lens.x + n[1] * lens.y + n[2]) / 1.5 + noise * rng.standard_normal(lens.x.shape)
    p_C = np.stack([lens.x, lens.y, np.ones_like(lens.x)], axis=-1) / inverse[..., None]
    assert noise_per_m(p_C[..., 2]) == pytest.approx(noise, rel=0.03)
    ground = find_ground(p_C)
    assert ground is not None and ground.share > 0.99
    assert np.degrees(np.arccos(min(ground.normal_C @ n, 1.0))) < 0.1
    assert ground.distance == pytest.approx(1.5, abs=1e-3)


def test_red_wraps_round() -> None:
    """A range from 170 to 8 holds hues at both ends and not between; saturation and value are minima."""
    hsv = np.array([[[175, 200, 200], [3, 200, 200], [90, 200, 200], [175, 50, 200], [175, 200, 10]]], dtype=np.uint8)
    wanted = HsvRange(rod="red", hue=(170.0, 8.0), saturation_min=100.0, value_min=25.0)
    assert mask(hsv, wanted).tolist() == [[True, True, False, False, False]]


def test_a_rod_without_a_colour_is_refused() -> None:
    """Its caps could not be found; the message names it."""
    with pytest.raises(InputError, match="no colour for rod green"):
        ranges_of(ROBOT.model_copy(update={"colors": tuple(c for c in ROBOT.colors if c.rod != "green")}))
