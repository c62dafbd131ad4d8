"""What one step's rounding becomes over a gait, and derivatives of gaits three ways (examples/07_accuracy)."""

from __future__ import annotations

import pytest
import torch

from tests.examples.load import load

accuracy = load("07_accuracy", "accuracy")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> object:
    """Eight gaits of 10 s: closed-loop runs of random shapes, whose commands are replayed."""
    return accuracy.bench(cache_dir=tmp_path_factory.mktemp("kernels"))


def test_growth_of_rounding(bench: object) -> None:
    """Machine code and torch stay together: caps within 1e-12 m after 0.1 s and 1e-8 m after 1 s of every gait."""
    _, apart = accuracy.growth(bench, 1.0, 0.1)
    assert bool(torch.isfinite(apart).all())
    assert float(apart[:, 1].max()) < 1e-12
    assert float(apart[:, -1].max()) < 1e-8


def test_one_step_along_the_gaits(bench: object) -> None:
    """States every 0.1 s of the gaits: value, VJP and JVP of a step within 1e-10 of torch."""
    for name, error in accuracy.one_step(bench):
        assert len(error) == 8 * 100
        assert float(error.max()) < 1e-10, name


def test_derivatives_stay_bounded(bench: object) -> None:
    """Positions over 10 s of the controller's gaits: by the logarithm of a parameter below 1 m in the median and 50 m
    in the worst, by the positions at the start below 10 and 1000."""
    found = accuracy.derivatives(bench)
    by_parameter, by_start = (x.abs().amax((2, 3)) for x in (found.by_parameter, found.by_start))
    assert bool(torch.isfinite(by_parameter).all() and torch.isfinite(by_start).all())
    assert float(by_parameter[:, -1].median()) < 1.0
    assert float(by_parameter.max()) < 50.0
    assert float(by_start[:, -1].median()) < 10.0
    assert float(by_start.max()) < 1000.0


def test_forward_is_reverse(bench: object) -> None:
    """Over 1 s the tangent and the backward kernel give the same Jacobian, to 1e-10 of its largest entry."""
    forward = accuracy.derivatives(bench, (1.0,)).by_parameter[:, 0]
    backward = accuracy.backward_derivatives(bench, 1.0)
    size = forward.abs().amax((1, 2))
    assert float(((forward - backward).abs().amax((1, 2)) / size).max()) < 1e-10


@pytest.mark.parametrize("seconds", [1.0, 2.0])
def test_forward_is_the_difference_quotient(bench: object, seconds: float) -> None:
    """Over 1 and 2 s the Jacobian is that of central differences: to 1e-6 of its largest entry in the median of the
    gaits, to 1e-4 in every one. The smaller error of two widths: a difference that straddles a switch of contact is off
    by the jump over its width, and one a hundred times narrower is not."""
    forward = accuracy.derivatives(bench, (seconds,)).by_parameter[:, 0]
    size = forward.abs().amax((1, 2))
    errors = [(forward - accuracy.secants(bench, seconds, h)).abs().amax((1, 2)) / size for h in (1e-6, 1e-8)]
    error = torch.minimum(*errors)
    assert float(error.median()) < 1e-6
    assert float(error.max()) < 1e-4
