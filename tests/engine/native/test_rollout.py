"""Rollouts of a toy step (a damped chain of pendulums with selections) in kernels, against the same in plain torch."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

import r2s2r_cli.engine.native.run_backward as backward_module
import r2s2r_cli.engine.native.step as step_module
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.native import NativeStep, eager, machine, rollout

N = 4
"""Pendulums; the state is their angles and speeds, the parameters their stiffness, damping and length, and a limit."""
PLAN: dict[str, Any] = {"h": 0.02, "hold": 10, "every": 5}
ROWS = 5


def chain(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
    """One step of the chain: springs to the neighbours that only pull, friction with a limit, motors."""
    angle, speed = s[:, :N], s[:, N:]
    stiffness, damping, length = p[:, :N], p[:, N : 2 * N], p[:, 2 * N : 3 * N]
    gap = angle[:, 1:] - angle[:, :-1]
    pull = torch.where(gap.abs() > 0.1, stiffness[:, 1:] * gap, torch.zeros_like(gap))
    wall = torch.relu(-angle - 0.5) * stiffness
    force = torch.nn.functional.pad(pull, (0, 1)) - torch.nn.functional.pad(pull, (1, 0)) + wall
    slip = damping * speed / torch.sqrt(speed * speed + 1e-3)
    force = force - torch.minimum(slip, p[:, -1:]) - 9.81 / length * torch.sin(angle)
    force = force + torch.nn.functional.pad(u, (0, N - u.shape[1])) * torch.linalg.vector_norm(
        length, dim=1, keepdim=True
    )
    after = speed + h * force / (1.0 + h * damping * length)
    return torch.cat([angle + h * after, after], dim=1)


def setting(batch: int, dtype: torch.dtype = torch.float64, seed: int = 0) -> tuple[NativeStep, Tensor, Tensor, Tensor]:
    """The toy's kernels, and random state, inputs and parameters."""
    random = torch.Generator().manual_seed(seed)
    s = torch.randn(batch, 2 * N, generator=random, dtype=torch.float64)
    u = torch.randn(batch, ROWS, 2, generator=random, dtype=torch.float64)
    p = 0.3 + torch.rand(batch, 3 * N + 1, generator=random, dtype=torch.float64)
    return NativeStep(chain, 2 * N, 2, 3 * N + 1, key="chain"), s.to(dtype), u.to(dtype), p.to(dtype)


def close(a: Tensor, b: Tensor, tolerance: float) -> None:
    """Equal, relative to the largest entry."""
    assert a.shape == b.shape
    assert (a - b).abs().max() <= tolerance * b.abs().max()


TOLERANCE = {torch.float64: 1e-12, torch.float32: 3e-4}


@pytest.mark.parametrize("dtype", TOLERANCE)
@pytest.mark.parametrize("batch", [1, 3, 21])
def test_forward_vjp_and_jvp_are_torchs(batch: int, dtype: torch.dtype) -> None:
    """50 steps of one environment and of lanes with a tail, both types: frames and derivatives by all inputs."""
    step, s, u, p = setting(batch, dtype)
    frames = step.forward(s, u, p, **PLAN)
    close(frames, step.torch_rollout(s, u, p, **PLAN), TOLERANCE[dtype])
    adjoint = torch.randn(frames.shape, dtype=dtype)
    for ours, theirs in zip(
        step.vjp(s, u, p, adjoint, **PLAN), eager.vjp(chain, s, u, p, adjoint, **PLAN), strict=True
    ):
        close(ours, theirs, TOLERANCE[dtype])
    ds, du, dp = (torch.randn(*x.shape, 2, dtype=dtype) for x in (s, u, p))
    values, d_frames = step.jvp(s, u, p, ds0=ds, du=du, dp=dp, **PLAN)
    close(d_frames, eager.jvp(chain, s, u, p, (ds, du, dp), None, **PLAN)[1], TOLERANCE[dtype])
    assert torch.equal(values, frames)


def test_a_lane_is_bit_for_bit_the_scalar_kernel() -> None:
    """An environment moves the same alone, in a batch, and under its tangents; and so do its adjoints."""
    step, s, u, p = setting(11)
    frames = step.forward(s, u, p, **PLAN)
    adjoint = torch.ones_like(frames)
    alone = [step.forward(s[[k]], u[[k]], p[[k]], **PLAN) for k in range(11)]
    assert torch.equal(torch.cat(alone), frames)
    together = step.vjp(s, u, p, adjoint, **PLAN)[0]
    assert torch.equal(step.vjp(s[[7]], u[[7]], p[[7]], adjoint[[7]], **PLAN)[0], together[[7]])


def test_threads_change_nothing() -> None:
    """Blocks of lanes and passes of directions in three threads give the same bits as one after the other."""
    step, s, u, p = setting(45)
    adjoint = torch.ones(45, 11, 2 * N, dtype=torch.float64)
    dp = torch.randn(45, 3 * N + 1, 40, dtype=torch.float64)
    for call in (
        lambda n: [step.forward(s, u, p, **PLAN, threads=n)],
        lambda n: step.vjp(s, u, p, adjoint, **PLAN, threads=n),
        lambda n: step.jvp(s, u, p, dp=dp, **PLAN, threads=n),
    ):
        assert all(torch.equal(a, b) for a, b in zip(call(1), call(3), strict=True))


@pytest.mark.parametrize(("hold", "every"), [(1, 1), (1, 3), (7, 1), (7, 4), (3, 100)])
def test_frames_and_rows_are_counted_as_in_torch(hold: int, every: int) -> None:
    """Frame 0 is the start, frame k the state after k * every steps; row t // hold of u drives step t."""
    step, s, u, p = setting(2)
    plan = {"h": 0.02, "hold": hold, "every": every}
    frames = step.forward(s, u, p, **plan)
    assert frames.shape == (2, ROWS * hold // every + 1, 2 * N)
    assert torch.equal(frames[:, 0], s)
    close(frames, step.torch_rollout(s, u, p, **plan), 1e-12)
    adjoint = torch.randn(frames.shape, dtype=torch.float64)
    for ours, theirs in zip(
        step.vjp(s, u, p, adjoint, **plan), eager.vjp(chain, s, u, p, adjoint, **plan), strict=True
    ):
        close(ours, theirs, 1e-12)


def test_no_rows_is_no_step() -> None:
    """Without inputs the only frame is the start, and derivatives pass through."""
    step, s, u, p = setting(3)
    frames = step.forward(s, u[:, :0], p, **PLAN)
    assert torch.equal(frames, s[:, None])
    adjoint = torch.ones_like(frames)
    assert torch.equal(step.vjp(s, u[:, :0], p, adjoint, **PLAN)[0], adjoint[:, 0])
    ds = torch.randn(3, 2 * N, 2, dtype=torch.float64)
    assert torch.equal(step.jvp(s, u[:, :0], p, ds0=ds, **PLAN)[1], ds[:, None])


def test_checkpoints_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adjoints of a rollout that is stored at checkpoints are, bit for bit, those of one that is stored whole."""
    step, s, u, p = setting(3)
    adjoint = torch.randn(3, 11, 2 * N, dtype=torch.float64)
    whole = step.vjp(s, u, p, adjoint, **PLAN)
    monkeypatch.setattr(backward_module, "STATES", 0)
    for chunk in (1, 7, 25, 49, 50, 64):
        monkeypatch.setattr(backward_module, "CHUNK", chunk)
        parts = step.vjp(s, u, p, adjoint, **PLAN)
        close(parts[0], whole[0], 1e-14)
        # Sums over the rollout are added up in another order.
        close(parts[1], whole[1], 1e-14)
        close(parts[2], whole[2], 1e-14)


def test_recorded_states_save_the_second_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adjoints from recorded states are those of a rollout run again; too many states are not recorded."""
    step, s, u, p = setting(10)
    adjoint = torch.randn(10, 11, 2 * N, dtype=torch.float64)
    frames, states = step.recorded(s, u, p, **PLAN)
    assert torch.equal(frames, step.forward(s, u, p, **PLAN))
    again, ours = (step.vjp(s, u, p, adjoint, **PLAN, states=x) for x in (None, states))
    assert all(torch.equal(a, b) for a, b in zip(again, ours, strict=True))
    monkeypatch.setattr(step_module, "RECORD", 1000)
    frames, states = step.recorded(s, u, p, **PLAN)
    assert states is None
    assert torch.equal(frames, step.forward(s, u, p, **PLAN))


def test_inputs_are_left_alone() -> None:
    """No kernel writes into what it is given, a single environment's contiguous tensors included."""
    for batch in (1, 3):
        step, s, u, p = setting(batch)
        before = [x.clone() for x in (s, u, p)]
        adjoint = torch.ones(batch, 11, 2 * N, dtype=torch.float64)
        ds = torch.ones(batch, 2 * N, machine.vector_bytes() // 8, dtype=torch.float64)
        step.forward(s, u, p, **PLAN)
        step.vjp(s, u, p, adjoint, **PLAN)
        step.jvp(s, u, p, ds0=ds, **PLAN)
        assert all(torch.equal(a, b) for a, b in zip((s, u, p), before, strict=True))
        assert bool((adjoint == 1).all())
        assert bool((ds == 1).all())


def test_shared_inputs_are_repeated_and_their_adjoints_summed() -> None:
    """Inputs and parameters of batch 1 serve every environment; their adjoints have their own shape."""
    step, s, u, p = setting(5)
    u, p = u[:1], p[:1]
    frames = step.forward(s, u, p, **PLAN)
    close(frames, step.torch_rollout(s, u, p, **PLAN), 1e-12)
    adjoint = torch.randn(frames.shape, dtype=torch.float64)
    _, g_u, g_p = step.vjp(s, u, p, adjoint, **PLAN)
    _, wanted_u, wanted_p = eager.vjp(chain, s, u.expand(5, -1, -1), p.expand(5, -1), adjoint, **PLAN)
    close(g_u, wanted_u.sum(0, keepdim=True), 1e-12)
    close(g_p, wanted_p.sum(0, keepdim=True), 1e-12)


@pytest.mark.parametrize("directions", [1, 9, 37])  # one pass, one of wider lanes, several
def test_tangents_of_some_inputs_only(directions: int) -> None:
    """Tangents that are not given are zero, parameters that are not active have none; any number of directions."""
    step, s, u, p = setting(2)
    plan = {"h": 0.02, "hold": 2, "every": 5}
    random = {"ds0": s, "du": u, "dp": p}
    given = {name: torch.randn(*x.shape, directions, dtype=torch.float64) for name, x in random.items()}
    for names, active in ((("ds0",), None), (("du",), None), (("dp",), (1, 12)), (("ds0", "dp"), (0,))):
        some = [0, -1]
        tangents = [given[name][..., some] * (name in names) for name in random]
        ours = step.jvp(s, u, p, **{name: given[name] for name in names}, active=active, **plan)[1]
        theirs = eager.jvp(chain, s, u, p, (tangents[0], tangents[1], tangents[2]), active, **plan)[1]
        close(ours[..., some], theirs, 1e-12)


def test_gradcheck() -> None:
    """The autograd function is right by central differences, in reverse and in forward mode."""
    step, s, u, p = setting(2, seed=3)
    inputs = [x.requires_grad_() for x in (s, u[:, :2], p)]
    assert torch.autograd.gradcheck(
        lambda s, u, p: rollout(step, s, u, p, h=0.02, hold=2, every=2),
        inputs,
        check_forward_ad=True,
        eps=1e-6,
        atol=1e-6,
    )


def test_autograd_gives_gradients_to_what_asks_for_them() -> None:
    """Through the autograd function a loss has the gradients of the torch rollout; inputs without gradient get none."""
    step, s, u, p = setting(3)
    p.requires_grad_()
    rollout(step, s, u, p, **PLAN).square().sum().backward()
    ours, p.grad = p.grad, None
    step.torch_rollout(s, u, p, **PLAN).square().sum().backward()
    assert ours is not None and p.grad is not None
    close(ours, p.grad, 1e-12)
    assert s.grad is None


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"s": (2, 2 * N + 1)}, "s0"), ({"u": (2, ROWS, 3)}, "u"), ({"u": (3, ROWS, 2)}, "u"), ({"p": (2, 1)}, "p"),
        ({"s": (2 * N,)}, "s0"), ({"hold": 0}, "hold"), ({"every": -1}, "every"), ({"h": 0.0}, "h"),
        ({"h": float("nan")}, "h"),
    ],
)  # fmt: skip
def test_wrong_input_is_named(change: dict[str, Any], field: str) -> None:
    """Shapes and times that cannot be are refused under their name."""
    step, s, u, p = setting(2)
    given = {
        name: torch.zeros(change[name], dtype=s.dtype) if name in change else x
        for name, x in zip("sup", (s, u, p), strict=True)
    }
    plan = {**PLAN, **{name: value for name, value in change.items() if name in PLAN}}
    with pytest.raises(EngineInputError) as info:
        step.forward(*given.values(), **plan)
    assert info.value.field == field


def test_other_types_and_missing_tangents_are_refused() -> None:
    """Half precision, a tangent of a wrong shape, and no tangent at all."""
    step, s, u, p = setting(2)
    with pytest.raises(EngineInputError, match="float16"):
        step.forward(s.half(), u, p, **PLAN)
    with pytest.raises(EngineInputError, match="ds0"):
        step.jvp(s, u, p, ds0=torch.zeros(2, 3, 1, dtype=s.dtype), **PLAN)
    with pytest.raises(EngineInputError, match="no direction"):
        step.jvp(s, u, p, **PLAN)


@pytest.mark.parametrize("shape", [(2, 10, 2 * N), (2, 11, 2), (3, 11, 2 * N)])
def test_adjoints_of_other_frames_are_refused(shape: tuple[int, ...]) -> None:
    """Kernels read adjoints by address: a frame that is not there would be read from whatever lies behind."""
    step, s, u, p = setting(2)
    with pytest.raises(EngineInputError, match="g_frames"):
        step.vjp(s, u, p, torch.ones(shape, dtype=s.dtype), **PLAN)


def test_adjoints_of_one_environment_are_those_of_all() -> None:
    """A batch of 1 is repeated, as everywhere else."""
    step, s, u, p = setting(11)
    shared = torch.randn(1, 11, 2 * N, dtype=torch.float64)
    whole = step.vjp(s, u, p, shared.expand(11, -1, -1), **PLAN)
    assert all(torch.equal(a, b) for a, b in zip(step.vjp(s, u, p, shared, **PLAN), whole, strict=True))


def test_what_autograd_cannot_see_asks_for_no_gradient() -> None:
    """Frames of `forward` and `jvp` are detached: only the first came from s0 by torch, and its gradient alone would
    pass for that of the rollout. `rollout` is what autograd differentiates."""
    step, s, u, p = setting(2)
    s.requires_grad_()
    p.requires_grad_()
    frames, tangents = step.jvp(s, u, p, ds0=torch.ones(*s.shape, 1, dtype=s.dtype), **PLAN)
    assert not frames.requires_grad
    assert not tangents.requires_grad
    assert not step.forward(s, u, p, **PLAN).requires_grad
    assert rollout(step, s, u, p, **PLAN).requires_grad
