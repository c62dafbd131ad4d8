"""Requests that no fit can meet: starts on a bound, parameters that change nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.solve.problem import Problem

NOTHING = 1e-4
"""Change of all residuals together [sd] for a whole width that counts as none: far below any noise."""
ON_BOUND = 1e-9
"""Distance, relative to a coordinate beyond 1, that is on the bound."""


def refuse_bounds(problem: Problem, z0: np.ndarray, frees: Sequence[Free]) -> None:
    """Raises InputError where a parameter starts on a bound or beyond: the fit could leave it one way at most."""
    for i, free in enumerate(frees):
        low, high = float(problem.lower[i]), float(problem.upper[i])
        margin = ON_BOUND * max(1.0, abs(float(z0[i])))
        inside = np.isfinite(z0[i]) and low + margin < z0[i] < high - margin
        if not inside or not free.lower < free.start < free.upper:
            value = free.from_z(float(z0[i])) if np.isfinite(z0[i]) else free.start
            raise InputError(
                f"{free.name} starts on a bound", where="--free", expected=f"inside {free.lower:g} .. {free.upper:g}",
                received=f"{value:g}",
                hint=f"r2s2r identify --free {free.name}={_middle(free):g},{free.lower:g}..{free.upper:g}",
            )  # fmt: skip


def refuse_hopeless(
    names: tuple[str, ...], dead: np.ndarray, stalled: np.ndarray, norm: np.ndarray, frees: Sequence[Free]
) -> None:
    """Raises InputError for parameters that change nothing, then for those without a derivative where they start.

    dead, stalled: (p,) bool; norm: (p,), change of all residuals for one width [sd].
    """
    for bad, what in ((dead, "has no effect on the compared frames"), (stalled, "has no derivative where it starts")):
        if bad.any():
            i = int(np.flatnonzero(bad)[0])
            bad_names = [name for name, one in zip(names, bad, strict=True) if one]
            fix = " ".join(f"--fix {name}={frees[names.index(name)].mean:g}" for name in bad_names)
            raise InputError(
                f"{', '.join(bad_names)} {what}", where="--free",
                expected=f"residuals that change by {NOTHING:g} sd or more within what is thought possible",
                received=f"{norm[i]:.1e} sd for {names[i]}" + (", more further away" if bad is stalled else ""),
                hint=f"r2s2r identify {fix}",
            )  # fmt: skip


def _middle(free: Free) -> float:
    """A start that is not on a bound."""
    low, high = free.lower, free.upper
    if free.coordinate is Coordinate.LOG and low > 0:
        return float(np.sqrt(low * high))
    return 0.5 * (low + high) if np.isfinite(high - low) else low + 1.0 if np.isfinite(low) else high - 1.0
