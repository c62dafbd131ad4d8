"""The whole catalogue at a glance: finite responses of every effect and element, less what nuisances explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.candidates import Candidate
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.mixture import minus_log
from r2s2r_cli.stages.diagnose.which.prior import unlikely

LEAST_RESPONSE = 1.0
"""Whitened length below which a response is nothing: the effect cannot be seen in these gaits."""
CHUNK = 64
"""Responses kept at a time: whitened residuals of a long evidence are large."""
SHARES = np.array([1.0, 0.5, 0.2])
"""Of a response: what is there may be far smaller than what is tried, and its response is then about that share."""


@dataclass(frozen=True)
class Response:
    """One candidate in the screening.

    gain: robust log likelihood over the refit nominal model at its best try or a share of it, nuisances fitted
    linearly [nats]; size (k,): there, tried (k,): the whole
    try; start_z (p + q,): nuisances there. seen: whitened length of its largest response;
    absorbed: share of its square that the nuisances explain; direction (M,): that response per unit length, nuisances
    taken off.
    """

    candidate: Candidate
    gain: float
    size: np.ndarray
    tried: np.ndarray
    start_z: np.ndarray
    seen: float
    absorbed: float
    direction: np.ndarray

    @property
    def testable(self) -> bool:
        """Whether these gaits would show it at all."""
        return self.seen >= LEAST_RESPONSE


class _Projection:
    """The nuisances as a linear problem, without those (held) that a candidate sets itself. Q spans, weighted, what
    they can move."""

    def __init__(self, J: np.ndarray, weights: np.ndarray, precision: np.ndarray, held: Sequence[int] = ()) -> None:
        self.J = J.copy()
        self.J[:, list(held)] = 0.0
        self.normal = (self.J * weights[:, None]).T @ self.J + precision
        self.Q, _ = np.linalg.qr(np.sqrt(weights)[:, None] * np.delete(J, list(held), axis=1))


def screen(arena: Arena, base: Fit, candidates: Sequence[Candidate]) -> tuple[Response, ...]:
    """Responses of all candidates at the sizes they are tried at, best gain first. base: the refit nominal model."""
    fits = Fits(arena)
    rows = [(i, size) for i, one in enumerate(candidates) for size in one.tries]
    likely = fits.likely(base)
    by_row = likely**2
    Jn = base.jacobian[:, : len(base.z)]
    made: dict[tuple[int, ...], _Projection] = {}
    pull = arena.precision @ (base.z - arena.mean)
    best: dict[int, tuple[float, np.ndarray, np.ndarray, np.ndarray]] = {}
    shown: dict[int, tuple[float, float, np.ndarray]] = {}
    for first in range(0, len(rows), CHUNK):
        some = rows[first : first + CHUNK]
        values = np.concatenate([
            fits.values(Hypothesis((candidates[i],)), base.z[None], size[None]) for i, size in some
        ])  # fmt: skip
        residuals = arena.residuals(values, np.repeat(base.z[None], len(some), axis=0))
        for (i, size), residual in zip(some, residuals, strict=True):
            held = tuple(fits.overruled(Hypothesis((candidates[i],))))
            if held not in made:
                made[held] = _Projection(Jn, by_row, arena.precision, held)
            own = made[held]
            response = likely * (residual - base.residual)
            length = float(np.linalg.norm(response))
            left = response - own.Q @ (own.Q.T @ response)
            kept = float(np.linalg.norm(left))
            if length > shown.get(i, (0.0, 0.0, residual))[0]:
                share = 1.0 - (kept / length) ** 2 if length > 0 else 0.0
                shown[i] = (length, share, left / max(kept, 1e-12))
            along = base.residual + SHARES[:, None] * (residual - base.residual)
            pulls = own.J.T @ (by_row * along).T + pull[:, None]
            z = np.clip(base.z - np.linalg.solve(own.normal, pulls).T, arena.lower, arena.upper)
            after = along + (z - base.z) @ own.J.T
            data = minus_log(arena.squares(after), arena.logdets, arena.sizes).sum(axis=1)
            gains = base.cost - data - unlikely(arena, z)
            k = int(np.argmax(gains))
            if i not in best or gains[k] > best[i][0]:
                best[i] = (float(gains[k]), candidates[i].share(size, float(SHARES[k])), size, z[k])
    found = []
    for i, one in enumerate(candidates):
        length, share, direction = shown.get(i, (0.0, 0.0, np.zeros(len(base.residual))))
        gain, size, tried, z = best.get(i, (-np.inf, one.off, one.off, base.z))
        found.append(Response(one, gain, size, tried, z, length, share, direction.astype(np.float32)))
    return tuple(sorted(found, key=lambda one: -one.gain))
