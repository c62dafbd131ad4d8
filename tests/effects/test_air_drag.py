"""Drag of the air against closed forms: flight, turning, and what mass does."""

from __future__ import annotations

import pytest

from r2s2r_cli.effects.air_drag import AirDrag
from r2s2r_cli.engine import Parameters, Structure
from tests.support.engine import MASS, G, after, simulate, state, vector
from tests.support.lone_rod import lone_rod

H, DRAG = 1e-3, 0.4


def rod(drag: float, **numbers: float) -> tuple[Structure, Parameters]:
    """One free rod in air of this drag."""
    return lone_rod(AirDrag(), {"drag_n_s_per_m": drag}, **numbers)


def test_flight_dies_away() -> None:
    """Thrown sideways the speed is v0 (1 - h c / m)^n, to first order exp(-c t / m); downwards it nears m g / c."""
    structure, theta = rod(DRAG)
    start = state(structure, vector(0.0, 0.0, 50.0)[None], v=vector(0.5, -0.2, 0.0).expand(1, 1, 3))
    v_WB = simulate(structure, theta, start, 4000, H).states.v_WB
    kept = (1.0 - H * DRAG / MASS) ** 400
    assert v_WB[0, 400, 0, :2].numpy() == pytest.approx([0.5 * kept, -0.2 * kept], rel=1e-10)
    # Gravity of a step counts before the drag on it.
    end = MASS * G / DRAG * (1.0 - H * DRAG / MASS)
    assert float(v_WB[0, -1, 0, 2]) == pytest.approx(-end, rel=1e-4)


def test_turning_dies_away_at_the_same_rate() -> None:
    """A rod that spins about its axis, or across it, loses its turning as it does its speed."""
    structure, theta = rod(DRAG)
    kept = (1.0 - H * DRAG / MASS) ** 60
    for spin in (vector(0.0, 0.0, 3.0), vector(2.0, 0.0, 0.0)):
        start = state(structure, vector(0.0, 0.0, 50.0)[None], w=spin.expand(1, 1, 3))
        end = after(structure, theta, start, 60, H)
        assert end.w_R[0, 0].norm().item() == pytest.approx(float(spin.norm()) * kept, rel=1e-12)


def test_a_heavy_rod_is_braked_less() -> None:
    """Twice the mass with twice the inertia, half the rate: the drag is one of shape, not of mass."""
    structure, theta = rod(DRAG)
    _, heavy = rod(DRAG, mass=2 * MASS)
    start = state(structure, vector(0.0, 0.0, 50.0)[None], v=vector(0.5, 0.0, 0.0).expand(1, 1, 3))
    slow = after(structure, heavy, start, 100, H)
    assert float(slow.v_WB[0, 0, 0]) == pytest.approx(0.5 * (1.0 - H * DRAG / (2 * MASS)) ** 100, rel=1e-12)
    light = after(structure, theta, start, 100, H)
    assert float(light.v_WB[0, 0, 0]) < float(slow.v_WB[0, 0, 0])
