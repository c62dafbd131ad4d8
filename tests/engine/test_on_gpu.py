"""The engine in plain torch on a GPU gives what it gives on the processor. Skipped where torch sees no GPU."""

from __future__ import annotations

import warnings

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure, closed_loop, pack_state, unpack_state
from r2s2r_cli.engine.flat import parameter_slots
from r2s2r_cli.engine.native import NativeFallbackWarning, eager
from r2s2r_cli.engine.rollout import Simulator
from tests.support.engine import random_gait, threebar_engine
from tests.support.robots import rested, subject

GPU = "cuda"
pytestmark = [
    pytest.mark.skipif(not torch.cuda.is_available(), reason="torch sees no GPU here"),
    pytest.mark.filterwarnings("ignore::r2s2r_cli.engine.native.NativeFallbackWarning"),
]
ROBOTS, HOLD, EVERY = 3, 40, 20
Case = tuple[Simulator, Parameters, State, Tensor]


def case(device: str) -> Case:
    """Simulator in plain torch, numbers, start and commands of three robots that differ in friction."""
    structure, theta, rest = threebar_engine()
    friction = torch.linspace(0.3, 0.9, ROBOTS, dtype=torch.float64).reshape(-1, *[1] * (theta.friction.ndim - 1))
    numbers = theta.map(lambda x: x.expand(ROBOTS, *x.shape[1:]).clone())
    numbers.friction[:] = friction
    gait = random_gait(3, 6, batch=ROBOTS, seed=3)
    return (
        Simulator(structure, native=False),
        numbers.map(lambda x: x.to(device)),
        moved(structure, rest, device),
        gait.to(device),
    )


def moved(structure: Structure, state: State, device: str) -> State:
    """The same state there."""
    return unpack_state(structure, pack_state(structure, state).to(device))


def test_a_rollout_on_the_gpu_is_that_of_the_processor() -> None:
    """120 steps with contact, three robots: states within 1e-9, on the device that was asked for."""
    there, here = (
        sim.rollout(theta, start, u, hold=HOLD, every=EVERY).end_caps()
        for sim, theta, start, u in map(case, (GPU, "cpu"))
    )
    assert there.device.type == GPU
    assert float((there.cpu() - here).abs().max()) < 1e-9
    assert float((here[:, -1] - here[:, 0]).abs().max()) > 1e-3  # something moved


def test_derivatives_on_the_gpu_are_those_of_the_processor() -> None:
    """Backward, of the last caps by every parameter, and forward, along two directions: within 1e-6 of their size."""

    def both(device: str) -> tuple[Tensor, Tensor]:
        sim, theta, start, u = case(device)
        fields = [x.requires_grad_() for x in (theta.friction, theta.stiffness, theta.mass)]
        sim.rollout(theta, start, u, hold=HOLD, every=3 * HOLD).end_caps()[:, -1].square().sum().backward()
        slots = parameter_slots(sim.structure)
        along = torch.zeros(
            max(slot.start + slot.size for slot in slots.values()), 2, dtype=torch.float64, device=device
        )
        for k, name in enumerate(("friction", "speed_in")):
            along[slots[name].start : slots[name].start + slots[name].size, k] = 1.0
        theta = theta.map(lambda x: x.detach())
        _, forward = sim.jvp(theta, start, u, d_parameters=along, hold=HOLD, every=3 * HOLD)
        return torch.cat([field.grad.flatten() for field in fields if field.grad is not None]).cpu(), forward.cpu()

    for there, here in zip(both(GPU), both("cpu"), strict=True):
        assert float(here.abs().max()) > 0
        assert float((there - here).abs().max()) < 1e-6 * float(here.abs().max())


def test_the_closed_loop_on_the_gpu_reaches_its_targets_at_the_same_ticks() -> None:
    """Controller and robot there: as many ticks for a shape, the same caps at its end."""
    targets = torch.tensor([[0.7, 1.0, 0.8, 1.0, 1.0, 0.9]], dtype=torch.float64)
    holds, timeouts = torch.zeros(1, dtype=torch.float64), torch.ones(1, dtype=torch.float64)

    def ran(device: str) -> tuple[Tensor, Tensor]:
        robot = subject()
        theta = robot.theta.map(lambda x: x.to(device))
        run = closed_loop(
            Simulator(robot.structure, native=False), theta, moved(robot.structure, rested().state, device),
            robot.pid(), targets.to(device), holds.to(device), timeouts.to(device),
        )  # fmt: skip
        return run.ticks.cpu(), run.trajectory.end_caps()[:, -1].cpu()

    (there, caps_there), (here, caps_here) = ran(GPU), ran("cpu")
    assert there.tolist() == here.tolist()
    assert float((caps_there - caps_here).abs().max()) < 1e-9


def test_tensors_on_the_gpu_are_said_to_run_in_plain_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulator that may compile says once why it does not, and gives the same."""
    sim, theta, start, u = case(GPU)
    plain = sim.rollout(theta, start, u[:, :1], hold=4, every=4).end_caps()
    monkeypatch.setattr(eager, "_warned", False)
    compiling = Simulator(sim.structure)
    with pytest.warns(NativeFallbackWarning, match="cuda"):
        caps = compiling.rollout(theta, start, u[:, :1], hold=4, every=4).end_caps()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compiling.rollout(theta, start, u[:, :1], hold=4, every=4)
    assert torch.equal(caps, plain)
