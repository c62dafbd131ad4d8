"""Least squares with unknowns that may not be negative: its conditions, scipy's answers, the bits of a row."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import nnls as scipy_nnls
from torch import Tensor

from r2s2r_cli.engine import balance, pose_state
from r2s2r_cli.engine.nnls import nnls
from tests.support.engine import vector
from tests.support.robots import frames, noise, subject

SHRINK = 1e-3
KINDS = ("random", "reachable", "twins", "absent", "unloaded")
SIZES = ((18, 24, 12), (18, 21, 10), (36, 60, 24), (6, 30, 0), (12, 5, 5))
"""Equations, unknowns, how many of these are free: threebar robot, an odd one, six bars, few equations, all free."""


def problem(kind: str, size: tuple[int, int, int], *, batch: int = 24) -> tuple[Tensor, Tensor, Tensor]:
    """matrix, load, free. reachable: small integers and a load that some unknowns, many of them 0, bear to the last
    bit; twins: every column twice; absent: a third of them 0; unloaded: nothing to bear in every other row."""
    draw = torch.Generator().manual_seed(sum(size))
    m, n, frees = size
    matrix = torch.randn(batch, m, n, generator=draw, dtype=torch.float64)
    load = 10.0 * torch.randn(batch, m, generator=draw, dtype=torch.float64)
    free = torch.randperm(n, generator=draw) < frees
    if kind == "reachable":
        matrix = matrix.round()
        truth = torch.randn(batch, n, generator=draw, dtype=torch.float64).round()
        load = -(matrix @ torch.where(free, truth, torch.relu(truth))[..., None])[..., 0]
    elif kind == "twins":
        matrix[..., 1::2] = matrix[..., : 2 * (n // 2) : 2]
    elif kind == "absent":
        matrix[..., ::3] = 0.0
    elif kind == "unloaded":
        load[::2] = 0.0
    return matrix, load, free


def violation(matrix: Tensor, load: Tensor, x: Tensor, free: Tensor, shrink: float = SHRINK) -> Tensor:
    """Of the conditions of a minimum (Karush, Kuhn, Tucker), (B,): the gradient is 0 where x is free or above 0, and
    not below 0 elsewhere. In units of the largest force that pulls."""
    pull = (matrix.mT @ load[..., None])[..., 0]
    gradient = pull + (matrix.mT @ (matrix @ x[..., None]))[..., 0] + shrink * x
    wrong = torch.where(free, gradient.abs(), torch.minimum(x, gradient).abs())
    return wrong.amax(dim=-1) / pull.abs().amax().clamp(min=1e-300)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_meets_the_conditions_of_a_minimum(kind: str, size: tuple[int, int, int]) -> None:
    """To rounding in float64 and in float32, degenerate or not; nothing that may not be negative is."""
    matrix, load, free = problem(kind, size)
    x = nnls(matrix, load, free=free, shrink=SHRINK)
    assert float(violation(matrix, load, x, free).max()) < 1e-12
    assert not (x[:, ~free] < 0).any()
    single = nnls(matrix.float(), load.float(), free=free, shrink=SHRINK)
    assert float(violation(matrix, load, single.double(), free).max()) < 1e-4


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("kind", KINDS)
def test_finds_what_scipy_finds(kind: str, size: tuple[int, int, int]) -> None:
    """scipy knows no free unknowns: they are two, one of each sign, of which it shrinks the difference."""
    matrix, load, free = problem(kind, size, batch=4)
    x = nnls(matrix, load, free=free, shrink=SHRINK).numpy()
    n = matrix.shape[-1]
    pairs = np.concatenate([np.eye(n), -np.eye(n)[:, free.numpy()]], axis=1)
    for row in range(len(matrix)):
        tall = np.concatenate([matrix[row].numpy(), np.sqrt(SHRINK) * np.eye(n)]) @ pairs
        other, _ = scipy_nnls(tall, np.concatenate([-load[row].numpy(), np.zeros(n)]), maxiter=1000)
        assert np.allclose(pairs @ other, x[row], rtol=0, atol=1e-9 * max(1.0, np.abs(x[row]).max()))


def test_two_ropes_hold_a_weight_and_a_third_would_push() -> None:
    """Two equal ropes at 60 degrees bear 2 N with 2 / sqrt(3) N each; the one that points down pulls at nothing."""
    sine, cosine = 0.75**0.5, 0.5
    matrix = torch.tensor([[[cosine, -cosine, 0.0], [sine, sine, -1.0]]], dtype=torch.float64)
    x = nnls(matrix, vector(0.0, -2.0)[None], free=torch.zeros(3, dtype=torch.bool), shrink=1e-12)
    torch.testing.assert_close(x[0], vector(2 / 3**0.5, 2 / 3**0.5, 0.0), rtol=1e-9, atol=0)


@pytest.mark.parametrize("size", SIZES)
def test_a_row_has_the_same_bits_in_any_batch(size: tuple[int, int, int]) -> None:
    """Alone, in the middle of three, and among all: what is resumed or split up is what it was."""
    matrix, load, free = problem("random", size)
    x = nnls(matrix, load, free=free, shrink=SHRINK)
    for k in range(1, len(matrix) - 1, 5):
        alone, three = slice(k, k + 1), slice(k - 1, k + 2)
        assert torch.equal(nnls(matrix[alone], load[alone], free=free, shrink=SHRINK)[0], x[k])
        assert torch.equal(nnls(matrix[three], load[three], free=free, shrink=SHRINK)[1], x[k])


def test_a_pose_balances_with_the_same_bits_in_any_batch() -> None:
    """Tensions, ground forces and what is left over of seven noisy poses, alone and together."""
    robot = subject()
    p_WE = noise(robot.p_WE, 0.004, batch=7, seed=3)
    states = pose_state(robot.structure, robot.theta, p_WE, frames(p_WE), rest=p_WE.new_zeros(7, len(robot.winched)))
    together = balance(robot.structure, robot.theta, states)
    for k in range(7):
        alone = balance(robot.structure, robot.theta, states.select(k))
        for name in ("tension", "ground", "unbalanced"):
            assert torch.equal(getattr(alone, name)[0], getattr(together, name)[k])


def test_nan_stays_in_its_row() -> None:
    """One row with NaN gives NaN, and the others what they give without it."""
    matrix, load, free = problem("random", SIZES[0], batch=3)
    x = nnls(matrix, load, free=free, shrink=SHRINK)
    load[1] = torch.nan
    spoilt = nnls(matrix, load, free=free, shrink=SHRINK)
    assert spoilt[1].isnan().any()
    assert torch.equal(spoilt[[0, 2]], x[[0, 2]])
