"""Local numbers of states: there and back, and means of rotations."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from r2s2r_cli.engine.flat import pack_state, unpack_state
from r2s2r_cli.stages.identify.members import deviations, mean, placed, places
from tests.support.robots import rested, subject

STRUCTURE = subject().structure
SIZE = max(one.stop for one in places(STRUCTURE).values())


def start() -> torch.Tensor:
    """The robot at rest, flat, (NS,)."""
    return pack_state(STRUCTURE, rested().state)[0]


def test_there_and_back() -> None:
    """States that differ by given numbers differ by these numbers, for turns up to 2 rad."""
    given = np.random.default_rng(0).uniform(-1.1, 1.1, (9, SIZE))
    flat = placed(STRUCTURE, start(), given)
    assert deviations(STRUCTURE, start(), flat) == pytest.approx(given, abs=1e-12)
    assert torch.linalg.vector_norm(unpack_state(STRUCTURE, flat).q_WR, dim=-1).numpy() == pytest.approx(1, abs=1e-14)


def test_the_sign_of_a_quaternion_says_nothing() -> None:
    """q and -q are one orientation."""
    flat = start()[None].clone()
    begin = places(STRUCTURE)["q_WR"].start
    flat[:, begin : begin + 4 * STRUCTURE.n_rods] *= -1
    assert deviations(STRUCTURE, start(), flat) == pytest.approx(np.zeros((1, SIZE)), abs=1e-7)


def test_the_mean_of_opposite_states_is_the_middle() -> None:
    """Turns by +d and -d about any axis cancel, however members are ordered; deviations sum to 0."""
    half = np.random.default_rng(1).normal(scale=0.3, size=(6, SIZE))
    reference, deviation = mean(STRUCTURE, placed(STRUCTURE, start(), np.concatenate([half, -half])))
    assert reference.numpy() == pytest.approx(start().numpy(), abs=1e-6)
    assert deviation == pytest.approx(np.concatenate([half, -half]), abs=1e-6)
    assert deviation.sum(axis=0) == pytest.approx(np.zeros(SIZE), abs=1e-12)


def test_places_cover_the_numbers() -> None:
    """One after the other, with 3 numbers a rod for the orientation and the winches' at the end."""
    found = places(STRUCTURE)
    assert [one.start for one in found.values()] == [0, *(one.stop for one in list(found.values())[:-1])]
    assert found["q_WR"] == slice(9, 18) and found["rest"].stop - found["rest"].start == 6
