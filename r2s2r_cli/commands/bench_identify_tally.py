"""What `bench identify` counts: solved cases, intervals that cover, and how sure a share is."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from r2s2r_cli.commands.bench_identify_case import Case, Fit
from schemas.results_bench import IdentifiedBy, IdentifiedCase, Share

NORMAL_95 = 1.959963984540054
"""Half the width of a 95 % interval in standard deviations."""
NEAR, NEAR_SD = 0.02, 3.0
"""A case is solved where every value lies within the larger of this share and so many reported standard deviations."""
NEAR_RAD = 0.02
"""The same share for attachment phases, whose planted value may be 0 [rad]."""


def judged(case: Case, truth: np.ndarray, fit: Fit | str, spent_s: float = 0.0) -> IdentifiedCase:
    """A fit beside what was planted, (n,), phases after the values of the case; a text says why there is none, and
    spent_s, processor time [s], what that took."""
    start = np.concatenate([case.start, np.zeros(len(truth) - len(case.start))])
    failed = fit if isinstance(fit, str) else None
    if isinstance(fit, str):
        none = np.full(len(truth), np.nan)
        fit = Fit(estimate=start, low=none, high=none, cpu_s=spent_s, rollouts=0.0, rms_m=0.0)
    known = np.isfinite(fit.low) & np.isfinite(fit.high)
    sd = np.where(known, (fit.high - fit.low) / (2.0 * NORMAL_95), 0.0)
    near = np.where(np.arange(len(truth)) < len(case.start), NEAR * np.abs(truth), NEAR_RAD)
    solved = np.abs(fit.estimate - truth) <= np.maximum(near, NEAR_SD * sd)
    return IdentifiedCase(
        seed=case.seed, truth=_floats(truth), start=_floats(start), estimate=_floats(fit.estimate),
        low=_floats_or_none(fit.low), high=_floats_or_none(fit.high), cpu_s=fit.cpu_s, rollouts=fit.rollouts,
        rms_mm=1e3 * fit.rms_m, solved=failed is None and bool(solved.all()), failed=failed,
    )  # fmt: skip


def summed_up(what: str, cases: Sequence[IdentifiedCase], ours_cpu_s: Sequence[float]) -> IdentifiedBy:
    """A tool over all cases. ours_cpu_s: processor time that ours took for each of them [s], (case,)."""
    covered, none, errors = 0, 0, []
    for one in cases:
        for value, start, estimate, low, high in zip(
            one.truth, one.start, one.estimate, one.low, one.high, strict=True
        ):
            errors.append(abs(estimate - value) / (abs(value) if start != 0 else 1.0))
            if low is None or high is None:
                none += 1
            else:
                covered += low <= value <= high
    cpu, ours = np.array([one.cpu_s for one in cases]), np.array(ours_cpu_s)
    return IdentifiedBy(
        what=what, cases=tuple(cases), solved=share(sum(one.solved for one in cases), len(cases)),
        covered=share(covered, len(errors)), without_interval=none, cpu_median_s=float(np.median(cpu)),
        error_median=float(np.median(errors)), cpu_ratio=float(cpu.sum() / ours.sum()),
        cpu_median_ratio=float(np.median(cpu / ours)),
    )  # fmt: skip


def share(count: int, total: int) -> Share:
    """`count` of `total` with Wilson's interval (1927), as if all were independent."""
    p, n, q = count / total, total, NORMAL_95**2
    middle = (p + q / (2 * n)) / (1 + q / n)
    half = NORMAL_95 / (1 + q / n) * math.sqrt(p * (1 - p) / n + q / (4 * n * n))
    return Share(count=count, total=total, low=max(0.0, middle - half), high=min(1.0, middle + half))


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _floats_or_none(values: np.ndarray) -> tuple[float | None, ...]:
    return tuple(float(value) if math.isfinite(value) else None for value in values)
