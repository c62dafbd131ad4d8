"""Machine code and torch are one engine: every variant of the model, every phase of motion, one step and its whole
Jacobian (`tests/support/parity.py` has the norms, `phases.py` the states, `variants.py` the models)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    LatchedPid,
    Parameters,
    Simulator,
    State,
    Structure,
    closed_loop,
    read,
    tilted,
    unpack_state,
)
from tests.support import parity
from tests.support.engine import after, free_rods, lowest_gap, parameters, random_gait, state, vector
from tests.support.phases import STEP, phases
from tests.support.soak import drawn
from tests.support.variants import SMALL, VARIANTS, Variant, robot, variant

EXACT = 1e-10
"""Relative, per step. Measured: values 2e-13, derivatives 1e-12."""
BLOCK = 1e-6
"""Of each block by itself, 1e-4 of its field's largest derivative counting as nothing."""
SINGLE = 2e-4
"""float32 has 6e-8, and the velocity of a resting robot is what is left of impulses a thousand times larger."""
FAST = ("one crooked rod", "pair, no rod contact", "free rods")
LARGE = drawn(("threebar", "crooked rods", "all effects on"), tuple(VARIANTS))
"""A whole robot compiles for a quarter of a minute and more; every law of the others is in a small one as well."""
EVERY = [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in (*SMALL, *LARGE)]


@dataclass
class Case:
    """One variant with its kernels, and states in all phases."""

    variant: Variant
    simulator: Simulator

    @cached_property
    def made(self) -> tuple[dict[str, slice], State]:
        """Where each phase is, and the states."""
        return phases(self.variant, self.simulator, 6)

    @cached_property
    def problem(self) -> parity.Problem:
        """The states with random commands, as vectors."""
        return parity.problem(self.variant, self.made[1])

    @cached_property
    def reference(self) -> Tensor:
        """The Jacobian in torch."""
        return parity.torch_jacobian(self.simulator.kernels, self.problem, STEP)

    def require_jacobian(self, found: Tensor) -> None:
        """Asserts that a Jacobian is that of torch."""
        assert float(parity.jacobian_error(self.problem, found, self.reference).max()) < EXACT
        assert float(parity.jacobian_error(self.problem, found, self.reference, floor=1e-4).max()) < BLOCK


@pytest.fixture(scope="session")
def cache_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Machine code of this test session."""
    return tmp_path_factory.mktemp("kernels")


@pytest.fixture(scope="module", params=EVERY)
def case(request: pytest.FixtureRequest, cache_dir: Path) -> Iterator[Case]:
    """Every variant; all tests of one before the next."""
    model = variant(request.param)
    yield Case(model, Simulator(model.structure, cache_dir=cache_dir))


def test_the_phases_are_what_they_say(case: Case) -> None:
    """Nothing touches in flight; in most states of the other phases the ground pushes, sliding caps slide, and some of
    the rods that come near touch and are moved by it: the comparisons below see every branch of the step."""
    (where, states), model = case.made, case.variant
    pushed = read(model.structure, model.theta, states).ground[..., 2].amax(1)
    assert float(pushed[where["flight"]].max()) == 0.0
    for name in ("impact", "sliding", "rest"):
        assert int((pushed[where[name]] > 0.0).sum()) >= 4, name
    moved = unpack_state(model.structure, parity.torch_step(case.simulator.kernels, case.problem, STEP))
    assert float(moved.v_WB[where["sliding"], :, :2].norm(dim=-1).amax(1).min()) > 0.01
    if model.structure.rod_pairs:
        ghosts = Simulator(replace(model.structure, rod_contact=False), native=False)
        through = ghosts.rollout(model.theta, states, case.problem.u[:, None], step=STEP, substeps=1).at(-1)
        change = (moved.v_WB - through.v_WB).abs().amax((1, 2))
        for name in ("touching", "touching, on the ground"):
            assert int((change[where[name]] > 1e-3).sum()) >= 2, name


def test_values(case: Case) -> None:
    """One step: all fields agree to 1e-10 of their size."""
    kernels, problem = case.simulator.kernels, case.problem
    native, torch_ = parity.native_step(kernels, problem, STEP), parity.torch_step(kernels, problem, STEP)
    assert float(parity.value_error(problem, native, torch_).max()) < EXACT


def test_vjp(case: Case) -> None:
    """The whole Jacobian by the backward kernel is that of torch's autograd."""
    case.require_jacobian(parity.vjp_jacobian(case.simulator.kernels, case.problem, STEP))


def test_jvp(case: Case) -> None:
    """The whole Jacobian by the tangent kernel is that of torch's autograd."""
    case.require_jacobian(parity.jvp_jacobian(case.simulator.kernels, case.problem, STEP))


def test_scalar_and_lanes(case: Case) -> None:
    """One environment alone, which has kernels of its own, takes the same step as in a batch, derivatives included."""
    kernels, problem = case.simulator.kernels, case.problem
    batch = parity.native_step(kernels, problem, STEP)
    seeds = torch.randn(len(batch), 2, batch.shape[1], generator=torch.Generator().manual_seed(2), dtype=batch.dtype)
    p = problem.p.expand(len(batch), -1)
    grads = kernels.vjp(problem.s, problem.u[:, None], p, seeds, h=STEP)
    for i in range(len(batch)):
        one = parity.part(problem, slice(i, i + 1))
        alone = parity.native_step(kernels, one, STEP)
        assert float(parity.value_error(one, alone, batch[i : i + 1]).max()) < 1e-12
        for whole, single in zip(
            grads, kernels.vjp(one.s, one.u[:, None], one.p, seeds[i : i + 1], h=STEP), strict=True
        ):
            assert torch.allclose(single, whole[i : i + 1], rtol=1e-10, atol=1e-10 * float(whole[i].abs().amax(0).max())
                                  if whole[i].numel() else 0.0)  # fmt: skip


def test_single_precision(case: Case) -> None:
    """float32 takes the same branches and stays close."""
    single = parity.problem(case.variant, case.made[1], dtype=torch.float32)
    native = parity.native_step(case.simulator.kernels, single, STEP)
    assert native.dtype == torch.float32
    truth = parity.torch_step(case.simulator.kernels, case.problem, STEP)
    assert float(parity.value_error(case.problem, native, truth).max()) < SINGLE


@pytest.mark.slow
def test_single_precision_derivatives(cache_dir: Path) -> None:
    """float32: the Jacobian of the 3-bar robot is close too, in flight, impact and sliding, and finite everywhere."""
    model = robot()
    case = Case(model, Simulator(model.structure, cache_dir=cache_dir))
    single = parity.problem(model, case.made[1], dtype=torch.float32)
    found = parity.vjp_jacobian(case.simulator.kernels, single, STEP)
    error = parity.jacobian_error(case.problem, found, case.reference)
    where = case.made[0]
    for name in ("flight", "impact", "sliding"):
        assert float(error[where[name]].max()) < 1e-3, name
    assert bool(torch.isfinite(found).all())


def test_the_kink_that_phases_avoid() -> None:
    """A lying rod: from 1 um above the ground the next gap is 0 and forgets the height; from 1 um below, 0.8 of it
    stays. Where a cap's gap is 0 to rounding, both are right, and the two engines may take either."""
    rod = free_rods(rod_contact=False)
    theta = parameters(rod)
    for height, slope in ((1e-6, 0.0), (-1e-6, 0.8)):
        z = torch.tensor(height, dtype=torch.float64, requires_grad=True)
        start = state(rod, (vector(0.0, 0.0, float(theta.cap_radius[0, 0, 0])) + z * vector(0.0, 0.0, 1.0))[None])
        gap = lowest_gap(theta, after(rod, theta, start, 1, STEP))[0]
        (derivative,) = torch.autograd.grad(gap, z)
        assert float(gap.detach()) == pytest.approx(slope * height, abs=1e-12)
        assert float(derivative) == pytest.approx(slope, abs=1e-6)


def _both(structure: Structure, cache_dir: Path) -> tuple[Simulator, Simulator]:
    return Simulator(structure, cache_dir=cache_dir), Simulator(structure, native=False)


def test_rollouts_on_tilted_ground(cache_dir: Path) -> None:
    """`Simulator.rollout` with a tilted ground: 60 ms of a gait agree in value and gradient, in the world's frame."""
    model = variant("pair, no rod contact")
    gait = random_gait(3, 1, batch=1, seed=4)
    ground = tilted(0.1, -0.2, offset=0.05)
    outcomes = []
    for simulator in _both(model.structure, cache_dir):
        theta = _leaves(model.theta)
        run = simulator.rollout(theta, model.start, gait, step=STEP, hold=20, every=20, ground=ground)
        weights = torch.randn(run.states.p_WB.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
        loss = (weights * run.states.p_WB).sum()
        grads = torch.autograd.grad(loss, [theta.mass, theta.stiffness, theta.gravity, theta.rest])
        outcomes.append((run.states.p_WB, run.states.q_WR, run.end_caps(), *grads))
    for one, other in zip(*(map(Tensor.detach, outcome) for outcome in outcomes), strict=True):
        assert float((one - other).abs().max()) < 1e-10 * float(other.abs().max())


@pytest.mark.slow
def test_the_closed_loop(cache_dir: Path) -> None:
    """0.3 s of the controller in the loop: the same commands, states and gradient, decisions included."""
    model = variant("pair, no rod contact")
    pid = LatchedPid(p=6.0, i=0.01, d=0.5, tolerance=0.07, min_length=0.1, range=0.1, period=0.01,
                     cable_caps=((1, 3), (0, 2), (1, 2)), actuated=(1,))  # fmt: skip
    targets = torch.tensor([[0.7], [1.0]], dtype=torch.float64)
    outcomes = []
    for simulator in _both(model.structure, cache_dir):
        theta = _leaves(model.theta)
        run = closed_loop(simulator, theta, model.start, pid, targets, torch.zeros(2), torch.full((2,), 0.15))
        end = run.trajectory.states.p_WB[:, -1]
        grads = torch.autograd.grad((end * torch.arange(6.0).reshape(2, 3)).sum(), [theta.mass, theta.speed_in])
        outcomes.append((run.u, run.index, run.done, run.length, end, *grads))
    assert float(outcomes[0][0].detach().abs().max()) > 0.1
    for one, other in zip(*(map(Tensor.detach, outcome) for outcome in outcomes), strict=True):
        assert one.shape == other.shape
        assert float((one.double() - other.double()).abs().max()) <= 1e-9 * float(other.double().abs().max())


def _leaves(theta: Parameters) -> Parameters:
    return theta.map(lambda x: x.detach().clone().requires_grad_())
