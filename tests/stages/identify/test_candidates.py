"""Many candidates at once are each candidate by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.identify import candidates
from r2s2r_cli.stages.identify.candidates import longest, predict_candidates
from r2s2r_cli.stages.identify.offsets import StartSpread, count
from r2s2r_cli.stages.identify.residuals import CapResiduals
from r2s2r_cli.stages.identify.windows import window
from tests.stages.identify.replayed import predictor_of, start, walk

SPECS = ("motor_speed=0.7,~0.2", "friction=0.7,~0.3", "command_delay=0.02,0..0.2,~0.1", "ground_height=0.001,~0.005")


def test_each_candidate_is_what_it_is_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows of two lengths, own delays, own ground, moved starts, split over several batches: as `predict`, to
    rounding."""
    predictor = predictor_of(*SPECS)
    run = walk(3)
    windows = [window(run, (1, 2, 3), start()), window(run, (1,), start()), window(run, (1,), start())]
    rng = np.random.default_rng(0)
    values = np.array([0.7, 0.7, 0.02, 0.001]) * (1 + 0.2 * rng.uniform(-1, 1, (5, 4)))
    offsets = 1e-3 * rng.normal(size=(5, 3, count(predictor.structure)))
    monkeypatch.setattr(candidates, "MOST", 4)
    for moved in (None, offsets):
        found = predict_candidates(predictor, windows, values, moved)
        for k, one in enumerate(values):
            alone = predictor.predict(windows, one, None if moved is None else moved[k]).p_WE
            np.testing.assert_allclose(found[k], alone, atol=1e-12)


def test_windows_with_one_start_are_simulated_once() -> None:
    """A short window is the beginning of a longer one with the same start; another start is another simulation."""
    predictor = predictor_of(*SPECS)
    run, state = walk(3), start()
    windows = [window(run, numbers, state) for numbers in ((1,), (1, 2, 3), (1, 2))]
    windows.append(window(run, (1, 2), replace(state)))
    assert longest(windows) == [1, 1, 1, 3]
    values = np.array([[0.7, 0.7, 0.02, 0.001], [0.6, 0.8, 0.0, 0.0]])
    before = predictor.rollouts
    found = predict_candidates(predictor, windows, values)
    assert predictor.rollouts - before == 2 * 2
    for k, one in enumerate(values):
        np.testing.assert_allclose(found[k], predictor.predict(windows, one).p_WE, atol=1e-12)


def test_residuals_of_many_points_are_those_of_each() -> None:
    """`CapResiduals.residuals` against `evaluate`; a candidate that leaves the finite numbers is nan, alone."""
    predictor = predictor_of(*SPECS)
    problem = CapResiduals(predictor, [window(walk(2), (1, 2), start())], spread=StartSpread(), noise=2e-3)
    rng = np.random.default_rng(1)
    z = problem.z0 + 0.05 * rng.normal(size=(4, len(problem.z0))) * np.minimum(problem.prior_sd, 1.0)
    found = problem.residuals(z)
    for point, residual in zip(z, found, strict=True):
        np.testing.assert_allclose(residual, problem.evaluate(point, jacobian=False).residual, atol=1e-8)
    wild = z.copy()
    wild[1, len(problem.names) :] = np.nan
    spoiled = problem.residuals(wild)
    assert not np.isfinite(spoiled[1]).any()
    np.testing.assert_array_equal(spoiled[[0, 2, 3]], found[[0, 2, 3]])
