"""Guarded calls: in torch, and in kernels where they are a branch round a shared subroutine."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.guarded import guarded
from r2s2r_cli.engine.native import NativeStep, TracingError, eager, rollout
from r2s2r_cli.engine.native.build import Kernel

PLAN: dict[str, Any] = {"h": 0.1, "hold": 4, "every": 2}


def push(x: Tensor, v: Tensor, k: Tensor, near: Tensor) -> tuple[Tensor, Tensor]:
    """A repulsion of two bodies, with a singularity where it must not be called: at x = 0."""
    f = torch.tanh(k / x.square()) * torch.where(x > 0.2, 1.0, 0.5)[:, :1] * near.to(x.dtype)[:, None]
    return v + f.detach() * 0.1 + torch.sin(f), f * v


def collide(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
    """Three bodies on a line of which neighbours repel each other when near: the same function for every pair."""
    x, v = s[:, :3], s[:, 3:6]
    heat = s[:, 6:] * 0.9
    parts = list(v.unbind(1))
    for i, j in ((0, 1), (1, 2), (0, 2)):
        gap = x[:, [j]] - x[:, [i]]
        near = (gap.abs() < 0.4)[:, 0] & (gap[:, 0] != 0)
        old = torch.stack([parts[i], parts[j]], dim=1)
        pushed, f = guarded(near, push, (gap, old, p[:, :1], near), (old, heat))
        parts[i], parts[j] = pushed[:, 0] - pushed[:, 1] * 0.1, pushed[:, 1]
        heat = heat + 0.1 * f
    after = torch.stack(parts, dim=1) + h * (u - x)
    return torch.cat([x + h * after, after, heat], dim=1)


def setting(batch: int, spread: float) -> tuple[NativeStep, Tensor, Tensor, Tensor]:
    """The colliding bodies, so far apart from each other."""
    random = torch.Generator().manual_seed(1)
    s = torch.randn(batch, 8, generator=random, dtype=torch.float64) * 0.2
    s[:, :3] += spread * torch.arange(3)
    u = torch.randn(batch, 5, 3, generator=random, dtype=torch.float64)
    return (
        NativeStep(collide, 8, 3, 2, key=""),
        s,
        u,
        torch.rand(batch, 2, generator=random, dtype=torch.float64) * 1e-2,
    )


def close(a: Tensor, b: Tensor, tolerance: float = 1e-12) -> None:
    """Equal, relative to the largest entry."""
    assert (a - b).abs().max() <= tolerance * b.abs().max()


@pytest.mark.parametrize("batch", [1, 13])
@pytest.mark.parametrize("spread", [0.1, 0.4, 5.0])
def test_kernels_are_torchs(batch: int, spread: float) -> None:
    """Always, sometimes (mixed in the lanes) and never called: frames and all derivatives are those of torch."""
    step, s, u, p = setting(batch, spread)
    frames = step.forward(s, u, p, **PLAN)
    close(frames, step.torch_rollout(s, u, p, **PLAN))
    adjoint = torch.randn(frames.shape, dtype=torch.float64)
    for ours, theirs in zip(
        step.vjp(s, u, p, adjoint, **PLAN), eager.vjp(collide, s, u, p, adjoint, **PLAN), strict=True
    ):
        close(ours, theirs, 1e-11)
    tangents = tuple(torch.randn(*x.shape, 3, dtype=torch.float64) for x in (s, u, p))
    values, d_frames = step.jvp(s, u, p, ds0=tangents[0], du=tangents[1], dp=tangents[2], **PLAN)
    close(d_frames, eager.jvp(collide, s, u, p, tangents, None, **PLAN)[1], 1e-11)  # type: ignore[arg-type]
    assert torch.equal(values, frames)
    alone = [step.forward(s[[k]], u[[k]], p[[k]], **PLAN) for k in range(batch)]
    assert torch.equal(torch.cat(alone), frames)


def test_one_subroutine_serves_all_calls() -> None:
    """The code of a guarded function is in a kernel once, however often it is called; so are its derivatives."""
    step = setting(1, 0.3)[0]
    text = step._builder._text(Kernel("forward", torch.float64, 1), {})[0]
    assert text.count("void @subroutine") - text.count("call void @subroutine") == 1
    assert text.count("call void @subroutine") == 3
    text = step._builder._text(Kernel("backward", torch.float64, 1), {})[0]
    assert text.count("void @subroutine") - text.count("call void @subroutine") == 2


def test_in_torch_only_chosen_elements_are_seen() -> None:
    """Elements without the condition keep `otherwise` bit for bit, and give and spoil no gradient."""
    x = torch.tensor([[0.0], [2.0], [0.0]], dtype=torch.float64, requires_grad=True)
    other = torch.tensor([[7.0]], dtype=torch.float64, requires_grad=True)
    (y,) = guarded(torch.tensor([False, True, False]), lambda x, c: (c / x,), (x, other), (other,))
    assert y[:, 0].tolist() == [7.0, 3.5, 7.0]
    y.sum().backward()
    assert x.grad is not None and x.grad[:, 0].tolist() == [0.0, -7.0 / 4.0, 0.0]
    assert other.grad is not None and other.grad.item() == 2.5


def test_in_torch_nothing_is_called_for_nobody() -> None:
    """Where no element has the condition the function does not run."""

    def forbidden(*_: Tensor) -> tuple[Tensor, ...]:
        raise AssertionError("called")

    other = torch.ones(1, 2)
    (y,) = guarded(torch.tensor([False, False]), forbidden, (), (other,))
    assert torch.equal(y, torch.ones(2, 2))


def test_a_constant_condition_leaves_no_branch() -> None:
    """A call that never happens is not compiled; one that always does still is right."""

    def step_of(when: bool) -> NativeStep:
        def fn(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
            condition = torch.full((len(s),), when)
            return guarded(condition, lambda x: (x.exp(),), (s,), (s,))[0]

        return NativeStep(fn, 2, 0, 0, key="")

    s, u, p = torch.tensor([[0.5, 1.0]], dtype=torch.float64), torch.zeros(1, 1, 0), torch.zeros(1, 0)
    never, always = step_of(False), step_of(True)
    assert torch.equal(never.forward(s, u, p, h=1.0)[:, 1], s)
    assert never._builder._text(Kernel("forward", torch.float64, 1), {})[0].count("@subroutine") == 0
    close(always.forward(s, u, p, h=1.0)[:, 1], s.exp())


def nested(x: Tensor) -> tuple[Tensor]:
    """A guarded function that calls another."""
    return (guarded(x[:, 0] > 0, lambda x: (x * 2,), (x,), (x,))[0],)


@pytest.mark.parametrize(
    ("fn", "message"),
    [
        (nested, "cannot call another"),
        (lambda x: (x.sum(1),), "shapes"),
        (None, "not in its `inputs`"),
    ],
)
def test_what_cannot_be_guarded_is_refused(fn: Any, message: str) -> None:
    """Nested calls, results of another shape, and tensors that come in behind the back of `inputs`."""

    def step(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        return guarded(s[:, 0] > 0, fn or (lambda x: (x * h,)), (s,), (s,))[0]

    kernels = NativeStep(step, 2, 0, 0, key="")
    with pytest.raises(TracingError, match=message):
        kernels.forward(torch.zeros(1, 2), torch.zeros(1, 1, 0), torch.zeros(1, 0), h=1.0)


def test_gradcheck_through_collisions() -> None:
    """Derivatives of a rollout with collisions agree with central differences."""

    def smooth(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        gap = s[:, :1] - s[:, 1:2]
        (v,) = guarded(gap[:, 0] > 0, lambda g, v, k: (v - k * g * g,), (gap, s[:, 2:], p), (s[:, 2:],))
        return torch.cat([s[:, :2] + h * v, v + h * u], dim=1)

    step = NativeStep(smooth, 4, 2, 1, key="")
    s = torch.tensor([[0.5, 0.1, 0.3, -0.2], [0.1, 0.5, 0.3, -0.2]], dtype=torch.float64, requires_grad=True)
    u, p = torch.randn(2, 3, 2, dtype=torch.float64, requires_grad=True), torch.ones(2, 1, dtype=torch.float64)
    assert torch.autograd.gradcheck(
        lambda s, u, p: rollout(step, s, u, p, h=0.1),
        (s, u, p.requires_grad_()),
        check_forward_ad=True,
        eps=1e-6,
        atol=1e-6,
    )
