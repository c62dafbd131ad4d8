"""From cap tracks to rods: caps at their true distance, poses, angular velocities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import NumericalError

RIGID_SOURCE = 0.3
"""A source whose rods vary by less than this share of what two free caps with its noise would show made them rigid."""
_ROUNDS = 12
"""Steps towards the least-squares point, each about the observed caps with the direction of the last one. Their error
shrinks by about (correction / length) x (ratio of the variances across and along) a step, 16-fold for
5 mm, 325 mm and 4."""
_LAST = 3
"""Newton steps onto the rod length that follow: what is left of it, squared over the length, a step."""


@dataclass(frozen=True)
class Rods:
    """Rigid rods of one run, world frame."""

    p_WE: np.ndarray
    """End caps [m], shape (frame, cap, 3)."""
    cov_p: np.ndarray
    """Covariance of each cap [m^2], shape (frame, cap, 3, 3)."""
    v_WE: np.ndarray
    """[m/s], shape (frame, cap, 3)."""
    cov_v: np.ndarray
    """Covariance of each cap's velocity [m^2/s^2], shape (frame, cap, 3, 3)."""
    correction: np.ndarray
    """How far each cap was moved [m], shape (frame, cap)."""


def is_rigid(p_WE: np.ndarray, noise_sd: np.ndarray) -> np.ndarray:
    """Whether the source had fitted rigid rods itself, shape (rod,).

    p_WE: observed caps [m], shape (frame, cap, 3). noise_sd: per axis [m], shape (cap, 3). Two free caps with this
    noise give a rod length whose variance is the sum of both along the rod; a rigid fit leaves far less.
    """
    bar = p_WE[:, 1::2] - p_WE[:, 0::2]
    length = np.linalg.norm(bar, axis=-1)
    u = bar / length[..., None]
    free = np.sqrt(np.mean(np.sum(u**2 * (noise_sd[0::2] ** 2 + noise_sd[1::2] ** 2), axis=-1), axis=0))
    return np.std(length, axis=0) < RIGID_SOURCE * free


def make_rigid(
    p_WE: np.ndarray,
    cov_p: np.ndarray,
    v_WE: np.ndarray,
    cov_v: np.ndarray,
    length: np.ndarray,
    informative: np.ndarray,
) -> Rods:
    """Move the caps of each rod to their distance, each by its share of the covariance; make the velocities agree.

    Weighted least squares: min (p - p0)' C^-1 (p - p0) with |p_odd - p_even| = length, found by linearising the length
    about the point of the step before; and for the velocities with (v_odd - v_even) along the rod = 0. Shapes as in
    `Rods`; length [m] and informative (bool) of shape (rod,). Where the source was rigid already (informative false)
    the length tells nothing new, and the covariance stays.
    Raises NumericalError where two caps of a rod coincide.
    """
    a0, b0 = p_WE[:, 0::2], p_WE[:, 1::2]
    ca, cb = cov_p[:, 0::2], cov_p[:, 1::2]
    a, b = a0, b0
    for _ in range(_ROUNDS):
        u, _ = _axis(a, b)
        step = ((np.sum(u * (b0 - a0), axis=-1) - length) / _along(ca + cb, u))[..., None]
        a, b = a0 + step * _times(ca, u), b0 - step * _times(cb, u)
    for _ in range(_LAST):
        u, now = _axis(a, b)
        step = ((now - length) / _along(ca + cb, u))[..., None]
        a, b = a + step * _times(ca, u), b - step * _times(cb, u)
    u, _ = _axis(a, b)
    va, vb = v_WE[:, 0::2].copy(), v_WE[:, 1::2].copy()
    da, db = cov_v[:, 0::2], cov_v[:, 1::2]
    step = (np.sum(u * (vb - va), axis=-1) / _along(da + db, u))[..., None]
    va += step * _times(da, u)
    vb -= step * _times(db, u)
    p, v = _pairs(a, b), _pairs(va, vb)
    return Rods(
        p_WE=p,
        cov_p=_pairs(_narrowed(ca, ca + cb, u, informative), _narrowed(cb, ca + cb, u, informative)),
        v_WE=v,
        cov_v=_pairs(_narrowed(da, da + db, u, informative), _narrowed(db, da + db, u, informative)),
        correction=np.linalg.norm(p - p_WE, axis=-1),
    )


def axes(p_WE: np.ndarray) -> np.ndarray:
    """Unit vectors from the even to the odd cap of each rod, shape (frame, rod, 3)."""
    return _axis(p_WE[:, 0::2], p_WE[:, 1::2])[0]


def orientations(u: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Orientation of each rod [xyzw], shape (frame, rod, 4), from its axis u, shape (frame, rod, 3).

    first: R_WR of the first frame, shape (rod, 3, 3), with z along u; its roll is a convention (`rod_frames` of
    `stages/init/attachment.py`: x points upwards). From there on each frame turns the one before by the smallest
    rotation that takes one axis to the next (Lu et al. 2022, arXiv 2205.14764), which has no part about the axis, so
    that the quaternions are continuous in sign as well.
    """
    q = np.empty((*u.shape[:2], 4))
    q[0] = [from_matrix(m) for m in first]
    for k in range(1, len(u)):
        across = rotate(q[k - 1], np.array([1.0, 0.0, 0.0]))
        turned = multiply(smallest_rotation(u[k - 1], u[k], fallback=across), q[k - 1])
        # Rounding would let z drift off the axis by 1e-16 a frame: turn what is left, which is again without roll.
        z = rotate(turned, np.array([0.0, 0.0, 1.0]))
        turned = multiply(smallest_rotation(z, u[k], fallback=across), turned)
        q[k] = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
    return q


def angular_velocities(u: np.ndarray, v_WE: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Angular velocity across each rod [rad/s], shape (frame, rod, 3): u x (v_odd - v_even) / length, no roll."""
    return np.cross(u, v_WE[:, 1::2] - v_WE[:, 0::2]) / length[:, None]


def smallest_rotation(a: np.ndarray, b: np.ndarray, *, fallback: np.ndarray) -> np.ndarray:
    """Quaternion [xyzw] of the smallest rotation from unit vector a to b, shape (..., 3) to (..., 4).

    Opposite vectors leave the axis open; `fallback`, a unit vector across a, is taken then.
    """
    q = np.concatenate([np.cross(a, b), 1.0 + np.sum(a * b, axis=-1, keepdims=True)], axis=-1)
    size = np.linalg.norm(q, axis=-1, keepdims=True)
    half_turn = np.concatenate([fallback, np.zeros((*fallback.shape[:-1], 1))], axis=-1)
    return np.where(size < 1e-9, half_turn, q / np.maximum(size, 1e-9))


def multiply(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Hamilton product q p of quaternions [xyzw]: first p, then q."""
    qv, qw, pv, pw = q[..., :3], q[..., 3:], p[..., :3], p[..., 3:]
    return np.concatenate(
        [qw * pv + pw * qv + np.cross(qv, pv), qw * pw - np.sum(qv * pv, axis=-1, keepdims=True)], axis=-1
    )


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vector v, shape (..., 3), turned by the unit quaternion q [xyzw]."""
    t = 2.0 * np.cross(q[..., :3], v)
    return v + q[..., 3:] * t + np.cross(q[..., :3], t)


def from_matrix(m: np.ndarray) -> np.ndarray:
    """Quaternion [xyzw], w >= 0, of a rotation matrix; from its largest component, so that no small one divides."""
    square = np.array([1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2],
                       1 - m[0, 0] - m[1, 1] + m[2, 2], 1 + m[0, 0] + m[1, 1] + m[2, 2]])  # fmt: skip
    rows = np.array([
        [square[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
        [m[0, 1] + m[1, 0], square[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], square[2], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], square[3]],
    ])  # fmt: skip
    q = rows[int(np.argmax(square))]
    q = q / np.linalg.norm(q)
    return q if q[3] >= 0 else -q


def _axis(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    bar = b - a
    length = np.linalg.norm(bar, axis=-1)
    if np.any(length < 1e-6):
        frame, rod = np.argwhere(length < 1e-6)[0].tolist()
        raise NumericalError(
            f"the two end caps of rod {rod} coincide, so the rod has no direction",
            where=f"caps/p_WE, kept frame {frame}",
            expected="two caps a rod length apart",
            received="0",
            hint="r2s2r validate   # says which frames of the recording are impossible",
        )
    return bar / length[..., None], length


def _narrowed(part: np.ndarray, both: np.ndarray, u: np.ndarray, informative: np.ndarray) -> np.ndarray:
    """Block of C - C h' (h C h')^-1 h C for one cap, with h the derivative of the length."""
    cu = _times(part, u)
    loss = cu[..., :, None] * cu[..., None, :] / _along(both, u)[..., None, None]
    return part - np.where(informative[:, None, None], loss, 0.0)


def _times(c: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.einsum("...ij,...j->...i", c, u)


def _along(c: np.ndarray, u: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...ij,...j->...", u, c, u)


def _pairs(even: np.ndarray, odd: np.ndarray) -> np.ndarray:
    """Put the even and odd caps back in order along axis 1."""
    return np.stack([even, odd], axis=2).reshape(len(even), -1, *even.shape[2:])
