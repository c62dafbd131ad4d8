"""Packs: equal parts of one environment computed side by side, which changes speed and not a bit of the results."""

from __future__ import annotations

import random
from typing import Any

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.guarded import guarded
from r2s2r_cli.engine.native import NativeStep
from r2s2r_cli.engine.native.build import Kernel

PLAN: dict[str, Any] = {"h": 0.02, "hold": 7, "every": 3}
PARTS = 3
Twins = tuple[tuple[tuple[str, int], ...], ...]


def parts(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
    """Three bodies on springs with every operation that can be packed; pairs of them repel each other when near."""
    x, v = s[:, :PARTS], s[:, PARTS:]
    stiffness, limit = p[:, :PARTS], p[:, PARTS : 2 * PARTS]
    length = torch.sqrt(x * x + 0.1)
    force = torch.where(x > 0, -stiffness * x, torch.abs(x).detach()) / length
    force = torch.maximum(torch.minimum(force, limit), -limit) + u * torch.where((x <= 1) & ~(v == 0), 1.0, 0.5)
    force = force + torch.sin(x) - p[:, -1:] * v / torch.linalg.vector_norm(v, dim=1, keepdim=True)
    speeds = list((v + h * force).unbind(1))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        gap = x[:, [j]] - x[:, [i]]
        speeds[i], speeds[j] = (
            y[:, 0]
            for y in guarded(
                gap[:, 0].abs() < 0.3,
                lambda gap, a, b, k: (a - k * gap, b + k * gap * gap),
                (gap, speeds[i][:, None], speeds[j][:, None], p[:, -1:]),
                (speeds[i][:, None], speeds[j][:, None]),
            )
        )
    v = torch.stack(speeds, dim=1)
    return torch.cat([x + h * v, v], dim=1)


def right_twins() -> Twins:
    """The same quantity of the three bodies, adjoints included."""
    fields = [("s", 0), ("s", PARTS), ("a", 0), ("a", PARTS), ("u", 0), ("p", 0), ("p", PARTS)]
    return tuple(tuple((kind, start + k) for k in range(PARTS)) for kind, start in fields)


def wrong_twins(seed: int) -> Twins:
    """Twos to fours of inputs that have nothing in common."""
    chance = random.Random(seed)
    sizes = {"s": 2 * PARTS, "a": 2 * PARTS, "u": PARTS, "p": 2 * PARTS + 1}
    inputs = [(kind, k) for kind, n in sizes.items() for k in range(n)]
    chance.shuffle(inputs)
    groups = []
    while len(inputs) > 4:
        groups.append(tuple(inputs.pop() for _ in range(chance.choice((2, 3, 4)))))
    return tuple(groups)


def results(twins: Twins, dtype: torch.dtype) -> list[Tensor]:
    """Frames, adjoints and tangents of one environment, over 35 steps."""
    step = NativeStep(parts, 2 * PARTS, PARTS, 2 * PARTS + 1, key="", twins=twins)
    chance = torch.Generator().manual_seed(4)
    s, u, p = (
        torch.randn(*shape, generator=chance, dtype=torch.float64).to(dtype)
        for shape in ((1, 2 * PARTS), (1, 5, PARTS), (1, 2 * PARTS + 1))
    )
    frames = step.forward(s, u, p.abs(), **PLAN)
    dp = torch.eye(2 * PARTS + 1, dtype=dtype)[None]
    adjoints = step.vjp(s, u, p.abs(), torch.ones_like(frames), **PLAN)
    return [frames, *adjoints, *step.jvp(s, u, p.abs(), dp=dp, **PLAN)]


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("twins", [right_twins(), *(wrong_twins(seed) for seed in range(5))], ids=range(6))
def test_packs_change_no_bit(twins: Twins, dtype: torch.dtype) -> None:
    """Frames, adjoints and tangents are the same with and without packs, also where the twins are none."""
    plain, packed = results((), dtype), results(twins, dtype)
    assert bool(torch.isfinite(plain[0]).all())
    assert all(torch.equal(a, b) for a, b in zip(plain, packed, strict=True))


@pytest.mark.parametrize("kind", ["forward", "backward"])
def test_equal_parts_share_instructions(kind: str) -> None:
    """With twins the code of one environment is in vectors of four, and shorter."""
    texts = []
    for twins in ((), right_twins()):
        step = NativeStep(parts, 2 * PARTS, PARTS, 2 * PARTS + 1, key="", twins=twins)
        texts.append(step._builder._text(Kernel(kind, torch.float64, 1), {})[0])
    assert "<4 x double>" not in texts[0]
    assert "sqrt.v4f64" in texts[1]
    arithmetic = [
        sum(f" = {op} " in line for line in text.splitlines() for op in ("fmul", "fdiv", "fadd")) for text in texts
    ]
    assert arithmetic[1] < 0.7 * arithmetic[0]


def test_twins_that_are_not_read_are_no_harm() -> None:
    """Groups of inputs that the step does not read, of one member, or of too many, are left out."""
    odd: Twins = ((("s", 0),), tuple(("s", k) for k in range(6)), (("p", 99), ("p", 100)))
    assert all(torch.equal(a, b) for a, b in zip(results((), torch.float64), results(odd, torch.float64), strict=True))
