"""How far a trajectory's derivatives grow in 10 s: bounded, or no fit over many seconds could use them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import Detach, Parameters, State, Structure, pack_parameters
from r2s2r_cli.engine.flat import parameter_slots, state_slots
from tests.support.engine import random_gait, simulate, simulator, threebar_engine

SECONDS = 10
GAITS = 8
FREE = ("stiffness", "damping", "friction", "mass", "speed_in", "rest")
"""Parameters that are varied by their logarithm, each field by one number."""


def directions(structure: Structure, theta: Parameters) -> Tensor:
    """Tangents of the flat parameters per logarithm of each field of FREE, (NP, D)."""
    p = pack_parameters(structure, theta)[0]
    columns = torch.zeros(len(p), len(FREE), dtype=p.dtype)
    for k, name in enumerate(FREE):
        slot = parameter_slots(structure)[name]
        columns[slot.start : slot.start + slot.size, k] = p[slot.start : slot.start + slot.size]
    return columns


def robot(detach: Detach = Detach.NONE) -> tuple[Structure, Parameters, State]:
    """The settled three-bar robot."""
    structure, theta, rest = threebar_engine()
    settled = simulate(structure, theta, rest, 3000, 1e-3).at(-1)
    return replace(structure, detach=detach), theta, settled


@lru_cache
def growth(detach: Detach = Detach.NONE, seconds: int = SECONDS) -> tuple[Tensor, Tensor]:
    """Largest |d position / d log parameter| [m], (GAITS, seconds), and largest |d position / d start position| [1] of
    rod 0 moved along x, y and z, same shape."""
    structure, theta, start = robot(detach)
    u = random_gait(2 * SECONDS, 6, batch=GAITS, seed=7)[:, : 2 * seconds]
    shift = torch.zeros(sum(slot.size for slot in state_slots(structure).values()), 3, dtype=torch.float64)
    shift[:3] = torch.eye(3, dtype=torch.float64)
    sim = simulator(structure)
    how = {"step": 1e-3, "hold": 500, "every": 1000, "substeps": 1}
    by_parameter = sim.jvp(theta, start, u, d_parameters=directions(structure, theta), **how)[1]
    by_start = sim.jvp(theta, start, u, d_state=shift, **how)[1]
    places = slice(0, 3 * structure.n_rods)
    return tuple(x[:, 1:, places].abs().amax((2, 3)) for x in (by_parameter, by_start))


@pytest.mark.parametrize("seconds", [4, pytest.param(SECONDS, marks=pytest.mark.slow)])
def test_derivatives_over_many_seconds_stay_bounded(seconds: int) -> None:
    """8 random gaits: position per logarithm of a parameter is below 0.5 m in the median, 2000 m at worst, position per
    start position below 5 and 1000 (tips), and the median does not grow tenfold in the second half."""
    by_parameter, by_start = growth(seconds=seconds)
    assert bool(torch.isfinite(by_parameter).all() and torch.isfinite(by_start).all())
    assert float(by_parameter[:, -1].median()) < 0.5
    assert float(by_parameter.max()) < 2000.0
    assert float(by_start[:, -1].median()) < 5.0
    assert float(by_start.max()) < 1000.0
    assert float(by_parameter[:, -1].median() / by_parameter[:, seconds // 2 - 1].median()) < 10.0


@pytest.mark.slow
def test_detached_geometry_stays_bounded_and_detached_impulses_do_not() -> None:
    """`geometry` keeps the constraint in the tangent and is as bounded as the whole derivative; `impulse` leaves it
    out, and its tangent is beyond all bounds after a few seconds: why it is for short windows only."""
    assert float(growth(Detach.GEOMETRY)[1].max()) < 1000.0
    with pytest.warns(RuntimeWarning, match="impulse"):
        assert float(growth(Detach.IMPULSE)[1][:, 3].median()) > 1e4


@pytest.mark.parametrize("seconds", [1, 2])
def test_tangents_are_the_difference_quotient(seconds: int) -> None:
    """Over 1 and 2 s of gait the tangent of all positions per logarithm of each parameter is the central difference to
    1e-4 of its size in the median of 8 gaits."""
    structure, theta, start = robot()
    u = random_gait(2 * seconds, 6, batch=GAITS, seed=8)
    sim = simulator(structure)
    how = {"step": 1e-3, "hold": 500, "every": 1000 * seconds, "substeps": 1}
    columns = directions(structure, theta)
    tangents = sim.jvp(theta, start, u, d_parameters=columns, **how)[1][:, -1, : 3 * structure.n_rods]
    p, eps = pack_parameters(structure, theta), 1e-7
    s = torch.cat([x.flatten(1) for x in (start.p_WB, start.q_WR, start.v_WB, start.w_R, start.rest, start.winding)], 1)
    errors = []
    for k in range(len(FREE)):
        up, down = (
            sim.advance(s.expand(GAITS, -1), u, p + sign * eps * columns[:, k], h=1e-3, hold=500, every=1000 * seconds)
            for sign in (1, -1)
        )
        quotient = ((up - down)[:, -1, : 3 * structure.n_rods]) / (2 * eps)
        errors.append((quotient - tangents[..., k]).abs().amax(1) / tangents[..., k].abs().amax(1))
    assert float(torch.stack(errors).median()) < 1e-4
