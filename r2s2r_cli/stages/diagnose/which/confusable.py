"""Which effects predict nearly the same in these gaits, so that no log of theirs can tell them apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.material import Material


def confusable(m: Material, rows: Sequence[int]) -> tuple[tuple[str, str, float], ...]:
    """Of all pairs of the fits at `rows`, nearest first: the names of their effects, and half the squared whitened
    distance between what they predict, the nuisances and the second one's size fitted to the first [nats]; the smaller
    of both ways."""
    responses = {}
    for i in rows:
        fit = m.fits[i]
        p = len(fit.z)
        solver = Fits(m.arena)
        likely = solver.likely(fit)
        J = likely[:, None] * fit.jacobian
        Q, _ = np.linalg.qr(J[:, :p])
        off = fit.hypothesis.stack("off")[None]
        values = solver.values(fit.hypothesis, fit.z[None], off)
        without = m.arena.residuals(values, fit.z[None], away=fit.away[None])[0]
        response = likely * (fit.residual - without)
        responses[i] = (response - Q @ (Q.T @ response), J[:, p:] - Q @ (Q.T @ J[:, p:]))
    found = []
    for a, i in enumerate(rows):
        for j in rows[a + 1 :]:
            found.append((
                m.fits[i].hypothesis.effects[0], m.fits[j].hypothesis.effects[0],
                min(_distance(responses[i][0], responses[j]), _distance(responses[j][0], responses[i])),
            ))  # fmt: skip
    return tuple(sorted(found, key=lambda one: one[2]))


def _distance(of: np.ndarray, other: tuple[np.ndarray, np.ndarray]) -> float:
    basis = np.concatenate([other[0][:, None], other[1]], axis=1)
    if not np.isfinite(of).all() or not np.isfinite(basis).all():
        return float("nan")
    size, *_ = np.linalg.lstsq(basis, of, rcond=None)
    left = of - basis @ size
    return 0.5 * float(left @ left)
