"""The self-test: known values planted in the user's own set-up, fitted as the recording would be, and compared.

The planted robot is the engine's own, so that what the engine lacks does not show here: what cannot be found in this
test cannot be found in the recording either, not the reverse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import NumericalError, R2S2RError
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.found import ParameterFound
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.judged import simulated_paths
from r2s2r_cli.stages.identify.load import run_data
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.request import Progress, Step, silent
from r2s2r_cli.stages.identify.start import start_states
from r2s2r_cli.stages.identify.windows import window
from schemas.results_identify import Recovered, RecoveredCase, SelfTestReport

SPREAD = {Coordinate.LOG: 0.2, Coordinate.LOGIT: 0.5, Coordinate.LINEAR: 0.1}
"""Standard deviation of the planted values about the means of their priors, where these are wider: in the coordinate;
LINEAR: as a share of the range. A fifth is what robots are off by; wilder ones would often not walk at all."""
MARGIN = 0.02
"""Share of its range within which no value is planted: a truth on a bound cannot be covered from both sides."""


@dataclass(frozen=True)
class Fitted:
    """What one fit of planted runs gave."""

    parameters: tuple[ParameterFound, ...]
    converged: bool
    rollouts: int


Fit = Callable[[Sequence[RunData]], Fitted]


def self_test(
    runs: Sequence[RunData],
    predictor: Predictor,
    fit: Fit,
    *,
    cases: int,
    seed: int,
    progress: Progress = silent,
) -> SelfTestReport:
    """Plant `cases` robots, fit each, and say what came back. runs: those that are trained on.

    A robot that cannot be simulated over the runs, or cannot be fitted, counts as not converged and is named in the
    warnings. Raises NumericalError where that is so for all of them.
    """
    frees = predictor.mapping.frees
    rng = np.random.default_rng(seed)
    found: list[RecoveredCase] = []
    warnings: list[str] = []
    for case in range(cases):
        truth = np.array([drawn(free, rng) for free in frees])
        try:
            fitted = fit([planted(run, predictor, truth, rng) for run in runs])
        except R2S2RError as error:
            warnings.append(f"planted robot {case + 1} could not be used: {error.what}")
            continue
        found.append(_case(frees, truth, fitted))
        progress(Step("self-test", case + 1, cases))
    if not found:
        raise NumericalError(
            "no planted robot could be simulated and fitted", where="--self-test", expected=f"most of {cases}",
            received=warnings[0], hint="r2s2r identify --self-test --free motor_speed --free friction",
        )  # fmt: skip
    noise = float(np.median([np.median(run.noise) for run in runs]))
    return SelfTestReport(
        cases=tuple(found),
        parameters={free.name: recovered(free, found) for free in frees},
        noise_m=noise,
        converged=sum(case.converged for case in found) / cases,
        seed=seed,
        warnings=tuple(warnings),
    )


def drawn(free: Free, rng: np.random.Generator) -> float:
    """A value to plant: normal about the mean of the prior in the coordinate, inside the bounds."""
    if free.coordinate is Coordinate.LINEAR:
        usual = SPREAD[Coordinate.LINEAR] * (free.upper - free.lower)
    else:
        usual = SPREAD[free.coordinate]
    value = free.from_z(free.to_z(free.mean) + min(usual, free.prior_sd) * float(rng.normal()))
    edge = MARGIN * (free.upper - free.lower)
    return float(np.clip(value, free.lower + edge, free.upper - edge))


def planted(run: RunData, predictor: Predictor, truth: np.ndarray, rng: np.random.Generator) -> RunData:
    """The run as the robot with the values `truth` (n,) would have given it: same commands, stamps and noise.

    Simulated without interruption from the run's first pose at rest, observed with white noise, and estimated as every
    recording is. Raises NumericalError, InputError where the robot cannot be simulated.
    """
    state = start_states(run, predictor, truth, 1)[0]
    whole = window(run, tuple(range(1, len(run.intervals) + 1)), state, whole=True)
    p_WE = simulated_paths(predictor, truth, [whole])[0]
    frames = np.concatenate([[whole.first], whole.frames])
    caps = p_WE + run.noise * rng.normal(size=p_WE.shape)
    return estimated(run, frames, caps, predictor)


def estimated(run: RunData, frames: np.ndarray, caps: np.ndarray, predictor: Predictor) -> RunData:
    """The run with other observations: caps (frame, cap, 3) [m] at the given frames, through the estimate."""
    from r2s2r_cli.stages.estimate import estimate
    from schemas.estimate import EstimateSettings

    facts = {
        "origin": "simulation",
        "nature": "simulated",
        "source": "self-test",
        "robot": predictor.mapping.robot.name,
    }
    stream = {
        "t": run.t[frames], "p_WE": caps, "drop_reason": np.zeros(len(frames), np.uint8),
        "source_row": np.arange(len(frames)), "noise_sd": run.noise,
    }  # fmt: skip
    commands = {"t": run.t_command, "target": run.target, "control": run.control}
    recording = ArtifactData(
        "recording",
        {
            f"runs/{run.name}": Group({}, facts),
            f"runs/{run.name}/caps": Group(stream),
            f"runs/{run.name}/commands": Group(commands),
        },
    )
    states, _ = estimate(recording, predictor.mapping.robot, EstimateSettings())
    return replace(run_data(recording, states, run.name), sampled=run.sampled)


def recovered(free: Free, cases: Sequence[RecoveredCase]) -> Recovered:
    """One parameter over all cases, in its unit."""
    error = np.array([case.value[free.name] - case.truth[free.name] for case in cases])
    known = [case.sd[free.name] for case in cases]
    sds = [sd for sd in known if sd is not None]
    covered = [one for case in cases if (one := case.covered[free.name]) is not None]
    return Recovered(
        unit=free.unit,
        bias=float(error.mean()),
        rmse=float(np.sqrt(np.mean(error**2))),
        sd_reported=float(np.median(sds)) if sds else None,
        coverage=sum(covered) / len(covered) if covered else None,
        identifiable=len(sds) / len(cases),
    )


def _case(frees: Sequence[Free], truth: np.ndarray, fitted: Fitted) -> RecoveredCase:
    values = {free.name: float(value) for free, value in zip(frees, truth, strict=True)}
    sd: dict[str, float | None] = {}
    covered: dict[str, bool | None] = {}
    for one in fitted.parameters:
        name = one.free.name
        spread, lower, upper = one.interval
        sd[name] = float(spread) if np.isfinite(spread) else None
        covered[name] = bool(lower <= values[name] <= upper) if np.isfinite([lower, upper]).all() else None
    return RecoveredCase(
        truth=values, value={one.free.name: float(one.value) for one in fitted.parameters}, sd=sd, covered=covered,
        converged=fitted.converged, rollouts=fitted.rollouts,
    )  # fmt: skip
