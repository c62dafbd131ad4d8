"""Caps found without a prediction: patches of a rod's colour, each tried as a ball, the best pair of a rod first."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.estimate.vision.colors import hsv_of, mask
from r2s2r_cli.stages.estimate.vision.sightings import Candidate

if TYPE_CHECKING:
    from r2s2r_cli.stages.estimate.vision.ball import BallFit
    from r2s2r_cli.stages.estimate.vision.sight_cap import CapSighter
    from r2s2r_cli.stages.estimate.vision.view import Pictures

PATCH_PX = 8
"""A smaller connected patch is noise."""
PATCHES = 8
"""Of a rod's colour that are tried, the largest first."""
START_SD_M = 0.004
PAIR_M = 0.03
"""A rod's length is met by two candidates if it is met to this and four standard deviations."""


def candidates(fits: list[list[BallFit]]) -> tuple[Candidate, ...]:
    """The same balls without what they were fitted from."""
    return tuple(
        Candidate(rod, fit.center, fit.cov, min(fit.visible, 1.0)) for rod, found in enumerate(fits) for fit in found
    )


def balls(sighter: CapSighter, pictures: Pictures) -> list[list[BallFit]]:
    """Caps of each rod in a frame; a rod's best pair comes first, then what else is left, the more visible first."""
    fits = [_of_rod(sighter, pictures, rod) for rod in range(sighter.rods)]
    pairs = [_best_pair(found, length) for found, length in zip(fits, sighter.rod_length, strict=True)]
    # Once more, now that it is known what hides what.
    p = np.full((2 * sighter.rods, 3), np.nan)
    for rod, pair in enumerate(pairs):
        for end, i in enumerate(pair):
            p[2 * rod + end] = fits[rod][i].center
    sd = np.full(len(p), START_SD_M)
    result = []
    for rod, (found, pair) in enumerate(zip(fits, pairs, strict=True)):
        chosen = []
        for end, i in enumerate(pair):
            better = sighter.one(pictures, 2 * rod + end, p, sd).fit
            chosen.append(better or found[i])
        rest = [fit for i, fit in enumerate(found) if i not in pair]
        result.append([*chosen, *rest])
    return result


def _of_rod(sighter: CapSighter, pictures: Pictures, rod: int) -> list[BallFit]:
    """Balls of a rod's colour, the more visible first; no two at one place."""
    import cv2

    colored = mask(hsv_of(pictures.color), sighter.ranges[rod])
    closed = cv2.morphologyEx(colored.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    count, label, stats, middle = cv2.connectedComponentsWithStats(closed, connectivity=8)
    order = 1 + np.argsort(-stats[1:, cv2.CC_STAT_AREA], kind="stable")[:PATCHES]
    alone = np.full((2 * sighter.rods, 3), np.nan)
    sd = np.full(len(alone), START_SD_M)
    found: list[BallFit] = []
    for i in order[: count - 1]:
        left, top, width, height, area = stats[i]
        if area < PATCH_PX:
            break
        box = (slice(top, top + height), slice(left, left + width))
        z = pictures.z[box][(label[box] == i) & (pictures.z[box] > 0)]
        u, v = (int(np.clip(w, 0, n - 1)) for w, n in zip(middle[i], pictures.z.shape[::-1], strict=True))
        ray = np.array([sighter.view.lens.x[v, u], sighter.view.lens.y[v, u], 1.0])
        depth = float(np.median(z)) if len(z) else sighter.floor_depth(ray)
        if depth is None:
            continue
        alone[2 * rod] = ray * (depth + 0.7 * sighter.cap_radius[2 * rod])
        fit = sighter.one(pictures, 2 * rod, alone, sd).fit
        if fit is not None:
            found.append(fit)
    found.sort(key=lambda fit: -fit.visible)
    kept: list[BallFit] = []
    for fit in found:
        apart = (float(np.linalg.norm(fit.center[:2] / fit.center[2] - one.center[:2] / one.center[2])) for one in kept)
        if all(off * fit.center[2] > sighter.cap_radius[2 * rod] for off in apart):
            kept.append(fit)
    return kept


def _best_pair(found: list[BallFit], length: float) -> tuple[int, ...]:
    """The two that are a rod's length apart and most visible; the most visible one where no two are."""
    best: tuple[float, tuple[int, ...]] = (-np.inf, (0,) if found else ())
    for i, j in combinations(range(len(found)), 2):
        along = found[j].center - found[i].center
        apart = float(np.linalg.norm(along))
        if apart < 1e-6:
            continue
        unit = along / apart
        sd = float(np.sqrt(unit @ (found[i].cov + found[j].cov) @ unit))
        if abs(apart - length) < PAIR_M + 4 * sd:
            score = found[i].visible + found[j].visible - abs(apart - length) / PAIR_M
            best = max(best, (score, (i, j)))
    return best[1]
