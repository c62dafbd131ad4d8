"""Where cables are attached: the paper's heuristic for points A..H (section "System Identification").

Each end cap carries its cables on the circle where the cap's sphere is cut by the plane through its centre that is
perpendicular to the rod, evenly spaced; the sites at the two ends of a rod lie on lines parallel to it (AD, BE, CF).
One angle a rod, its *roll*, therefore fixes all its sites. In the rest state

1. the rod in the centre has its first site A on top of the cap; B, C follow at 120 degrees, D, E, F at the other end;
2. every other rod is turned so that one of its sites (G, H) is the point of the circle closest to the site on the
   centre rod that the cable between both leaves from;
3. the cables of a cap take its sites in the order in which their partners lie around the rod, so that they do not
   cross, turned to the nearest partners.

Which cable step 2 uses is free in the paper's words. `guides` names them: the passive tendons of the prism, see
docs/concepts/attachment.md for the reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from r2s2r_cli.errors import InputError, UsageError

Mode = Literal["surface", "rod_end"]
MODES: tuple[Mode, ...] = ("surface", "rod_end")

_VERTICAL = 1e-6
"""Sine of the angle to the vertical below which a rod has no upper side."""

_TIE = 1e-6
"""Two rods whose distances from the centre differ by less [m] are equally central; the lower number is taken."""


@dataclass(frozen=True)
class Attachment:
    """Sites of all cables, and how they came about.

    sites: (cable, 2, 3) [m] in the frames R of the rods of each cable's two caps. R_WR: (rod, 3, 3) at rest.
    centre: number of the rod in the centre. roll: (rod,) [rad], angle of a rod's first site from R's x axis about z;
    NaN in mode `rod_end`. slot: (cable, 2), which of its cap's evenly spaced sites the cable end took.
    guide: (rod,) cable that turned each rod, -1 for the centre rod and in mode `rod_end`.
    """

    sites: np.ndarray
    R_WR: np.ndarray
    centre: int
    roll: np.ndarray
    slot: np.ndarray
    guide: np.ndarray


def rod_frames(p_WE: np.ndarray) -> np.ndarray:
    """Frames R of the rods, R_WR, shape (rod, 3, 3), columns x, y, z of R in W. The one place that defines them.

    Origin: the middle between the caps. z: towards the odd cap. x: the direction perpendicular to the rod that points
    most upwards (for a vertical rod: most along the world's x). y = z cross x. From then on R turns with the rod.
    """
    p_WE = np.asarray(p_WE, dtype=float)
    axis = p_WE[1::2] - p_WE[0::2]
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    if not np.all(length > 0):
        raise InputError(
            f"rod {int(np.argmin(length))} has no length",
            where="rest_caps_m",
            expected="two different points per rod",
            hint="correct rest_caps_m in robot.toml",
        )
    z = axis / length
    reference = np.zeros_like(z)
    vertical = np.hypot(z[:, 0], z[:, 1]) < _VERTICAL
    reference[~vertical, 2] = 1.0
    reference[vertical, 0] = 1.0
    x = reference - np.sum(reference * z, axis=1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def attach(
    p_WE: np.ndarray,
    cables: Sequence[tuple[int, int]],
    cap_radius: float,
    mode: Mode = "surface",
    *,
    guides: Sequence[int] = (),
) -> Attachment:
    """Attachment of every cable at rest.

    p_WE: caps at rest [m], shape (cap, 3), caps 2i and 2i+1 on rod i; frame W, z up. cables: pairs of end caps.
    mode `surface`: on the caps' surface (the paper). mode `rod_end`: all cables of a cap end in one point of the rod's
    axis, the cap's centre. That is NTRT's node: there a cable is tied to the node where the rod ends, moved by the
    rod's radius towards the other end of the cable (tgRodInfo::getConnectionPoint); here rods end, and are counted, at
    the cap centre, and the 1.6 mm are left out.
    guides: cables that turn the other rods (step 2 of the module's text) before any others are tried.
    Raises InputError for caps or cables that do not fit together, UsageError for an unknown mode.
    """
    p_WE = np.asarray(p_WE, dtype=float)
    _check(p_WE, cables, mode)
    R_WR = rod_frames(p_WE)
    centre = centre_rod(p_WE)
    ends = _ends(cables, len(p_WE))
    half = np.linalg.norm(p_WE[1::2] - p_WE[0::2], axis=1) / 2
    n_rods, shape = len(R_WR), (len(cables), 2)
    sites = np.zeros((*shape, 3))
    sites[..., 2] = [[half[cap // 2] * (2 * (cap % 2) - 1) for cap in pair] for pair in cables]
    if mode == "rod_end":
        return Attachment(sites, R_WR, centre, np.full(n_rods, np.nan), np.zeros(shape, int), np.full(n_rods, -1))

    roll = np.full(n_rods, np.nan)
    guide = np.full(n_rods, -1)
    slot = np.zeros(shape, dtype=int)
    for rod, cable in _order(centre, cables, guides, n_rods):
        roll[rod] = 0.0 if cable < 0 else _facing(rod, cable, p_WE, R_WR, cables, sites)
        guide[rod] = cable
        for cap in (2 * rod, 2 * rod + 1):
            bearing = np.array([_bearing(p_WE[cables[k][1 - e]] - p_WE[cap], R_WR[rod]) for k, e in ends[cap]])
            for (k, e), number in zip(ends[cap], _slots(bearing, roll[rod]), strict=True):
                angle = roll[rod] + 2 * np.pi * number / len(ends[cap])
                slot[k, e] = number
                sites[k, e, :2] = cap_radius * np.cos(angle), cap_radius * np.sin(angle)
    return Attachment(sites, R_WR, centre, roll, slot, guide)


def site_points(p_WE: np.ndarray, cables: Sequence[tuple[int, int]], sites: np.ndarray, R_WR: np.ndarray) -> np.ndarray:
    """Attachment points in the world, p_WS [m], shape (cable, 2, 3), for rods with frames R_WR, shape (rod, 3, 3)."""
    rods = np.asarray(cables) // 2
    middle = (p_WE[0::2] + p_WE[1::2]) / 2
    return middle[rods] + np.einsum("keij,kej->kei", R_WR[rods], sites)


def centre_rod(p_WE: np.ndarray) -> int:
    """The rod whose middle is horizontally nearest to the robot's centre."""
    middle = (p_WE[0::2] + p_WE[1::2]) / 2
    distance = np.linalg.norm((middle - p_WE.mean(axis=0))[:, :2], axis=1)
    return int(np.flatnonzero(distance <= distance.min() + _TIE)[0])


def paper_labels(attachment: Attachment, cables: Sequence[tuple[int, int]]) -> dict[str, tuple[int, int]]:
    """The paper's points A..H as (cable, end); A, B, C on the centre rod's even cap, D, E, F on its odd cap.

    Only for three rods with three cables a cap, the robot of the paper; empty otherwise.
    """
    ends = _ends(cables, 2 * len(attachment.R_WR))
    if len(attachment.R_WR) != 3 or any(len(e) != 3 for e in ends) or np.isnan(attachment.roll).any():
        return {}
    labels = {}
    for cap, names in ((2 * attachment.centre, "ABC"), (2 * attachment.centre + 1, "DEF")):
        for k, e in ends[cap]:
            labels[names[attachment.slot[k, e]]] = (k, e)
    others = [rod for rod in range(3) if rod != attachment.centre]
    for name, rod in zip("GH", others, strict=True):
        cable = int(attachment.guide[rod])
        labels[name] = (cable, 0 if cables[cable][0] // 2 == rod else 1)
    return dict(sorted(labels.items()))


def _check(p_WE: np.ndarray, cables: Sequence[tuple[int, int]], mode: str) -> None:
    if mode not in MODES:
        raise UsageError(
            f"unknown attachment {mode!r}", where="attachment", expected=" or ".join(MODES), received=mode,
            hint="r2s2r init --attachment surface",
        )  # fmt: skip
    if p_WE.ndim != 2 or p_WE.shape[1] != 3 or len(p_WE) % 2 or len(p_WE) == 0 or not np.isfinite(p_WE).all():
        raise InputError(
            "end caps must be finite points, two a rod", where="rest_caps_m", expected="shape (2 rods, 3)",
            received=f"shape {p_WE.shape}", hint="correct rest_caps_m in robot.toml",
        )  # fmt: skip
    for k, (a, b) in enumerate(cables):
        if not (0 <= a < len(p_WE) and 0 <= b < len(p_WE)) or a // 2 == b // 2:
            raise InputError(
                f"cable {k} must join end caps of two rods", where=f"cables.{k}.caps",
                expected=f"two of 0..{len(p_WE) - 1} on different rods", received=f"{(a, b)}",
                hint=f"correct caps of cable {k} in robot.toml",
            )  # fmt: skip


def _ends(cables: Sequence[tuple[int, int]], n_caps: int) -> list[list[tuple[int, int]]]:
    ends: list[list[tuple[int, int]]] = [[] for _ in range(n_caps)]
    for k, pair in enumerate(cables):
        for e, cap in enumerate(pair):
            ends[cap].append((k, e))
    return ends


def _order(centre: int, cables: Sequence[tuple[int, int]], guides: Sequence[int], n_rods: int) -> list[tuple[int, int]]:
    """(rod, the cable that turns it), from the centre outwards; a rod that no cable reaches stands alone (-1)."""
    order = [(centre, -1)]
    placed = [centre]
    while len(placed) < n_rods:
        reach = [
            (k not in guides, placed.index(here), k, there)
            for k, (a, b) in enumerate(cables)
            for here, there in ((a // 2, b // 2), (b // 2, a // 2))
            if here in placed and there not in placed
        ]
        alone = next(rod for rod in range(n_rods) if rod not in placed)
        rod, cable = (min(reach)[3], min(reach)[2]) if reach else (alone, -1)
        order.append((rod, cable))
        placed.append(rod)
    return order


def _facing(
    rod: int, cable: int, p_WE: np.ndarray, R_WR: np.ndarray, cables: Sequence[tuple[int, int]], sites: np.ndarray
) -> float:
    """Roll that puts a site of `rod` on the point of its cap's circle closest to the cable's other, placed end."""
    end = 0 if cables[cable][0] // 2 == rod else 1
    cap, partner = cables[cable][end], cables[cable][1 - end] // 2
    p_WS = (p_WE[2 * partner] + p_WE[2 * partner + 1]) / 2 + R_WR[partner] @ sites[cable, 1 - end]
    x, y = (R_WR[rod].T @ (p_WS - p_WE[cap]))[:2]
    return float(np.arctan2(y, x))


def _bearing(d_W: np.ndarray, R_WR: np.ndarray) -> np.ndarray:
    return (R_WR.T @ d_W)[:2]


def _slots(bearing: np.ndarray, roll: float) -> list[int]:
    """Site number of each cable of a cap: cyclic order kept, sum of squared site-to-partner distances least.

    bearing: (cable of this cap, 2) [m], partner caps seen along the rod.
    """
    n = len(bearing)
    if n == 0:
        return []
    around = np.argsort(np.mod(np.arctan2(bearing[:, 1], bearing[:, 0]) - roll, 2 * np.pi), kind="stable")
    angle = roll + 2 * np.pi * np.arange(n) / n
    site = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    gain = [float(np.sum(bearing[around] * site[(np.arange(n) + shift) % n])) for shift in range(n)]
    slots = np.empty(n, dtype=int)
    slots[around] = (np.arange(n) + int(np.argmax(gain))) % n
    return [int(s) for s in slots]
