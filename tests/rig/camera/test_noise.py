"""Every part of the camera's noise has the statistics that its setting states, and is gone at its off value."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from r2s2r_cli.rig.camera import pinhole
from r2s2r_cli.rig.camera.bank import smooth
from r2s2r_cli.rig.camera.camera import Picture, RigCamera
from r2s2r_cli.rig.camera.settings import CameraSettings, ColorNoise, DepthNoise, Distractor, Occluder
from tests.support.rig_robots import known

THREE = known()
CAPS = np.array(THREE.rest_caps_m)
AWAY = CAPS + np.array([9.0, 0.0, 0.0])
"""Caps out of the picture: nothing but floor."""


def settings(
    *, depth: dict[str, Any] | None = None, color: dict[str, Any] | None = None, **more: Any
) -> CameraSettings:
    """A small camera without noise but for what is asked. Counts of 0.03 mm, so that their rounding is no noise."""
    size = {"width": 160, "height": 120, "fx": 150.0, "fy": 150.0, "cx": 80.0, "cy": 60.0, "depth_scale": 3e-5}
    ideal = CameraSettings.model_validate({**size, "floor_texture": 0.0, **more}).ideal()
    return ideal.model_copy(
        update={
            "depth": DepthNoise.model_validate({**ideal.depth.model_dump(), **(depth or {})}),
            "color": ColorNoise.model_validate({**ideal.color.model_dump(), **(color or {})}),
        }
    )


def depths(chosen: CameraSettings, caps: np.ndarray = AWAY, count: int = 1) -> np.ndarray:
    """Depths [m] of `count` frames, (frame, v, u)."""
    camera = RigCamera(THREE, chosen)
    return np.array([camera.capture(i, 0.0, caps).depth * chosen.depth_scale for i in range(count)])


def colors(chosen: CameraSettings, caps: np.ndarray = AWAY, t: float = 0.0, v: np.ndarray | None = None) -> Picture:
    """One frame."""
    return RigCamera(THREE, chosen).capture(0, t, caps, v)


def test_without_noise_depth_is_the_truth() -> None:
    """The floor seen from above at 1.44 m is 1.44 m away, everywhere and to a count."""
    assert np.abs(depths(settings()) - 1.44).max() <= 3e-5


@pytest.mark.parametrize("height", [0.7, 1.4])
def test_depth_noise_grows_with_the_square_of_depth(height: float) -> None:
    """The standard deviation is sd_per_m z^2, and the mean is z."""
    z = depths(settings(depth={"sd_per_m": 0.0012}, position_m=(0.0, 0.0, height)), count=4)
    assert z.std() == pytest.approx(0.0012 * height**2, rel=0.05)
    assert z.mean() == pytest.approx(height, abs=0.0012 * height**2 * 0.1)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_the_stated_share_of_the_noise_is_common_to_neighbours(share: float) -> None:
    """Correlation at distance d is share exp(-(d / correlation_px)^2): 1/e of the share at that length."""
    z = depths(settings(depth={"sd_per_m": 0.0012, "correlated_share": share, "correlation_px": 4.0}), count=10)
    z = z - 1.44
    for lag in (1, 4):
        found = (z[:, :, lag:] * z[:, :, :-lag]).mean() / (z**2).mean()
        assert found == pytest.approx(share * np.exp(-((lag / 4.0) ** 2)), abs=0.04)


def test_smooth_noise_keeps_variance_one() -> None:
    """The filter changes who agrees with whom, not how large the noise is."""
    field = smooth(np.random.default_rng(1).standard_normal((600, 600)), 5.0)
    assert field.std() == pytest.approx(1.0, abs=0.02)
    assert (field[:, 5:] * field[:, :-5]).mean() == pytest.approx(np.exp(-1), abs=0.03)


def test_frames_have_noise_of_their_own() -> None:
    """The noise of two frames is not correlated; the same seed and number give the same picture to the last bit."""
    chosen = settings(depth={"sd_per_m": 0.0012}, color={"sd": 3.0})
    one, two = depths(chosen, count=2) - 1.44
    assert abs((one * two).mean() / (one.std() * two.std())) < 0.1
    again = RigCamera(THREE, chosen)
    again.capture(7, 0.0, AWAY)
    assert np.array_equal(again.capture(1, 0.0, AWAY).depth * chosen.depth_scale - 1.44, two)
    other = RigCamera(THREE, chosen, seed=1).capture(1, 0.0, AWAY)
    assert not np.array_equal(other.depth * chosen.depth_scale - 1.44, two)


def test_disparity_is_rounded() -> None:
    """Depths are those of whole steps of disparity, z^2 step / (fx baseline) apart, and no others."""
    noise = {"sd_per_m": 0.003, "disparity_step_px": 0.125, "baseline_m": 0.05}
    chosen = settings(depth=noise, position_m=(0.0, 0.0, 1.0))
    z = depths(chosen)
    steps = chosen.fx * 0.05 / z / 0.125
    assert np.abs(steps - np.rint(steps)).max() < 0.01
    assert len(np.unique(np.rint(steps))) >= 2
    levels = np.unique(z)
    assert np.diff(levels)[0] == pytest.approx(1.0**2 * 0.125 / (150 * 0.05), rel=0.1)


def test_counts_are_rounded_to_the_depth_scale() -> None:
    """With counts of 4 mm the floor at 1.4425 m is 361 counts."""
    chosen = settings(position_m=(0.0, 0.0, 1.4425), depth_scale=0.004)
    assert np.unique(RigCamera(THREE, chosen).capture(0, 0.0, AWAY).depth).tolist() == [361]


def test_what_is_too_far_for_a_count_is_unknown() -> None:
    """Depths beyond 65535 counts are 0, not wrapped round."""
    assert (depths(settings(position_m=(0.0, 0.0, 2.1))) == 0).all()


@pytest.mark.parametrize("share", [0.05, 0.3])
def test_holes_have_the_stated_share_and_come_in_blobs(share: float) -> None:
    """That many pixels know nothing, and their neighbours rather don't either."""
    holes = depths(settings(depth={"hole_share": share, "hole_px": 4.0}), count=20) == 0
    assert holes.mean() == pytest.approx(share, rel=0.1)
    beside = (holes[:, :, 1:] & holes[:, :, :-1]).sum() / holes[:, :, 1:].sum()
    assert beside > 2 * share


def bar(**more: Any) -> CameraSettings:
    """A wide bar 0.6 m under the camera, 0.84 m over the floor: two long edges."""
    occluder = Occluder(a_m=(-3.0, 0.0, 0.84), b_m=(3.0, 0.0, 0.84), radius_m=0.1)
    return settings(occluders=(occluder,), **more)


def on_edge(z: np.ndarray) -> np.ndarray:
    """Pixels of which a neighbour is more than 15 mm nearer or farther, (v, u)."""
    edge = np.zeros(z.shape, dtype=bool)
    for axis in (0, 1):
        far = np.abs(np.diff(z, axis=axis)) > 0.015
        edge |= np.insert(far, 0, False, axis=axis) | np.insert(far, far.shape[axis], False, axis=axis)
    return edge


def test_flying_pixels_lie_between_front_and_back_at_edges_alone() -> None:
    """Half of the pixels on an edge fly between bar and floor; away from edges none does."""
    clean, noisy = depths(bar())[0], depths(bar(depth={"flying_share": 0.5}), count=10)
    edge, flying = on_edge(clean), np.abs(noisy - clean) > 1e-4
    assert not flying[:, ~edge].any()
    assert flying[:, edge].mean() == pytest.approx(0.5, abs=0.05)
    assert noisy.min() >= clean.min() - 1e-4 and noisy.max() <= clean.max() + 1e-4
    assert ((noisy > 0.75) & (noisy < 1.35)).any()


def test_edges_have_holes() -> None:
    """The stated share of the pixels on an edge reports nothing, and none elsewhere."""
    clean, noisy = depths(bar())[0], depths(bar(depth={"edge_hole_share": 0.25}), count=10)
    assert (noisy == 0)[:, on_edge(clean)].mean() == pytest.approx(0.25, abs=0.05)
    assert not (noisy == 0)[:, ~on_edge(clean)].any()


def test_lateral_noise_frays_edges_by_its_width() -> None:
    """A pixel looks past itself by N(0, s) rounded: one beside the edge sees across with P(N > 0.5 / s)."""
    clean, noisy = depths(bar())[0], depths(bar(depth={"lateral_px": 1.0}), count=20)
    front = clean < 1.0
    last = np.nonzero(front.any(axis=1))[0].max()  # the last row of the bar
    crossed = (noisy[:, last] > 1.0).mean()
    assert crossed == pytest.approx(0.3085, abs=0.03)
    assert np.array_equal(noisy[:, :20], np.broadcast_to(clean[:20], noisy[:, :20].shape))


def test_depth_lies_beside_color_by_the_stated_pixels() -> None:
    """The middle of what stands out in depth lies (2, -1.5) px from the middle of what is coloured."""
    chosen = settings(depth={"misregistration_px": (2.0, -1.5)}, occluders=(
        Occluder(a_m=(0.0, 0.0, 0.7), b_m=(0.0, 0.0, 0.7), radius_m=0.15, rgb=(0, 255, 0)),
    ))  # fmt: skip
    picture = RigCamera(THREE, chosen).capture(0, 0.0, AWAY)
    raised = picture.depth * chosen.depth_scale < 1.3
    green = picture.color[..., 1].astype(int) - picture.color[..., 0] > 40
    middle = [np.array(np.nonzero(mask)).mean(axis=1)[::-1] for mask in (raised, green)]
    assert middle[0] - middle[1] == pytest.approx([2.0, -1.5], abs=0.15)


def test_smear_averages_frames() -> None:
    """A filter of weight s leaves (1 - s) / (1 + s) of the variance, and starts anew where depth jumps."""
    noisy = {"sd_per_m": 0.0012, "smear": 0.6}
    z = depths(settings(depth=noisy), count=12)
    assert z[-1].var() / (0.0012 * 1.44**2) ** 2 == pytest.approx(0.25, rel=0.2)
    chosen = settings(depth={"smear": 0.6})
    camera = RigCamera(THREE, chosen)
    camera.capture(0, 0.0, CAPS)
    gone = camera.capture(1, 0.0, AWAY).depth * chosen.depth_scale
    dragged = np.abs(gone - 1.44) > 1e-4
    assert 0 < dragged.sum() < 400  # the low caps, nearer to the floor than 0.1 m, leave a shadow


def test_color_noise_has_the_stated_sd() -> None:
    """Each channel of the plain floor varies by the stated counts about its colour."""
    picture = colors(settings(color={"sd": 4.0}, floor_rgb=(100, 110, 120))).color.astype(float)
    assert picture.std(axis=(0, 1)) == pytest.approx([4.0] * 3, rel=0.03)
    assert picture.mean(axis=(0, 1)) == pytest.approx([100, 110, 120], abs=0.3)
    assert colors(settings(floor_rgb=(100, 110, 120))).color.std(axis=(0, 1)).max() == 0


def test_exposure_drifts_down_and_back() -> None:
    """Half a period in, the picture is darker by the stated share; after a whole period it is as before."""
    chosen = settings(color={"exposure_drift": 0.2, "exposure_period_s": 10.0}, floor_rgb=(200, 200, 200))
    means = [colors(chosen, t=t).color.mean() for t in (0.0, 5.0, 10.0)]
    assert means == pytest.approx([200, 160, 200], abs=1.0)


def test_motion_blurs_along_itself() -> None:
    """In a 30 ms exposure at 1 m/s caps are drawn out along their motion, and not across it; at rest not at all."""
    chosen, v = settings(color={"exposure_s": 0.03}), np.tile([1.0, 0.0, 0.0], (6, 1))
    floor = colors(chosen).color[0, 0].astype(int)

    def reach(picture: Picture) -> tuple[int, int]:
        rows, columns = np.nonzero(np.abs(picture.color.astype(int) - floor).max(axis=2) > 12)
        return int(np.ptp(columns)), int(np.ptp(rows))

    still, moving = reach(colors(chosen, CAPS)), reach(colors(chosen, CAPS, v=v))
    assert moving[0] - still[0] == pytest.approx(0.03 * 150 / 1.4 * 2 / 3, abs=1.1)
    assert abs(moving[1] - still[1]) <= 1
    assert np.array_equal(colors(chosen, CAPS).color, colors(chosen, CAPS, v=0 * v).color)


def test_distractors_lie_on_the_floor() -> None:
    """A disc is seen in its colour at its place, and has no height."""
    disc = Distractor(center_m=(0.2, 0.1), radius_m=0.05, rgb=(200, 30, 30))
    picture = colors(settings(distractors=(disc,)))
    rows, columns = np.nonzero(picture.color[..., 0] > 180)
    assert np.array([columns.mean() + 0.5, rows.mean() + 0.5]) == pytest.approx(
        [80 + 150 * 0.2 / 1.44, 60 - 150 * 0.1 / 1.44], abs=0.5
    )
    assert len(np.unique(picture.depth)) == 1


def test_a_knock_moves_the_camera_at_its_time() -> None:
    """Before `knocked_at_s` nothing has changed; after it the floor is 1 cm nearer."""
    chosen = settings(shift_m=(0.0, 0.0, -0.01), knocked_at_s=2.0)
    camera = RigCamera(THREE, chosen)
    z = [camera.capture(0, t, AWAY).depth[60, 80] * chosen.depth_scale for t in (1.9, 2.0)]
    assert z == pytest.approx([1.44, 1.43], abs=5e-5)


def test_wrong_scales_are_visible() -> None:
    """focal_error makes the picture larger than the stated focal length says; depth_error every depth."""
    plain, zoomed = (
        colors(settings(focal_error=e, distractors=(Distractor(center_m=(0.0, 0.0), radius_m=0.3, rgb=(255, 0, 0)),)))
        for e in (0.0, 0.1)
    )
    wide = [np.ptp(np.nonzero(p.color[..., 0] > 200)[1]) for p in (plain, zoomed)]
    assert wide[1] / wide[0] == pytest.approx(1.1, abs=0.03)
    assert depths(settings(depth_error=0.02)).mean() == pytest.approx(1.44 * 1.02, abs=1e-4)


def fitted(points: np.ndarray, center: np.ndarray, radius: float) -> np.ndarray:
    """The sphere of this radius through points (n, 3), robustly, from a first guess; frame C."""
    for _ in range(12):
        off = points - center
        distance = np.linalg.norm(off, axis=1)
        residual = distance - radius
        good = np.abs(residual) < 0.008
        J = -off[good] / distance[good, None]
        center = center - np.linalg.lstsq(J, residual[good], rcond=None)[0]
    return center


def test_caps_are_found_where_they_are() -> None:
    """Spheres fitted to the noisy depths of ten frames lie on the caps: no half pixel (1.2 mm) is lost."""
    chosen = CameraSettings(depth=DepthNoise(misregistration_px=(0.0, 0.0)))
    camera, X_WC, lens = RigCamera(THREE, chosen), pinhole.pose(chosen), pinhole.true(chosen)
    x, y = lens.rays()
    truth = pinhole.into(X_WC, CAPS)
    seen = [0, 2, 3, 4]  # those that are not under another
    errors = []
    for number in range(10):
        z = camera.capture(number, 0.0, CAPS).depth * chosen.depth_scale
        p = np.stack([z * x[None, :], z * y[:, None], z], axis=-1)[z > 0]
        for cap in seen:
            near = p[np.linalg.norm(p - truth[cap], axis=1) < 0.0225]
            errors.append(fitted(near, truth[cap] + 0.003, 0.0175) - truth[cap])
    bias = np.array(errors).reshape(10, len(seen), 3).mean(axis=0)
    assert np.linalg.norm(bias, axis=1).max() < 1e-3
    assert np.abs(bias.mean(axis=0)).max() < 0.4e-3


def test_what_comes_within_an_exposure_is_seen_through() -> None:
    """The robot moves, so three moments are drawn; a ball that comes before the last of them shows by a third."""
    ball = {"a_m": (0.3, 0.0, 0.3), "b_m": (0.3, 0.0, 0.3), "radius_m": 0.1, "rgb": (255, 255, 255)}
    v = np.tile([0.6, 0.0, 0.0], (len(CAPS), 1))
    before, halfway, after = (
        colors(settings(color={"exposure_s": 0.03}, occluders=(Occluder(**ball, from_s=from_s),)), t=1.0, v=v).color
        for from_s in (9.0, 1.005, 0.5)
    )
    gone, there = before.astype(float), after.astype(float)
    ball_only = (there != gone).any(axis=-1)
    assert ball_only.sum() > 20
    mixed = (2 * gone + there) / 3
    assert np.abs(halfway[ball_only] - mixed[ball_only]).max() <= 2.0
