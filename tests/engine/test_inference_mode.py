"""Rollouts in `torch.inference_mode`, as code that learns or plays policies runs them."""

from __future__ import annotations

import pytest
import torch

from r2s2r_cli.engine import EngineInputError, Simulator
from tests.support.engine import free_rods, lying, parameters

STILL = torch.zeros(1, 2, 0, dtype=torch.float64)


@pytest.mark.parametrize("native", [None, False], ids=["native", "torch"])
def test_it_changes_nothing(native: bool | None) -> None:
    """The step is traced there as elsewhere, and tensors that are made there are taken there and outside."""
    structure = free_rods()
    theta, start = parameters(structure), lying(structure)
    outside = Simulator(structure, native=native).rollout(theta, start, STILL, hold=3).states.p_WB
    simulator = Simulator(structure, native=native)
    with torch.inference_mode():
        inside = simulator.rollout(theta, start, STILL, hold=3).states.p_WB
        made = theta.map(torch.Tensor.clone)
        assert torch.allclose(simulator.rollout(made, start, STILL, hold=3).states.p_WB, outside, rtol=0, atol=1e-12)
    assert torch.allclose(inside, outside, rtol=0, atol=1e-12)
    assert torch.allclose(simulator.rollout(made, start, STILL, hold=3).states.p_WB, outside, rtol=0, atol=1e-12)


def test_what_is_written_there_is_looked_at_again() -> None:
    """Torch does not count writes into such tensors: a number that goes wrong between two rollouts is seen all the
    same."""
    structure = free_rods()
    simulator, start = Simulator(structure, native=False), lying(structure)
    with torch.inference_mode():
        theta = parameters(structure).map(torch.Tensor.clone)
        simulator.rollout(theta, start, STILL)
        theta.friction.fill_(-1.0)
        with pytest.raises(EngineInputError) as error:
            simulator.rollout(theta, start, STILL)
    assert error.value.field == "friction.0.0"
