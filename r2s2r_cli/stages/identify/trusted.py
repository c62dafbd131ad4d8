"""After a fit: how sure each parameter is, from covariance, profile likelihood, other starts and re-drawn noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.identify.found import ParameterFound, ProfileFound
from r2s2r_cli.stages.identify.free.base import Free, values_of
from r2s2r_cli.stages.identify.rounds import MOST_UNKNOWNS, Fit, members_for
from r2s2r_cli.stages.identify.settled import spread_of
from r2s2r_cli.stages.identify.solve.loss import LOSSES
from r2s2r_cli.stages.identify.solve.population import moving_of
from r2s2r_cli.stages.identify.solve.problem import Evaluation
from r2s2r_cli.stages.identify.solve.record import names_on_bound
from r2s2r_cli.stages.identify.trust.covariance import Covariance
from r2s2r_cli.stages.identify.trust.identifiability import Identifiability, Trust, identifiability
from r2s2r_cli.stages.identify.trust.profile import by_derivatives, by_population, profile
from r2s2r_cli.stages.identify.trust.redraw import redraw_linear, spans
from r2s2r_cli.stages.identify.trust.worth import worth

LINEAR_DRAWS = 1000
NOT_SHOWN = "the training intervals do not show it"


@dataclass(frozen=True)
class Sureness:
    """parameters in the order of the fit; covariance of z; after: what the data say at the solution. reach: (p, 2),
    smallest and largest value of other starts and of noise drawn anew."""

    parameters: tuple[ParameterFound, ...]
    spread: Covariance
    after: Identifiability
    reach: np.ndarray


def sureness(fitted: Fit, others: np.ndarray, *, loss: str, seed: int) -> Sureness:
    """Of a finished fit. others: parameters (k, p), z, of other fits that explain the data about as well."""
    problem, solution, frees = fitted.problem, fitted.solution, fitted.problem.frees
    robust, group = LOSSES[loss], problem.cluster
    spread = spread_of(problem, solution, robust, fitted.drawn)
    after = identifiability(
        problem, solution.z, frees,
        evaluation=Evaluation(solution.residual, solution.jacobian, problem.block), weight=solution.weight,
        inflation=spread.inflation, refuse=False,
    )  # fmt: skip
    drawn = redraw_linear(problem, solution, group, loss=robust, block=problem.block, draws=LINEAR_DRAWS, seed=seed)
    reach = spans(frees, drawn.z, others if len(others) else None)
    return Sureness(_parameters(fitted, spread, after, reach), spread, after, reach)


def _parameters(
    fitted: Fit, spread: Covariance, after: Identifiability, reach: np.ndarray
) -> tuple[ParameterFound, ...]:
    problem, frees = fitted.problem, fitted.problem.frees
    values = values_of(frees, fitted.solution.z[: len(frees)])
    bound = names_on_bound(
        values, np.array([f.lower for f in frees]), np.array([f.upper for f in frees]), problem.names
    )
    found = []
    judged = worth(after, spread, frees)
    for k, free in enumerate(frees):
        trust, reason = judged[k]
        if free.name in problem.held:
            trust, reason = Trust.NOT_IDENTIFIABLE, f"{NOT_SHOWN}: {held_as(free)}"
            if free.name in fitted.alike:
                reason = f"{NOT_SHOWN}: held as the {fitted.alike[free.name]} others are"
        elif trust is not Trust.NOT_IDENTIFIABLE and free.name in bound and values[k] != free.start:
            trust, reason = Trust.ON_BOUND, "the runs ask for more than its bound allows"
        wide = (np.nan, np.nan) if trust is Trust.NOT_IDENTIFIABLE else (float(reach[k, 0]), float(reach[k, 1]))
        found.append(
            ParameterFound(
                free=free, value=float(values[k]), sd=float(spread.sd[k]), lower=float(spread.lower[k]),
                upper=float(spread.upper[k]), range=wide, trust=trust,
                reason=reason,
            )
        )  # fmt: skip
    return tuple(found)


def held_as(free: Free) -> str:
    """Where a number is held that the data do not show; of an effect with how far from there it may be."""
    if free.off is None:
        return "held at its start"
    unit = "" if free.unit == "1" else f" {free.unit}"
    where = "the mean of its prior" if free.shape else "which is off"
    wide = f"; prior sd {free.prior_sd:.3g}{unit}" if np.isfinite(free.prior_sd) else ""
    return f"held at {free.mean:g}{unit}, {where}{wide}"


def weakest(sure: Sureness, count: int) -> tuple[int, ...]:
    """Rows of the parameters of which the data say least, among those of which they say something."""
    rows = [k for k in sure.after.weakest if sure.parameters[k].identifiable]
    return tuple(rows[:count])


def profiled(
    fitted: Fit, sure: Sureness, rows: tuple[int, ...], *, loss: str, seed: int, progress: Callable[[int], None]
) -> tuple[tuple[ProfileFound, ...], np.ndarray | None]:
    """Profile likelihood of some parameters; and all unknowns where one came upon a lower cost, else None."""
    problem, solution = fitted.problem, fitted.solution
    few = len(moving_of(problem)) <= MOST_UNKNOWNS
    found: list[ProfileFound] = []
    better = None
    for number, row in enumerate(rows):
        search = by_derivatives(problem, row, LOSSES[loss], max_iterations=3)
        if few:
            search = by_population(
                problem, solution, row, LOSSES[loss], members=members_for(problem), inflation=sure.spread.inflation,
                seed=seed,
            )  # fmt: skip
        one = profile(problem, solution, problem.frees, row, sure.spread, points=5, search=search)
        found.append(
            ProfileFound(
                row=row, value=one.value, cost=one.rise, interval=(one.lower, one.upper), threshold=one.threshold,
                words=one.words,
            )
        )  # fmt: skip
        better = one.better if better is None else better
        progress(number + 1)
    return tuple(found), better


def widened_by(fitted: Fit, sure: Sureness, profiles: Sequence[ProfileFound]) -> Sureness:
    """The same with intervals that hold those of the profiles as well: where the cost is rough or crooked, these see
    what a covariance does not. Standard deviations grow as the intervals do, correlations stay."""
    spread, frees = sure.spread, fitted.problem.frees
    share = np.ones(len(frees))
    low, high = spread.lower.copy(), spread.upper.copy()
    for one in profiles:
        k, free = one.row, frees[one.row]
        ends = [one.value[at] if np.isnan(end) else end for at, end in zip((0, -1), one.interval, strict=True)]
        usual = float(spread.quantile[k] * spread.sd_z[k])
        if not (np.isfinite(usual) and usual > 0) or (low[k] <= min(ends) and max(ends) <= high[k]):
            continue
        low[k], high[k] = min(low[k], *ends), max(high[k], *ends)
        wide = 0.5 * (free.to_z(high[k]) - free.to_z(low[k])) / usual
        share[k] = wide if 1.0 < wide < np.inf else 1.0
    if np.array_equal(low, spread.lower) and np.array_equal(high, spread.upper):
        return sure
    grown = replace(
        spread, covariance=spread.covariance * np.outer(share, share), sd=spread.sd * share, lower=low, upper=high
    )
    return replace(sure, spread=grown, parameters=_parameters(fitted, grown, sure.after, sure.reach))
