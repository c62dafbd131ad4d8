"""Identified parameters: numbers that agree with each other, and with what they say about their worth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import REPORT, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Content

_KINDS = ("identification",)
ROUNDING = 1e-9
"""Of a correlation, and of a value at its bound, relative."""
TEST = 2
"""Code of `role`."""
ON_A_BOUND = 3
"""Code of `trust`."""
_INDICES = (
    ("trace", "start", "starts"), ("profiles", "parameter", "parameters"),
)  # fmt: skip
"""(group, dataset) counts the rows of a group."""
_BY_PARAMETER = ("covariance", "identifiability", "trace", "starts", "history")


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every row names a parameter or start that is there, and every table has all parameters",
    why="numbers of another table are numbers of other parameters",
    fix=REPORT,
)
def identification_tables_fit(content: Content) -> Iterator[Found]:
    """Indices outside their table, and axes of another length."""
    count = _rows(content, "parameters")
    for group in _BY_PARAMETER:
        spec = content.spec.group(group)
        for dataset in spec.datasets if spec else ():
            value = _get(content, group, dataset.path)
            if value is None or value.ndim != len(dataset.dims):
                continue
            found = [
                n for axis, n in zip(dataset.dims, value.shape, strict=True) if axis in ("parameter", "parameter2")
            ]
            if any(n != count for n in found):
                yield Found(f"{group}/{dataset.path}", "a table has another number of parameters", str(count),
                            " x ".join(map(str, found)))  # fmt: skip
    for group, name, table in _INDICES:
        index = _get(content, group, name)
        if index is None or not index.size:
            continue
        rows = _rows(content, table)
        excess = beyond(index.astype(float), 0, rows - 1)
        if (excess > 0).any():
            yield Found(f"{group}/{name}", f"a row of {group} names a row of {table} that is not there",
                        f"0 .. {rows - 1}" if rows else f"a row of {table}, which has none",
                        worst(index, excess, ("row",)))  # fmt: skip


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every parameter has one name, and every target interval one role",
    why="an interval that was trained on and tested makes the held-out error look better than it is",
    fix=REPORT,
)
def identification_rows_unique(content: Content) -> Iterator[Found]:
    """Doubles."""
    names = _get(content, "parameters", "name")
    for name, times in Counter([] if names is None else names.tolist()).items():
        if times > 1:
            yield Found("parameters/name", "two parameters have the same name", "a name for each", _text(name))
    runs, intervals = _get(content, "segments", "run"), _get(content, "segments", "interval")
    if runs is None or intervals is None or len(runs) != len(intervals):
        return
    for (run, interval), times in Counter(zip(runs.tolist(), intervals.tolist(), strict=True)).items():
        if times > 1:
            yield Found("segments/interval", "a target interval stands there twice", "once, with one role",
                        f"{_text(run)}:{interval}")  # fmt: skip


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="every identified value lies within its bounds and its own 95 % interval",
    why="a value outside was not found by this fit",
    fix=REPORT,
)
def identified_values_inside(content: Content) -> Iterator[Found]:
    """Values outside."""
    value, bounds = _get(content, "parameters", "value"), _get(content, "parameters", "bounds")
    if value is not None and bounds is not None and len(value) == len(bounds):
        yield from _outside(content, value, bounds[:, 0], bounds[:, 1], "its bounds")
    lower, upper = _get(content, "parameters", "lower"), _get(content, "parameters", "upper")
    if value is not None and lower is not None and upper is not None and len(value) == len(lower) == len(upper):
        yield from _outside(content, value, lower, upper, "its 95 % interval")


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="what is identifiable has a standard deviation above 0, what is not has none",
    why="a number with a narrow interval that the runs do not say is worse than no number",
    fix=REPORT,
)
def identified_deviations_honest(content: Content) -> Iterator[Found]:
    """Deviations that are missing, not positive, or there for what nobody knows."""
    sd, known = _get(content, "parameters", "sd"), _get(content, "parameters", "identifiable")
    if sd is None or known is None or len(sd) != len(known):
        return
    fixed = _get(content, "parameters", "trust")
    free = np.ones(len(sd), dtype=bool) if fixed is None or len(fixed) != len(sd) else fixed != 4
    bad = known & free & ~(sd > 0)
    if bad.any():
        yield Found("parameters/sd", "an identifiable parameter has no standard deviation", "above 0",
                    f"{number(sd[bad][0])} of {_name(content, int(np.flatnonzero(bad)[0]))}")  # fmt: skip
    bad = ~known & np.isfinite(sd)
    if bad.any():
        yield Found("parameters/sd", "a parameter that is not identifiable has a standard deviation", "NaN",
                    f"{number(sd[bad][0])} of {_name(content, int(np.flatnonzero(bad)[0]))}")  # fmt: skip


@check(
    "error",
    Content,
    kinds=_KINDS,
    what="the covariance is symmetric and nowhere negative, and its correlations lie within -1 .. 1",
    why="otherwise no numbers have this covariance",
    fix=REPORT,
)
def identified_covariance_valid(content: Content) -> Iterator[Found]:
    """Covariances that cannot be, over the parameters that have one."""
    covariance, correlation = _get(content, "covariance", "covariance"), _get(content, "covariance", "correlation")
    if correlation is not None and (beyond(correlation, -1 - ROUNDING, 1 + ROUNDING) > 0).any():
        yield Found("covariance/correlation", "a correlation is out of range", "-1 .. 1",
                    worst(correlation, beyond(correlation, -1, 1), ("row", "column")))  # fmt: skip
    if covariance is None or covariance.ndim != 2 or covariance.shape[0] != covariance.shape[1]:
        return
    known = np.flatnonzero(np.isfinite(np.diagonal(covariance)))
    block = covariance[np.ix_(known, known)]
    scale = np.sqrt(np.abs(np.diagonal(block)))
    shape = block / np.outer(scale, scale)
    if not len(known) or not np.isfinite(shape).all():
        return
    if not np.allclose(shape, shape.T, rtol=0, atol=1e-6):
        yield Found("covariance/covariance", "the covariance is not symmetric", "equal to its transpose",
                    f"correlations that differ by {number(np.abs(shape - shape.T).max())}")  # fmt: skip
    elif (smallest := float(np.linalg.eigvalsh(shape)[0])) < -1e-6:
        yield Found("covariance/covariance", "the covariance is negative in some direction", "eigenvalues of 0 or more",
                    f"{number(smallest)}, of the correlations")  # fmt: skip


@check(
    "warning",
    Content,
    kinds=_KINDS,
    what="no parameter ends on a bound",
    why="the runs ask for more than the bound allows: it is wrong, or the parameter makes up for what is missing",
    fix="r2s2r identify --help   # --free NAME=START,LOWER..UPPER widens a wrong bound; else look for what is missing",
)
def identified_within_bounds(content: Content) -> Iterator[Found]:
    """Parameters on a bound."""
    trust = _get(content, "parameters", "trust")
    for row in [] if trust is None else np.flatnonzero(trust == ON_A_BOUND).tolist():
        yield Found("parameters/trust", f"{_name(content, row)} ended on a bound", "inside", "on it")


@check(
    "warning",
    Content,
    kinds=_KINDS,
    what="held-out segments are predicted better than by 'nothing moves'",
    why="a simulator that is worse than standing still has learned nothing that can be used for planning",
    fix="look at the segments in 30-identify.html: a broken track in the training data, or too many free parameters",
)
def identification_predicts(content: Content) -> Iterator[Found]:
    """Measures over test segments that a baseline without motion beats."""
    role, value = _get(content, "measures", "role"), _get(content, "measures", "value")
    names, others = _get(content, "measures", "baseline"), _get(content, "measures", "baseline_value")
    metric = _get(content, "measures", "metric")
    if role is None or value is None or names is None or others is None or metric is None:
        return
    still = [k for k, name in enumerate(names.tolist()) if name == b"nothing moves"]
    if not still or others.shape != (len(role), len(names)) or len(value) != len(role):
        return
    for row in np.flatnonzero((role == TEST) & (value > others[:, still[0]])).tolist():
        yield Found("measures/value", f"{_text(metric[row])} of the test segments is worse than if nothing moved",
                    f"below {number(others[row, still[0]], 1e3)} mm", f"{number(value[row], 1e3)} mm")  # fmt: skip


def _outside(content: Content, value: np.ndarray, low: np.ndarray, high: np.ndarray, of: str) -> Iterator[Found]:
    low, high = np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)
    slack = ROUNDING * np.maximum(np.abs(value), 1e-300)
    for row in np.flatnonzero((value < low - slack) | (value > high + slack)).tolist():
        yield Found("parameters/value", f"{_name(content, row)} lies outside {of}",
                    f"{number(low[row])} .. {number(high[row])}", number(value[row]))  # fmt: skip


def _get(content: Content, group: str, name: str) -> np.ndarray | None:
    found = content.data.groups.get(group)
    value = found.datasets.get(name) if found is not None else None
    return value if isinstance(value, np.ndarray) else None


def _rows(content: Content, group: str) -> int:
    """Length of a table; 0 where it is not there."""
    first = {"parameters": "name", "starts": "cost"}[group]
    value = _get(content, group, first)
    return 0 if value is None else len(value)


def _name(content: Content, row: int) -> str:
    names = _get(content, "parameters", "name")
    return f"row {row}" if names is None or row >= len(names) else _text(names[row])


def _text(value: bytes) -> str:
    return value.decode("utf-8", errors="replace").replace("\n", " ") if isinstance(value, bytes) else str(value)
