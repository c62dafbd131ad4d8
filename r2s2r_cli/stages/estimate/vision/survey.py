"""A look at frames spread over a run, before any is tracked: ground, camera pose, noise, depth against colour.

And whether the pictures fit the robot at all.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from r2s2r_cli.devices.camera import Intrinsics
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.vision.colors import blank
from r2s2r_cli.stages.estimate.vision.frames import FrameSource, ImageFrame
from r2s2r_cli.stages.estimate.vision.known import Survey
from r2s2r_cli.stages.estimate.vision.lens import Lens
from r2s2r_cli.stages.estimate.vision.level import levelled_ground
from r2s2r_cli.stages.estimate.vision.noise import DepthNoise, measured
from r2s2r_cli.stages.estimate.vision.plane import (
    MIN_SHARE,
    Ground,
    Method,
    find_ground,
    open3d_there,
)
from r2s2r_cli.stages.estimate.vision.plausible import HINT, check_lengths, check_sizes
from r2s2r_cli.stages.estimate.vision.sight import Sighter
from r2s2r_cli.stages.estimate.vision.world import (
    HEIGHT_M,
    TILT_RAD,
    camera_pose,
    disagreement,
    levelled,
    sees_floor,
)
from schemas.robot import Robot

FRAMES = 24
PLANES = 8
"""Frames whose ground is looked for anew; the rest would say the same."""
NOISE_FRAMES = 4
STABLE_M, STABLE_RAD = 0.003, np.radians(0.2)
"""A ground that wanders by more over the run: the camera was knocked, or it is not the ground."""
_NOISE_CLIP_SD = 4.5


@dataclass
class _Seen:
    """What the caps of the frames looked at showed."""

    shift: list[np.ndarray] = field(default_factory=list)
    shift_cov: list[np.ndarray] = field(default_factory=list)
    swell: list[float] = field(default_factory=list)
    caps: int = 0
    places: list[np.ndarray] = field(default_factory=list)
    """Of the caps found in each frame, (cap, 2) [px]."""
    length: list[tuple[float, float]] = field(default_factory=list)
    """Distances of a rod's two caps over the length of the rod, with standard deviation."""


def survey(
    source: FrameSource, robot: Robot, *, frames: int = FRAMES, seed: int = 0, method: Method | None = None
) -> Survey:
    """Look at some frames of a run. method: who proposes planes, open3d unless it cannot be loaded.

    Raises InputError where there is no frame with colour and depth, no ground, no cap of any rod in any of the frames
    looked at, or where lengths show that depth unit or focal length cannot be right.
    """
    index = np.unique(np.linspace(0, max(len(source) - 1, 0), min(frames, len(source))).round().astype(int))
    lens, scale = source.lens, source.depth_scale
    warnings: list[str] = []
    if method is None:
        method = "open3d" if open3d_there() else "numpy"
        if method == "numpy":
            warnings.append(
                "open3d cannot be loaded; its twin in NumPy looks for the ground (`r2s2r doctor` tells more)"
            )
    looked = [source.frame(int(i)) for i in index]
    usable = [frame for frame in looked if _usable(frame, lens)]
    if not usable:
        raise _bad("no frame of the run has a picture in colour and one in depth with anything in them",
                   f"{len(index)} frames looked at", "colour and depth", _lacks(looked))  # fmt: skip
    ground = _ground(usable, lens, scale, seed, method, warnings)
    X_WC, ground, seen = _posed(source.X_WC, lens, ground, warnings)
    noise = _noise(usable[:: max(len(usable) // NOISE_FRAMES, 1)][:NOISE_FRAMES], lens, scale, ground)
    first = Survey(X_WC, ground, noise)
    check_sizes(usable, robot, lens, scale)
    rough = _caps(usable, robot, lens, scale, first)
    if not rough.caps:
        raise _bad("no cap of the robot is seen in any frame that was looked at", f"{len(usable)} frames",
                   "two balls of the colour of each rod (robot.toml [[colors]])", "none")  # fmt: skip
    if (doubt := check_lengths(rough.length, lens, scale)) is not None:
        warnings.append(doubt)
    height_sd = float("nan")
    if seen:
        ground, height_sd = levelled_ground(ground, usable, rough.places, Lens(lens), scale, noise)
        X_WC, ground, _ = _posed(source.X_WC, lens, ground, [])
        first = replace(first, X_WC=X_WC, ground=ground)
    shift, shift_sd = _pooled(rough)
    second = first.with_colors(shift_px=shift, swell_px=0.0, swell_sd_px=0.3)
    fine = _caps(usable, robot, lens, scale, second) if np.hypot(*shift) > 0.3 else rough
    if fine is not rough:
        more, shift_sd = _pooled(fine)
        shift = (shift[0] + more[0], shift[1] + more[1])
    swell = float(np.median(fine.swell)) if fine.swell else 0.0
    if np.hypot(*shift) > max(0.25, 4 * shift_sd):
        warnings.append(f"depth lies ({shift[0]:+.2f}, {shift[1]:+.2f}) pixels beside colour; this is corrected")
    return Survey(
        X_WC, ground, noise, shift, swell, 0.1 if len(fine.swell) >= 6 else 0.3,
        tuple(int(i) for i in index), tuple(warnings), height_sd,
    )  # fmt: skip


def _posed(
    stated: np.ndarray | None, lens: Intrinsics, ground: Ground, warnings: list[str]
) -> tuple[np.ndarray, Ground, bool]:
    """X_WC (4, 4), the ground it stands on, and whether that is the one that is seen."""
    if stated is None:
        return camera_pose(ground), ground, True
    angle, height = disagreement(stated, ground)
    if angle <= TILT_RAD and abs(height) <= HEIGHT_M:
        return levelled(stated, ground), ground, True
    possible = sees_floor(stated, lens)  # a unit matrix in the place of a pose nobody measured looks up from the floor
    trusted = ground.share >= MIN_SHARE or not possible
    warnings.append(
        f"the recording's camera pose and the ground that is seen differ by {np.degrees(angle):.1f} degrees, "
        f"{1e3 * height:.0f} mm; {'' if possible else 'from the stated pose no floor can be seen; '}"
        f"{'the ground that is seen' if trusted else 'the stated pose'} is used"
    )
    if trusted:
        return camera_pose(ground), ground, True
    return stated, replace(ground, normal_C=stated[2, :3].copy(), distance=float(stated[2, 3])), False


def _usable(frame: ImageFrame, lens: Intrinsics) -> bool:
    """Whether colour and depth are there, of the right kind (else InputError), and not blank."""
    if frame.color is None or frame.depth is None:
        return False
    size = (lens.height, lens.width)
    for name, picture, shape, kind in (
        ("colour", frame.color, (*size, 3), np.uint8),
        ("depth", frame.depth, size, np.uint16),
    ):
        if picture.shape != shape or picture.dtype != kind:
            raise _bad(f"a {name} picture is not one of this camera", f"frame {frame.index}",
                       f"{np.dtype(kind)} {shape}", f"{picture.dtype} {picture.shape}")  # fmt: skip
    return not blank(frame.color) and bool((frame.depth > 0).any())


def _ground(
    frames: list[ImageFrame], lens: Intrinsics, scale: float, seed: int, method: Method, warnings: list[str]
) -> Ground:
    chosen = frames[:: max(len(frames) // PLANES, 1)][:PLANES]
    rays, found = Lens(lens), []
    slopes = np.stack([rays.x, rays.y, np.ones_like(rays.x)], axis=-1)
    for frame in chosen:
        assert frame.depth is not None  # noqa: S101
        ground = find_ground(
            slopes * np.where(frame.depth > 0, frame.depth * scale, np.nan)[..., None], seed=seed, method=method
        )
        if ground is not None:
            found.append(ground)
    if not found:
        raise _bad("no plane goes through the depths: there is no ground", f"{len(chosen)} frames",
                   "a floor in view", "none")  # fmt: skip
    share = float(np.median([ground.share for ground in found]))
    if share < MIN_SHARE:
        warnings.append(f"the largest plane holds {share:.0%} of the depths only: it need not be the ground")
    normal = np.median([ground.normal_C for ground in found], axis=0)
    normal /= np.linalg.norm(normal)
    distance = float(np.median([ground.distance for ground in found]))
    off = [abs(ground.distance - distance) for ground in found]
    turned = [float(np.arccos(np.clip(ground.normal_C @ normal, -1, 1))) for ground in found]
    if max(off) > STABLE_M or max(turned) > STABLE_RAD:
        warnings.append(
            f"the ground wanders by {1e3 * max(off):.1f} mm and {np.degrees(max(turned)):.2f} degrees over the run: "
            "was the camera knocked?"
        )
    middle = min(found, key=lambda ground: abs(ground.distance - distance))
    return Ground(normal, distance, middle.inlier, share, float(np.median([ground.noise_sd for ground in found])))


def _noise(frames: list[ImageFrame], lens: Intrinsics, scale: float, ground: Ground) -> DepthNoise:
    rays = Lens(lens)
    plane = ground.inverse_depth(rays.x, rays.y)
    errors = []
    for frame in frames:
        assert frame.depth is not None  # noqa: S101
        known = frame.depth > 0
        error = np.where(known, 1.0 / np.where(known, frame.depth * scale, 1.0) - plane, np.nan)
        error[plane <= 0] = np.nan
        sd = 1.4826 * float(np.nanmedian(np.abs(error)))
        error[np.abs(error) > _NOISE_CLIP_SD * max(sd, 1e-6)] = np.nan
        errors.append(error)
    return measured(np.array(errors))


def _caps(frames: list[ImageFrame], robot: Robot, lens: Intrinsics, scale: float, known: Survey) -> _Seen:
    sighter, seen = Sighter(robot, lens, scale, known), _Seen()
    for frame in frames:
        found = sighter.balls(frame)
        centers = [sighter.lens.project(fit.center) for fits in found for fit in fits[:2]]
        seen.places.append(np.array(centers).reshape(-1, 2))
        for rod, fits in enumerate(found):
            seen.caps += len(fits)
            if len(fits) >= 2:
                along = fits[1].center - fits[0].center
                apart = float(np.linalg.norm(along))
                sd = float(np.sqrt(along @ (fits[0].cov + fits[1].cov) @ along)) / max(apart, 1e-6)
                seen.length.append((apart / robot.rods[rod].length_m, sd / robot.rods[rod].length_m))
            for fit in fits[:2]:
                if np.isfinite(fit.shift_px).all():
                    seen.shift.append(fit.shift_px)
                    seen.shift_cov.append(fit.shift_cov_px)
                if fit.rim > 0.6:
                    seen.swell.append(fit.swell_px)
    return seen


def _pooled(seen: _Seen) -> tuple[tuple[float, float], float]:
    """Weighted mean of the shifts, and its standard deviation [px]; outliers are left out."""
    if not seen.shift:
        return (0.0, 0.0), float("nan")
    shift, W = np.array(seen.shift), np.linalg.inv(np.array(seen.shift_cov))
    middle = np.median(shift, axis=0)
    for _ in range(3):
        off = shift - middle
        good = np.einsum("ni,nij,nj->n", off, W, off) < 13.8
        if not good.any():
            break
        total = W[good].sum(axis=0)
        middle = np.linalg.solve(total, np.einsum("nij,nj->i", W[good], shift[good]))
    spread = 1.4826 * np.median(np.abs(shift - middle), axis=0) / np.sqrt(len(shift))
    return (float(middle[0]), float(middle[1])), float(spread.max())


def _lacks(frames: list[ImageFrame]) -> str:
    color = sum(frame.color is not None for frame in frames)
    depth = sum(frame.depth is not None and bool((frame.depth > 0).any()) for frame in frames)
    blanks = sum(frame.color is not None and blank(frame.color) for frame in frames)
    return f"colour in {color}, of them blank {blanks}; depth in {depth}"


def _bad(what: str, where: str, expected: str, received: str) -> InputError:
    return InputError(what, where=where, expected=expected, received=received, hint=HINT)
