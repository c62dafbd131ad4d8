"""Saturation of the cable sensors: a clip with all of the share, a bend with a part of it, and true derivatives."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects.sensor_saturation import SensorSaturation
from r2s2r_cli.engine import LatchedPid, Simulator, closed_loop, sense
from tests.support.variants import Variant, pair, plugged

LENGTH = torch.tensor([[0.05, 0.1, 0.16], [0.2, 0.3, 0.14]], dtype=torch.float64)


def with_(**values: float) -> Variant:
    """Two rods with three cables, all sensors alike."""
    made = plugged(pair(rod_contact=False), SensorSaturation(), on=False)
    named = {f"sensor_saturation.{name}": x for name, x in values.items()}
    theta = made.theta.with_values({name: torch.full_like(made.theta.extra[name], x) for name, x in named.items()})
    return Variant(made.structure, theta, made.start)


def read(length: Tensor, **values: float) -> Tensor:
    """What the sensors read of it."""
    made = with_(**values)
    return sense(made.structure, made.theta, length)


def test_all_of_the_share_is_a_clip() -> None:
    """No more than the top, no less than the bottom, and in between bit by bit what there is."""
    found = read(LENGTH, top_share=1.0, bottom_share=1.0, top_m=0.17, bottom_m=0.12)
    assert torch.allclose(found, torch.clamp(LENGTH, 0.12, 0.17), rtol=0, atol=1e-16)
    inside = (LENGTH > 0.12) & (LENGTH < 0.17)
    assert torch.equal(found[inside], LENGTH[inside])
    assert int(inside.sum()) == 2


def test_a_part_of_it_is_a_bend() -> None:
    """Beyond an end the slope is 1 less the share, without a jump; each end by itself."""
    top = read(LENGTH, top_share=0.4, top_m=0.17)
    assert torch.allclose(top, torch.where(LENGTH > 0.17, 0.17 + 0.6 * (LENGTH - 0.17), LENGTH), rtol=0, atol=1e-16)
    bottom = read(LENGTH, bottom_share=0.7, bottom_m=0.12)
    expected = torch.where(LENGTH < 0.12, 0.12 + 0.3 * (LENGTH - 0.12), LENGTH)
    assert torch.allclose(bottom, expected, rtol=0, atol=1e-16)


def test_every_sensor_has_its_own() -> None:
    """One that saturates leaves the others as they are."""
    made = with_(top_m=0.1)
    share = torch.tensor([[0.0, 1.0, 0.0]], dtype=torch.float64)
    theta = made.theta.with_values({"sensor_saturation.top_share": share})
    found = sense(made.structure, theta, LENGTH + 0.1)
    assert torch.equal(found[:, [0, 2]], LENGTH[:, [0, 2]] + 0.1)
    assert found[:, 1].numpy() == pytest.approx([0.1, 0.1], abs=1e-16)


def test_derivatives_are_those_of_central_differences() -> None:
    """By every number and by the length, with the shares between their bounds; none is 0, and that by a share is not 0
    at its off value either: a fit that starts there sees it."""
    effect = SensorSaturation()
    values = {"top_share": [0.6] * 3, "bottom_share": [0.3] * 3, "top_m": [0.18], "bottom_m": [0.11]}
    leaves = {name: torch.tensor([x], dtype=torch.float64).requires_grad_() for name, x in values.items()}
    length = LENGTH.clone().requires_grad_()
    weights = torch.arange(1.0, 7.0, dtype=torch.float64).reshape(2, 3)
    names = list(leaves)
    found = torch.autograd.grad((weights * effect.sensing(leaves, length)).sum(), [*leaves.values(), length])
    for k, given in enumerate([*leaves.values(), length]):
        for i in range(given.numel()):
            step = torch.zeros(given.numel(), dtype=torch.float64)
            step[i] = 1e-6
            moved = []
            for sign in (1.0, -1.0):
                x = {name: one.detach() for name, one in leaves.items()}
                at = LENGTH
                if k < len(names):
                    x[names[k]] = x[names[k]] + sign * step.reshape(given.shape)
                else:
                    at = at + sign * step.reshape(given.shape)
                moved.append(float((weights * effect.sensing(x, at)).sum()))
            assert float(found[k].flatten()[i]) == pytest.approx((moved[0] - moved[1]) / 2e-6, abs=1e-7)
        assert float(found[k].abs().max()) > 1e-3
    off = torch.zeros(1, 3, dtype=torch.float64, requires_grad=True)
    at_off = {**{name: x.detach() for name, x in leaves.items()}, "top_share": off}
    (slope,) = torch.autograd.grad(effect.sensing(at_off, LENGTH).sum(), off)
    assert slope[0].numpy() == pytest.approx([-0.02, -0.12, 0.0], abs=1e-15)


def test_a_cable_that_is_to_go_beyond_the_top_is_never_done() -> None:
    """The controller that lets a cable out to where the sensor shows no more keeps its motor running until it gives the
    target up; what it read never passes the top. Without saturation it is done before."""
    pid = LatchedPid(p=6.0, i=0.0, d=0.0, tolerance=0.02, min_length=0.1, range=0.3, period=0.01,
                     cable_caps=((1, 3), (0, 2), (1, 2)), actuated=(1,))  # fmt: skip
    none = LENGTH.new_zeros(1)
    runs = []
    for share in (0.0, 1.0):
        made = with_(top_share=share, top_m=0.215)
        simulator = Simulator(made.structure)
        target = none[:, None] + 0.42  # 0.226 m
        runs.append(closed_loop(simulator, made.theta, made.start, pid, target, none, none + 1.0))
    plain, clipped = runs
    assert not bool(plain.timed_out[0, 0])
    assert bool(clipped.timed_out[0, 0])
    assert float(clipped.length[..., 1].max()) == 0.215
    assert float(plain.length[..., 1].max()) > 0.215
