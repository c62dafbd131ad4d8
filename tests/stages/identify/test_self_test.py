"""The self-test: what is planted, and how what came back is counted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.identify import self_test as module
from r2s2r_cli.stages.identify.found import ParameterFound
from r2s2r_cli.stages.identify.free import Coordinate, Free, Mapping, select
from r2s2r_cli.stages.identify.load import run_data
from r2s2r_cli.stages.identify.predict import Predictor
from r2s2r_cli.stages.identify.self_test import Fitted, drawn, planted, self_test
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from schemas.estimate import EstimateSettings
from schemas.results_identify import SelfTestReport
from tests.support import builders

SPEED = Free("motor_speed", "1", 0.8, 0.1, 2.0, Coordinate.LOG, 0.3)
SLOPE = Free("ground_slope_x", "rad", 0.0, -0.1, 0.1, Coordinate.LINEAR)
BOUNCE = Free("restitution", "1", 0.3, 0.0, 0.95, Coordinate.LOGIT)
NONE = (math.nan, math.nan)


def run_with(
    monkeypatch: pytest.MonkeyPatch, error: Sequence[float], *, sd: float, trust: Trust = Trust.IDENTIFIED
) -> SelfTestReport:
    """A self-test of motor_speed whose fits are off by `error`, case by case; NaN: it cannot be simulated."""
    truths: list[float] = []

    def planted(run: Any, predictor: Any, truth: np.ndarray, rng: np.random.Generator) -> Any:
        del predictor, rng
        truths.append(float(truth[0]))
        return run

    def fit(runs: Sequence[Any]) -> Fitted:
        off = error[len(truths) - 1]
        if math.isnan(off):
            raise NumericalError("the simulation left the finite numbers", hint="r2s2r status")
        value = truths[-1] + off
        one = ParameterFound(SPEED, value, sd, value - 1.96 * sd, value + 1.96 * sd, NONE, trust)
        return Fitted((one,), converged=True, rollouts=7)

    monkeypatch.setattr(module, "planted", planted)
    predictor: Any = SimpleNamespace(mapping=SimpleNamespace(frees=(SPEED,)))
    run: Any = SimpleNamespace(noise=np.full((6, 3), 0.002))
    return self_test([run], predictor, fit, cases=len(error), seed=3)


def test_bias_error_and_coverage(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors of +1, +1, -1 and +5 sd: bias 1.5 sd, rms error sqrt(7) sd, three of four intervals hold the truth."""
    found = run_with(monkeypatch, [0.01, 0.01, -0.01, 0.05], sd=0.01).parameters["motor_speed"]
    assert found.bias == pytest.approx(0.015)
    assert found.rmse == pytest.approx(0.01 * math.sqrt(7))
    assert (found.coverage, found.sd_reported, found.identifiable) == (0.75, 0.01, 1.0)


def test_what_is_not_identifiable_covers_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """No interval is counted that the report would not show, however narrow the solver's was."""
    found = run_with(monkeypatch, [0.0, 0.0], sd=0.01, trust=Trust.NOT_IDENTIFIABLE).parameters["motor_speed"]
    assert (found.coverage, found.sd_reported, found.identifiable) == (None, None, 0.0)


def test_robots_that_cannot_be_used_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """They lower the share that converged and are named; where none can be used that is an error."""
    report = run_with(monkeypatch, [0.0, math.nan, 0.0, 0.0], sd=0.01)
    assert report.converged == 0.75 and len(report.cases) == 3
    assert report.warnings == ("planted robot 2 could not be used: the simulation left the finite numbers",)
    assert report.noise_m == 0.002
    with pytest.raises(NumericalError, match="no planted robot"):
        run_with(monkeypatch, [math.nan, math.nan], sd=0.01)


def test_equal_seeds_plant_equal_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    """The seed decides the truths, which differ from case to case."""
    one, two = (run_with(monkeypatch, [0.0] * 5, sd=0.01) for _ in range(2))
    assert one == two
    assert len({case.truth["motor_speed"] for case in one.cases}) == 5


@pytest.mark.parametrize("free", [SPEED, SLOPE, BOUNCE], ids=lambda free: free.name)
def test_planted_values_lie_about_the_start_inside_the_bounds(free: Free) -> None:
    """Median at the start, spread as stated in the coordinate, never within 2 % of a bound."""
    rng = np.random.default_rng(1)
    values = np.array([drawn(free, rng) for _ in range(4000)])
    edge = 0.02 * (free.upper - free.lower)
    assert free.lower + edge <= values.min() and values.max() <= free.upper - edge
    z = np.array([free.to_z(value) for value in values])
    spread = {"log": 0.2, "linear": 0.02, "logit": 0.5}[free.coordinate]
    assert np.median(z) == pytest.approx(free.to_z(free.start), abs=0.05 * spread)
    assert np.percentile(np.abs(z - np.median(z)), 68.3) == pytest.approx(spread, rel=0.05)


@pytest.mark.slow
def test_planted_runs_are_as_noisy_as_the_recorded_ones_and_move_as_planted(tmp_path: Path) -> None:
    """Stamps, commands and intervals stay; the noise is that of the run; the caps follow the planted motor speed."""
    robot = builders.robot()
    frees = select(["motor_speed"], robot)
    predictor = Predictor(Mapping(robot, frees), cache_dir=tmp_path, threads=1)
    recording = builders.recording(images=False)
    run = run_data(recording, estimate(recording, robot, EstimateSettings())[0], "walk")
    rng = np.random.default_rng(5)
    slow, fast = (planted(run, predictor, np.array([value]), rng) for value in (0.2, 0.8))
    assert slow.t.tolist() == run.t.tolist() and slow.control.tolist() == run.control.tolist()
    assert len(slow.intervals) == len(run.intervals)
    quiet = run.intervals.first[1]  # in the first interval no motor turns: both differ by their noise alone
    apart = (slow.observed - fast.observed)[:quiet]
    assert np.std(apart) == pytest.approx(np.sqrt(2) * np.sqrt(np.mean(run.noise**2)), rel=0.25)
    moved = [np.linalg.norm(one.observed[-1] - one.observed[quiet], axis=-1).max() for one in (slow, fast)]
    assert moved[1] > 2 * moved[0]


def test_a_narrow_prior_plants_narrowly() -> None:
    """Nothing is planted that the prior calls impossible."""
    tight = Free("motor_speed", "1", 0.8, 0.1, 2.0, Coordinate.LOG, 0.01)
    rng = np.random.default_rng(2)
    assert np.std([math.log(drawn(tight, rng)) for _ in range(500)]) == pytest.approx(0.01, rel=0.1)
