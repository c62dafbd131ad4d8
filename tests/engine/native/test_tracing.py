"""What the tracer folds, what it refuses and how it says so; and what happens where nothing can be compiled."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.errors import EngineError
from r2s2r_cli.engine.native import NativeFallbackWarning, NativeStep, TracingError, eager, machine, rollout
from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.passes import live
from r2s2r_cli.engine.native.program import forward_program

ONE = (
    torch.ones(1, 2, dtype=torch.float64),
    torch.zeros(1, 1, 1, dtype=torch.float64),
    torch.ones(1, 1, dtype=torch.float64),
)


def step_of(fn: Callable[[Tensor], Tensor]) -> NativeStep:
    """A step that maps the state only."""
    return NativeStep(lambda s, u, p, h: fn(s), 2, 1, 1, key="")


def operations(fn: Callable[[Tensor], Tensor]) -> list[str]:
    """Operations left of a function of the state, inputs and constants apart."""
    program = forward_program(lambda s, u, p, h: fn(s), 2, 1, 1, torch.float64)
    nodes = live(program.graph, program.state)
    return sorted(op for i in nodes if (op := program.graph.ops[i]) not in ("in", "const"))


@pytest.mark.parametrize(
    ("fn", "left"),
    [
        (lambda s: s * 1.0 + 0.0, []),
        (lambda s: s + s * 0.0, []),
        (lambda s: s * torch.eye(2, dtype=s.dtype)[0], []),
        (lambda s: s @ torch.eye(2, dtype=s.dtype), []),
        (lambda s: s.neg().neg(), []),
        (lambda s: torch.where(s > 0, s, s), []),
        (lambda s: torch.where(torch.tensor([True, False]), s, 2.0), []),
        (lambda s: torch.stack([s[:, 0] * s[:, 1], s[:, 1] * s[:, 0]], 1), ["mul"]),
        (lambda s: s * s[:, :1] + s, ["fma", "fma"]),
        (lambda s: s / s[:, :1], ["div", "mul", "mul"]),
        (lambda s: 2.0 * (3.0 * s), ["mul", "mul"]),
        (lambda s: s / 4.0, ["mul", "mul"]),
        (lambda s: torch.where(s > 0, torch.where(s > 0, s, 5.0), 1.0), ["lt", "lt", "select", "select"]),
    ],
)
def test_programs_are_folded(fn: Callable[[Tensor], Tensor], left: list[str]) -> None:
    """Neutral elements, constants and repetitions cost nothing; products go into sums, divisions are shared."""
    assert operations(fn) == left


def test_tensors_without_elements_are_traced() -> None:
    """A robot without cables has empty tensors of every shape: indexing, reductions and products keep the shapes."""

    def empty(s: Tensor) -> Tensor:
        none = s[:, torch.zeros((0, 2), dtype=torch.long)]
        assert none.shape == (len(s), 0, 2)
        nothing = torch.linalg.vector_norm(none, dim=-1) + none.sum(-1)
        spread = torch.einsum("ker,bke->br", torch.zeros(0, 2, 2, dtype=s.dtype), none)
        joined = torch.cat([nothing, torch.stack([nothing.sum(1)] * 2, 1)], 1)
        return s + spread + joined + (none @ torch.ones(2, 1, dtype=s.dtype)).sum((1, 2))[:, None]

    assert torch.equal(step_of(empty).forward(*ONE, h=1.0)[:, 1], empty(ONE[0]))


def test_equal_operations_are_one_node() -> None:
    """The graph holds no operation twice; sums and products do not depend on the order of their terms."""
    g = Graph()
    a, b = g.node("in", "s", 0), g.node("in", "s", 1)
    assert g.mul(a, b) == g.mul(b, a)
    assert g.add(a, b) == g.add(b, a)
    assert g.sub(a, b) != g.sub(b, a)
    assert g.const(0.0) == g.const(-0.0)
    assert g.const(float("nan")) == g.const(float("nan"))


@pytest.mark.parametrize(
    ("fn", "message"),
    [
        (lambda s: torch.sort(s)[0], "sort"),
        (lambda s: s.to(torch.float16).to(torch.float64), "float16"),
        (lambda s: s * 2 if s[0, 0] > 0 else s, "torch.where"),
        (lambda s: s * float(s[0, 0]), "torch.where"),
        (lambda s: s[:, s[0] > 0].expand(1, 2), "index"),
        (
            lambda s: torch.eye(2, dtype=s.dtype).index_fill_(0, torch.tensor([0]), 0.0).copy_(s.expand(2, 2)),
            "torch.stack",
        ),
        (lambda s: s[:, :1], "shape"),
        (lambda s: s.sum(1, keepdim=True, dtype=torch.float32).expand(1, 2), "float32"),
        (lambda s: s.sum(1, keepdim=True, dtype=torch.int64).expand(1, 2), "int64"),
        (lambda s: torch.ops.aten.select(s, 5, 0), "these arguments|IndexError|range"),
        (lambda s: s + torch.rand(2, dtype=s.dtype), "rand.*drawn once"),
        (lambda s: s.clone().unsqueeze_(0)[0], "unsqueeze_.*in place"),
        (lambda s: torch.linalg.vector_norm(s, ord=3, dim=1, keepdim=True).expand(1, 2), "order 3"),
    ],
)
def test_what_cannot_be_compiled_is_named(fn: Callable[[Tensor], Tensor], message: str) -> None:
    """An unknown operation or a branch on values is an error of the engine that says what, and says the remedy."""
    with pytest.raises(TracingError, match=message):
        step_of(fn).forward(*ONE, h=1.0)
    assert issubclass(TracingError, EngineError)


def test_fixed_random_numbers_are_constants() -> None:
    """Numbers of a seeded generator are the same in every trace, and may be part of a step."""

    def field(s: Tensor) -> Tensor:
        return s + torch.rand(2, generator=torch.Generator().manual_seed(3), dtype=s.dtype)

    wanted = field(ONE[0])
    assert torch.equal(step_of(field).forward(*ONE, h=1.0)[:, 1], wanted)


def test_the_error_names_the_line() -> None:
    """The message has the file and the code of the line that cannot be compiled, though torch lies between."""

    def unlucky(s: Tensor) -> Tensor:
        return torch.nn.functional.conv1d(s[None], s[None])[0]  # this line

    with pytest.raises(TracingError, match=r"test_tracing.py:\d+: .*# this line") as info:
        step_of(unlucky).forward(*ONE, h=1.0)
    assert "convolution" in str(info.value)


@pytest.fixture
def nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """No kernel can be compiled, and nobody was warned yet."""
    monkeypatch.setattr(machine, "available", lambda: False)
    monkeypatch.setattr(eager, "_warned", False)


@pytest.mark.usefixtures("nowhere")
def test_without_llvmlite_torch_serves_with_one_warning() -> None:
    """All calls work in plain torch; only the first warns."""
    step = NativeStep(lambda s, u, p, h: s + h * p * s, 2, 1, 1, key="")
    with pytest.warns(NativeFallbackWarning, match="llvmlite"):
        frames = step.forward(*ONE, h=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert frames[0, 1, 0].item() == pytest.approx(1.1)
        p = ONE[2].clone().requires_grad_()
        rollout(step, *ONE[:2], p, h=0.1)[:, 1].sum().backward()
        assert p.grad is not None and p.grad.item() == pytest.approx(0.2)
        assert step.vjp(*ONE, torch.ones(1, 2, 2, dtype=torch.float64), h=0.1)[2].item() == pytest.approx(0.2)
        tangent = step.jvp(*ONE, dp=torch.ones(1, 1, 2, dtype=torch.float64), h=0.1)[1]
        assert tangent[0, 1, 0].tolist() == pytest.approx([0.1, 0.1])
    assert step.build_log == []


def test_other_devices_are_served_by_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tensors that are not on the CPU take the torch path, with the warning."""
    monkeypatch.setattr(eager, "_warned", False)
    step = step_of(lambda s: s * 2)
    given = [x.to("meta") for x in ONE]
    with pytest.warns(NativeFallbackWarning, match="meta"):
        assert step.forward(*given, h=0.1).shape == (1, 2, 2)


def test_a_missing_llvmlite_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Availability is found out by importing, once."""

    def missing() -> None:
        raise ImportError

    monkeypatch.setattr(machine, "binding", missing)
    assert not machine.available()
