"""The table of docs/concepts/sightings.md: errors of single sightings, by how much of a cap is seen.

`python -m tests.stages.estimate.vision_figures [COUNT]`: COUNT tumbled robots a row (40). Tuning seeds only.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from r2s2r_cli.rig.camera.settings import CameraSettings, Occluder
from r2s2r_cli.stages.estimate.vision.frames import ImageFrame
from r2s2r_cli.stages.estimate.vision.sight import Sighter
from r2s2r_cli.stages.estimate.vision.survey import survey
from tests.stages.estimate.vision_scenes import ROBOT, TUNING, Recorded, record, seen_share, settings, tumbled

INSIDE_95 = 7.815
"""95 % of a chi-squared variable of three degrees of freedom are below."""
PREDICTED_SD = 0.003
SHARES = (1.1, 0.7, 0.4, 0.2)
"""Bounds of the rows: share of the disc that nothing hides."""
D435_PER_M = 4.7e-3


@dataclass(frozen=True)
class Condition:
    """One block of the table."""

    camera: CameraSettings
    speed: float = 0.0
    jpeg: bool = False
    arm: bool = False


CONDITIONS: dict[str, Condition] = {
    "1.44 m": Condition(settings()),
    "2.4 m": Condition(settings(2.4)),
    "1.44 m, JPEG": Condition(settings(), jpeg=True),
    "2.4 m, JPEG": Condition(settings(2.4), jpeg=True),
    "1.44 m, 0.6 m/s": Condition(settings(), speed=0.6),
    "1.44 m, an arm": Condition(settings(), arm=True),
    "1.44 m, D435, shifted": Condition(
        settings(depth={"sd_per_m": D435_PER_M, "misregistration_px": (1.0, -0.5), "disparity_step_px": 0.03125})
    ),
}


@dataclass
class Tally:
    """Errors across, across, along [m], deviations stated, squared normalised errors, and how many caps were missed."""

    error: list[np.ndarray] = field(default_factory=list)
    stated: list[np.ndarray] = field(default_factory=list)
    square: list[float] = field(default_factory=list)
    missed: int = 0


def encoded(frame: ImageFrame) -> ImageFrame:
    """The frame after JPEG, as a recording has it."""
    import cv2

    assert frame.color is not None
    data = cv2.imencode(".jpg", frame.color[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
    return replace(frame, color=np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1]))


def arm_over(rng: np.random.Generator, p: np.ndarray, height: float) -> Occluder:
    """An arm that passes over the line from the camera to some cap, or close to it."""
    cap = int(rng.integers(len(p)))
    at, way = p[cap] + np.array([0.0, 0.0, rng.uniform(0.05, 0.4)]), rng.standard_normal(2)
    way /= np.linalg.norm(way)
    at[:2] += rng.uniform(0.0, 0.035) * np.array([-way[1], way[0]])
    at[:2] *= (height - at[2]) / (height - p[cap, 2])
    along = np.array([*way, 0.0]) * 0.15
    return Occluder(a_m=tuple(map(float, at - along)), b_m=tuple(map(float, at + along)), radius_m=0.012)


def scenes(condition: Condition, count: int) -> tuple[Recorded, np.ndarray]:
    """A recording, and the share of every cap that is to be seen, (frame, cap)."""
    rng = np.random.default_rng(TUNING + 7)
    parts, shares = [], []
    for i in range(count):
        p = tumbled(rng)
        camera = condition.camera
        if condition.arm:
            camera = camera.model_copy(update={"occluders": (arm_over(rng, p, camera.position_m[2]),)})
        shares.append(seen_share(camera, p))
        parts.append(record(camera, [p], seed=TUNING + i, speed=condition.speed))
    frames = [replace(part.frames[0], index=i, t=i / 30) for i, part in enumerate(parts)]
    if condition.jpeg:
        frames = [encoded(frame) for frame in frames]
    return replace(parts[0], frames=frames, p_C=np.array([part.p_C[0] for part in parts])), np.array(shares)


def tallies(condition: Condition, count: int) -> tuple[list[Tally], float]:
    """A tally for each of SHARES, and the CPU time a frame [s]."""
    source, shares = scenes(condition, count)
    eyes = Sighter(ROBOT, source.lens, source.depth_scale, survey(source, ROBOT, frames=10, method="numpy"))
    result, rng, spent = [Tally() for _ in SHARES], np.random.default_rng(TUNING), 0.0
    for frame, p_C, share in zip(source.frames, source.p_C, shares, strict=True):
        start = time.process_time()
        seen = eyes.sight(frame, p_C + PREDICTED_SD * rng.standard_normal(p_C.shape), _cov(len(p_C)))
        spent += time.process_time() - start
        for cap in range(len(p_C)):
            row = sum(share[cap] < bound for bound in SHARES[1:])
            if not seen.seen[cap]:
                result[row].missed += 1
                continue
            e, C = seen.p_C[cap] - p_C[cap], seen.cov_C[cap]
            R = _across(p_C[cap])
            result[row].error.append(R @ e)
            result[row].stated.append(np.sqrt(np.diag(R @ C @ R.T)))
            result[row].square.append(float(e @ np.linalg.solve(C, e)))
    return result, spent / count


def main(count: int = 40, write: Callable[[str], Any] = print) -> None:
    """Print the table."""
    for line in lines(count):
        write(line)


def lines(count: int) -> Iterator[str]:
    """Its lines."""
    yield "| frames | seen | caps | missed | bias [mm] | sd [mm] | stated [mm] | chi² / 3 | inside 95 % | CPU |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for name, condition in CONDITIONS.items():
        rows, spent = tallies(condition, count)
        for bound, low, tally in zip(SHARES, (*SHARES[1:], 0.0), rows, strict=True):
            if not tally.error:
                continue
            e, s, q = 1e3 * np.array(tally.error), 1e3 * np.array(tally.stated), np.array(tally.square)
            across, along = float(np.hypot(*e[:, :2].std(axis=0)) / np.sqrt(2)), float(e[:, 2].std())
            bias = float(np.hypot(*e[:, :2].mean(axis=0))), float(e[:, 2].mean())
            yield (
                f"| {name if bound == SHARES[0] else ''} | {100 * low:.0f} .. {100 * min(bound, 1):.0f} % | {len(e)} | "
                f"{tally.missed} | {bias[0]:.2f}, {bias[1]:.2f} | {across:.2f}, {along:.2f} | "
                f"{np.median(s[:, :2]):.2f}, {np.median(s[:, 2]):.2f} | {q.mean() / 3:.2f} | "
                f"{100 * (q < INSIDE_95).mean():.0f} % | {1e3 * spent:.0f} ms |"
            )


def _cov(caps: int) -> np.ndarray:
    return np.tile(PREDICTED_SD**2 * np.eye(3), (caps, 1, 1))


def _across(p_C: np.ndarray) -> np.ndarray:
    """Rows: two axes across the line of sight, and along it."""
    along = p_C / np.linalg.norm(p_C)
    one = np.array([along[2], 0.0, -along[0]])
    one /= np.linalg.norm(one)
    return np.stack([one, np.cross(along, one), along])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 40)
