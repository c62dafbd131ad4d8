"""The look at a run before it is tracked: ground, pose, noise and misregistration found, and bad input refused."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.camera import pinhole
from r2s2r_cli.stages.estimate.vision import survey as module
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.plane import MIN_SHARE, find_ground, points_C
from r2s2r_cli.stages.estimate.vision.survey import survey
from tests.stages.estimate.vision_scenes import REST, ROBOT, TUNING, Recorded, record, settings, tumbled

SHIFT = (1.0, -0.5)


@lru_cache
def shifted(count: int = 6) -> Recorded:
    """Tumbled robots under a camera that looks at an angle, its depth beside colour by SHIFT [px]."""
    rng = np.random.default_rng(TUNING + 2)
    camera = settings(depth={"misregistration_px": SHIFT}).model_copy(update={"position_m": (0.1, -0.5, 1.3)})
    recorded = record(camera, [tumbled(rng) for _ in range(count)], seed=TUNING + 2)
    return replace(recorded, X_WC=pinhole.pose(camera))


def pose(turn: list[float], height: float) -> np.ndarray:
    """A camera's pose (4, 4) with this diagonal and height [m]."""
    X_WC = np.diag([*turn, 1.0])
    X_WC[2, 3] = height
    return X_WC


def test_ground_pose_noise_and_shift_are_found() -> None:
    """Tilt and height to 0.05 degrees and 1 mm, noise to 5 %, the shift of depth to 0.35 px and told; stated pose."""
    source = shifted()
    assert source.X_WC is not None
    found = survey(source, ROBOT, method="numpy")
    assert found.ground is not None
    assert found.ground.normal_C @ source.X_WC[2, :3] == pytest.approx(1.0, abs=4e-7)
    assert found.ground.distance == pytest.approx(1.3, abs=1e-3)
    assert found.noise.sd == pytest.approx(1.2e-3, rel=0.05)
    assert found.noise.length_px == pytest.approx(6.0, rel=0.15)
    assert found.shift_px == pytest.approx(SHIFT, abs=0.35)
    assert abs(found.swell_px) < 0.2
    assert found.X_WC[:2, 3] == pytest.approx(source.X_WC[:2, 3])
    assert found.X_WC[:3, :3] == pytest.approx(source.X_WC[:3, :3], abs=1e-3)  # levelled by the ground that is seen
    assert found.X_WC[2, 3] == found.ground.distance
    assert [word for word in found.warnings if "beside colour" in word]
    assert not [word for word in found.warnings if "ground" in word or "rods" in word]


def test_without_open3d_it_works_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """The twin in NumPy takes over, with a warning."""
    monkeypatch.setattr(module, "open3d_there", lambda: False)
    found = survey(shifted(), ROBOT, frames=2)
    assert any("open3d cannot be loaded" in word for word in found.warnings)


@pytest.mark.slow
def test_open3d_and_its_twin_find_one_ground() -> None:
    """Normals within 0.01 degrees and distances within 0.2 mm, and both the same at a second call."""
    pytest.importorskip("open3d", exc_type=ImportError)
    source = shifted()
    depth = source.frames[0].depth
    assert depth is not None
    points = points_C(depth, source.lens, source.depth_scale)
    one, other = (find_ground(points, method=method) for method in ("open3d", "numpy"))
    again = find_ground(points, method="open3d")
    assert one is not None and other is not None and again is not None
    assert np.degrees(np.arccos(min(one.normal_C @ other.normal_C, 1.0))) < 0.01
    assert one.distance == pytest.approx(other.distance, abs=2e-4)
    assert (again.normal_C == one.normal_C).all() and again.distance == one.distance


def test_a_pose_that_the_ground_contradicts_is_warned_of() -> None:
    """Two degrees off, or 3 cm too high: the ground that is seen is used, and the warning has both numbers."""
    source = shifted()
    assert source.X_WC is not None
    wrong = source.X_WC.copy()
    wrong[2, 3] += 0.03
    found = survey(replace(source, X_WC=wrong), ROBOT, frames=2, method="numpy")
    assert any("30 mm" in word for word in found.warnings)
    assert found.X_WC[2, 3] == pytest.approx(1.3, abs=1e-3)


@pytest.mark.slow
def test_a_knocked_camera_is_warned_of() -> None:
    """The ground 1 cm lower from the middle of the run on."""
    source = shifted()
    half = len(source) // 2
    frames = [
        frame if i < half or frame.depth is None
        else replace(frame, depth=np.where(frame.depth > 0, frame.depth + 40, 0).astype(np.uint16))
        for i, frame in enumerate(source.frames)
    ]  # fmt: skip
    found = survey(replace(source, frames=frames), ROBOT, frames=2, method="numpy")
    assert any("knocked" in word for word in found.warnings)


@lru_cache
def littered() -> Recorded:
    """The same with boxes of all heights all about, so that the largest plane is not the ground."""
    source, rng = shifted(), np.random.default_rng(TUNING)
    boxes = np.kron(rng.integers(200, 2000, (30, 40)), np.ones((16, 16))).astype(np.uint16)
    boxes[:, 260:380] = 0
    frames = [
        replace(frame, depth=np.where(frame.depth > 0, frame.depth - boxes, 0).astype(np.uint16))
        for frame in source.frames
        if frame.depth is not None
    ]
    return replace(source, frames=frames)


@pytest.mark.slow
def test_a_floor_full_of_things_is_warned_of() -> None:
    """The largest plane is not the ground: it is warned of, and a stated pose is believed instead."""
    source = littered()
    assert source.X_WC is not None
    found = survey(source, ROBOT, frames=2, method="numpy")
    assert any("need not be the ground" in word for word in found.warnings)
    assert any("the stated pose is used" in word for word in found.warnings)
    assert found.X_WC[:2, 3] == pytest.approx(source.X_WC[:2, 3])
    assert found.X_WC[:3, :3] == pytest.approx(source.X_WC[:3, :3], abs=1e-3)  # levelled by the ground that is seen
    assert found.X_WC[2, 3] == found.ground.distance
    assert found.ground is not None and found.ground.distance == pytest.approx(1.3)


@pytest.mark.parametrize(
    "stated",
    [np.eye(4), np.diag([1.0, -1, -1, 1]), pose([1, 1, 1], 1.3), pose([1, -1, -1], -1.3), np.full((4, 4), np.nan)],
    ids=["unit matrix", "in the floor", "looks up", "below the floor", "nan"],
)
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_pose_from_which_no_floor_is_seen_is_not_believed(stated: np.ndarray) -> None:
    """Even where the largest plane need not be the ground: such a camera would see robots that hang in the air."""
    found = survey(replace(littered(), X_WC=stated), ROBOT, frames=2, method="numpy")
    assert any("no floor can be seen; the ground that is seen is used" in word for word in found.warnings)
    assert found.X_WC[2, 3] > 0.5 and found.X_WC[2, 2] < -0.5
    assert found.noise.sd > 1e-4


def changed(kind: str) -> Recorded:
    """A recording with one thing wrong."""
    source = shifted()
    lens = source.lens
    if kind == "unit":
        return replace(source, depth_scale=0.001)
    if kind == "focal":
        return replace(
            source, lens=Intrinsics(lens.width, lens.height, 1.05 * lens.fx, 1.05 * lens.fy, lens.cx, lens.cy)
        )

    def bad(frame: ImageFrame) -> ImageFrame:
        color, depth = frame.color, frame.depth
        assert color is not None and depth is not None
        return {
            "black": replace(frame, color=np.zeros_like(color)),
            "white": replace(frame, color=np.full_like(color, 255)),
            "grey": replace(frame, color=np.repeat(color.mean(axis=-1, keepdims=True), 3, axis=-1).astype(np.uint8)),
            "no depth": replace(frame, depth=np.zeros_like(depth)),
            "swapped": replace(frame, color=depth, depth=color),
        }[kind]

    return replace(source, frames=[bad(frame) for frame in source.frames])


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("focal", "shorter than they are"), ("black", "no frame of the run"),
        ("white", "no frame of the run"), pytest.param("grey", "no cap", marks=pytest.mark.slow),
        ("no depth", "no frame of the run"),
        ("swapped", "not one of this camera"),
    ],
)  # fmt: skip
def test_bad_input_is_refused(kind: str, says: str) -> None:
    """Focal length 5 % off, black, saturated or colourless pictures, no depth, swapped: says what."""
    with pytest.raises(InputError, match=says) as caught:
        survey(changed(kind), ROBOT, frames=3, method="numpy")
    assert caught.value.hint


def test_the_wrong_depth_unit_is_named() -> None:
    """Counts of 0.25 mm read as 1 mm: refused, and the message has the scale that would fit, to a third."""
    with pytest.raises(InputError, match="as large as their depth says") as caught:
        survey(changed("unit"), ROBOT, frames=2, method="numpy")
    scale = float(caught.value.received.split("depth_scale ")[1].split()[0])
    assert scale == pytest.approx(0.00025, rel=0.33)


@pytest.mark.slow
def test_a_robot_out_of_view_is_refused() -> None:
    """A floor without a robot."""
    with pytest.raises(InputError, match="no cap of the robot"):
        survey(record(settings(), [REST + np.array([5.0, 0, 0])]), ROBOT, method="numpy")


def overhead(real_dir: Path, name: str) -> tuple[np.ndarray, Intrinsics, np.ndarray]:
    """Points of a real overhead frame, and the calibrated world z in the camera's frame."""
    folder = real_dir / "rgbd"
    lens = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
    depth = np.load(folder / f"{name}_depth_0.npy")[..., 0]
    rows = [[float(x) for x in line.split()] for line in (folder / "primesense.tf").read_text().splitlines()[2:]]
    return points_C(np.where(np.isfinite(depth), depth, 0.0), lens, 1.0), lens, np.array(rows[1:])[2]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["numpy", "open3d"])
def test_real_overhead_frames(real_dir: Path, method: str) -> None:
    """The normal of the table within 0.2 degrees of the calibrated world's z, its distance the same to 1 mm in both."""
    if method == "open3d":
        pytest.importorskip("open3d", exc_type=ImportError)
    distances = []
    for name in ("clutter", "single_object"):
        points, _, z_W = overhead(real_dir, name)
        ground = find_ground(points, method=method)  # type: ignore[arg-type]
        assert ground is not None and ground.share > MIN_SHARE
        off = np.arctan2(np.linalg.norm(np.cross(ground.normal_C, z_W)), ground.normal_C @ z_W)
        assert np.degrees(off) < 0.2
        distances.append(ground.distance)
    assert np.ptp(distances) < 1e-3


@pytest.mark.slow
def test_a_real_office_is_no_ground(real_dir: Path) -> None:
    """The largest plane of the TUM frame holds too few depths to be trusted."""
    import cv2

    depth = cv2.imread(str(real_dir / "rgbd" / "depth.png"), cv2.IMREAD_UNCHANGED)
    ground = find_ground(points_C(depth, Intrinsics(640, 480, 535.4, 539.2, 320.1, 247.6), 1 / 5000))
    assert ground is None or ground.share < MIN_SHARE
