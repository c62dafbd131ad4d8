"""The six-bar tensegrity in closed form: three pairs of parallel rods, 24 cables of one length.

Rod (k, s), k = 0..2, s = -1, +1, runs along axis k at distance L/4 along axis k + 1 (cyclic). Two caps of different
rods that share an octant are sqrt(6)/4 L apart: 8 closed triangles, 24 cables, 4 a cap. It is the icosahedron-like
shape of SUPERball (NTRT, src/examples) in its symmetric equilibrium.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.init.prism import lay_down

EDGE_PER_ROD = np.sqrt(6.0) / 4.0
"""Cable length over rod length, both between cap centres."""


def sixbar_caps(rod_length: float) -> np.ndarray:
    """End caps [m], shape (12, 3), around the origin. Caps 2i, 2i+1 belong to rod i = 2k + (s > 0)."""
    p = np.zeros((12, 3))
    for rod in range(6):
        axis, side = rod // 2, 2 * (rod % 2) - 1
        p[2 * rod : 2 * rod + 2, (axis + 1) % 3] = side * rod_length / 4
        p[2 * rod, axis] = -rod_length / 2
        p[2 * rod + 1, axis] = rod_length / 2
    return p


def sixbar_triangles() -> tuple[tuple[tuple[int, int, int], bool], ...]:
    """The 8 closed triangles, (three caps, actuated), one an octant of signs s.

    Actuated are the four octants whose signs multiply to +1: no two of them share a cap, so each cap has two winched
    and two passive cables.
    """
    found = []
    for octant in range(8):
        sign = [1 if octant >> k & 1 else -1 for k in range(3)]
        caps = [2 * (2 * k + (sign[(k + 1) % 3] > 0)) + (sign[k] > 0) for k in range(3)]
        found.append(((caps[0], caps[1], caps[2]), sign[0] * sign[1] * sign[2] > 0))
    return tuple(found)


def sixbar_cables() -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """(12 actuated, 12 passive) cables as pairs of end caps, lower number first, sorted."""
    pairs: dict[bool, list[tuple[int, int]]] = {True: [], False: []}
    for caps, actuated in sixbar_triangles():
        for i, j in ((0, 1), (0, 2), (1, 2)):
            pairs[actuated].append((min(caps[i], caps[j]), max(caps[i], caps[j])))
    return tuple(sorted(pairs[True])), tuple(sorted(pairs[False]))


def sixbar_support() -> tuple[int, int, int]:
    """The actuated triangle on which it rests: the first in order of octants."""
    return next(caps for caps, actuated in sixbar_triangles() if actuated)


def sixbar_rest(rod_length: float, cap_radius: float) -> np.ndarray:
    """The six-bar at rest, p_WE [m], shape (12, 3): on one actuated triangle, whose first edge runs along x."""
    p = sixbar_caps(rod_length)
    support = sixbar_support()
    return lay_down(p, support, p[support[1]] - p[support[0]], cap_radius)
