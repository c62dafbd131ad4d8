"""The 3-bar prism in closed form: shape from rod length and triangle edges, and its resting pose.

The prism has a threefold axis z. Its even caps (0, 2, 4) form one actuated triangle, its odd caps (1, 3, 5) the other,
and each rod turns by 150 degrees about the axis from its even to its odd cap: the twist at which a 3-bar prism with
equal triangles is in equilibrium under pure prestress (Connelly and Terrell, "Globally rigid symmetric tensegrities",
1995: twist = 90 + 180/n degrees). The passive tendons then turn by 30 degrees.

The hand of the prism (even caps clockwise, seen from the odd side) is that of the real robot: in the first frame of
the published crawl, and in the authors' simulator configurations.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.errors import InputError

TWIST = np.deg2rad(150.0)
"""Turn of a rod about the prism's axis, even to odd cap [rad]."""

PRISM_CABLES: tuple[tuple[int, int], ...] = (
    (3, 5), (1, 3), (1, 5), (0, 2), (0, 4), (2, 4), (2, 5), (0, 3), (1, 4),
)  # fmt: skip
"""End caps of cables 0..8: 0..2 the odd triangle, 3..5 the even one, 6..8 the passive tendons."""

PRISM_SUPPORT = (0, 2, 5)
"""Caps on the ground at rest: rod 2-3 lies low in the centre, the rods 0-1 and 4-5 lean on either side (the paper's
rest state). The real crawl starts on these three."""

_EVEN_ANGLE = -np.deg2rad([0.0, 120.0, 240.0])
_ROUNDING = 1e-9
"""Heights and lengths below this [m] are rounding, not geometry."""


def prism_caps(rod_length: float, edge_odd: float, edge_even: float) -> np.ndarray:
    """End caps [m], shape (6, 3), in the prism's own frame: z its axis, origin in the middle.

    rod_length: cap centre to cap centre [m]. edge_odd, edge_even: side of the triangles 1-3-5 and 0-2-4 [m].
    Raises InputError where no rod of that length joins such triangles.
    """
    p = np.empty((6, 3))
    height = _height(rod_length, edge_odd, edge_even)
    for first, radius, angle, z in (
        (0, edge_even / np.sqrt(3.0), _EVEN_ANGLE, -height / 2),
        (1, edge_odd / np.sqrt(3.0), _EVEN_ANGLE + TWIST, height / 2),
    ):
        p[first::2, 0] = radius * np.cos(angle)
        p[first::2, 1] = radius * np.sin(angle)
        p[first::2, 2] = z
    return p


def prism_caps_rate(
    rod_length: float, edge_odd: float, edge_even: float, edge_odd_rate: float, edge_even_rate: float
) -> np.ndarray:
    """Time derivative of `prism_caps` [m/s], shape (6, 3), for edges that change at the given rates [m/s]."""
    odd, even = edge_odd / np.sqrt(3.0), edge_even / np.sqrt(3.0)
    d_odd, d_even = edge_odd_rate / np.sqrt(3.0), edge_even_rate / np.sqrt(3.0)
    height = _height(rod_length, edge_odd, edge_even)
    d_height = (np.cos(TWIST) * (odd * d_even + even * d_odd) - odd * d_odd - even * d_even) / height
    v = np.empty((6, 3))
    for first, rate, angle, z in (
        (0, d_even, _EVEN_ANGLE, -d_height / 2),
        (1, d_odd, _EVEN_ANGLE + TWIST, d_height / 2),
    ):
        v[first::2, 0] = rate * np.cos(angle)
        v[first::2, 1] = rate * np.sin(angle)
        v[first::2, 2] = z
    return v


def resting_rotation(p: np.ndarray, support: tuple[int, ...], forward: np.ndarray) -> np.ndarray:
    """Rotation R_WP, shape (3, 3), that lays a body on three of its caps.

    p: caps [m], shape (cap, 3), in the body's frame P. support: three caps that become equally high, all others above.
    forward: direction in P whose horizontal part becomes the world's x axis.
    Raises InputError where another cap lies below the plane of the three, or `forward` is perpendicular to it.
    """
    a, b, c = p[list(support)]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    if normal @ (p.mean(axis=0) - a) < 0:
        normal = -normal
    lowest = float(((p - a) @ normal).min())
    if lowest < -_ROUNDING:
        raise InputError(
            f"the robot cannot rest on end caps {list(support)}, another cap lies {-lowest * 1e3:.1f} mm lower",
            where="rest pose",
            expected="three caps of one outer face",
            hint="choose shorter actuated edges or another face",
        )
    x = forward - (forward @ normal) * normal
    if np.linalg.norm(x) < _ROUNDING:
        raise InputError(
            "the forward direction is vertical in the rest pose", where="rest pose", hint="choose another direction"
        )
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(normal, x), normal])


def lay_down(p: np.ndarray, support: tuple[int, ...], forward: np.ndarray, cap_radius: float) -> np.ndarray:
    """End caps at rest p_WE [m], shape (cap, 3): centroid above the origin, lowest cap centres at z = cap_radius."""
    p_WE = (p - p.mean(axis=0)) @ resting_rotation(p, support, forward).T
    p_WE[:, 2] += cap_radius - p_WE[:, 2].min()
    return p_WE


def prism_rest(rod_length: float, edge: float, cap_radius: float) -> np.ndarray:
    """The prism at rest, p_WE [m], shape (6, 3): on caps 0, 2, 5, its axis (even to odd) along x."""
    p = prism_caps(rod_length, edge, edge)
    return lay_down(p, PRISM_SUPPORT, np.array([0.0, 0.0, 1.0]), cap_radius)


def _height(rod_length: float, edge_odd: float, edge_even: float) -> float:
    odd, even = edge_odd / np.sqrt(3.0), edge_even / np.sqrt(3.0)
    chord2 = odd**2 + even**2 - 2 * odd * even * np.cos(TWIST)
    if not (edge_odd > 0 and edge_even > 0 and chord2 < rod_length**2):  # so written that NaN fails
        raise InputError(
            "no prism with these triangles",
            where="prism",
            expected=f"triangle edges above 0, and a chord shorter than the rod ({rod_length:g} m)",
            received=f"edges {edge_odd:g} and {edge_even:g} m, chord {np.sqrt(chord2):.4g} m",
            hint="shorten the actuated edges, or give the rod length from cap centre to cap centre in metres",
        )
    return float(np.sqrt(rod_length**2 - chord2))
