"""The example of the engine as a library does what its guide says."""

from __future__ import annotations

import pytest
import torch

from tests.examples.load import load

example = load("05_engine_library", "run")


@pytest.fixture(scope="module")
def bench() -> object:
    """The robot of the example, settled once."""
    return example.bench()


@pytest.mark.slow
def test_the_gradient_is_the_derivative(bench: object) -> None:
    """Reverse mode through contacts and cables agrees with central differences of the batch."""
    for slope, secant in zip(example.gradient(bench), example.secants(bench), strict=True):
        assert float(slope) == pytest.approx(float(secant), rel=1e-4)
        assert abs(float(slope)) > 1e-3


@pytest.mark.slow
def test_a_law_of_ones_own_is_off_at_zero_and_slows_beyond(bench: object) -> None:
    """With drag 0 the motion is the nominal one; with drag rods are slower at every moment of the first reel-in."""
    b = example.bench()
    nominal = b.simulator.rollout(b.theta, b.start, example.gait(), step=1e-3, hold=200, every=20)
    runs = []
    for c in (0.0, 5.0):
        simulator, theta = example.with_drag(b, c)
        runs.append(simulator.rollout(theta, b.start, example.gait(), step=1e-3, hold=200, every=20))
    torch.testing.assert_close(runs[0].states.p_WB, nominal.states.p_WB, rtol=0, atol=1e-9)
    kinetic = [(run.states.v_WB**2).sum((-1, -2))[0].mean() for run in runs]
    assert kinetic[1] < kinetic[0]
