"""Real stiction: a robot at rest and a rod on a slope do not creep."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from r2s2r_cli.engine import Structure, end_caps
from r2s2r_cli.engine.ground import tilted
from r2s2r_cli.engine.reading import read
from tests.support.engine import RADIUS, G, parameters, simulate, simulator, slope, state, threebar_engine, vector

MINUTE = 60_000
"""Steps of 1 ms."""
LEASHED = Structure(n_rods=2, cable_rods=((0, 1),), actuated=())
"""Rod 0 lies on the ground; its cable to rod 1, far away, is slack for ever. Rod 1 rests there likewise."""


def test_a_free_rod_on_a_slope_does_not_creep() -> None:
    """One minute on 20 degrees at mu 0.6: rods along the fall line drift by less than 0.01 mm, at 1 and at 2 ms."""
    theta = parameters(LEASHED, gravity=slope(math.radians(20)), rest=100.0)
    start = state(LEASHED, torch.stack([vector(0.0, 0.0, RADIUS), vector(5.0, 0.0, RADIUS)]))
    for h in (1e-3, 2e-3):
        p = simulate(LEASHED, theta, start, round(60 / h), h, every=round(1 / h)).states.p_WB[0]
        assert float((p - p[0]).abs().max()) < 1e-5


def test_the_slope_test_can_fail() -> None:
    """The same rods at mu 0.35, just below tan(20 degrees), slide for metres."""
    theta = parameters(LEASHED, gravity=slope(math.radians(20)), rest=100.0, friction=0.35)
    start = state(LEASHED, torch.stack([vector(0.0, 0.0, RADIUS), vector(5.0, 0.0, RADIUS)]))
    end = simulate(LEASHED, theta, start, 10_000, 1e-3).at(-1)
    acceleration = G * (math.sin(math.radians(20)) - 0.35 * math.cos(math.radians(20)))
    assert float(end.p_WB[0, 0, 0]) == pytest.approx(acceleration * 100 / 2, rel=0.02)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_resting_robot_does_not_drift(restitution: float) -> None:
    """Settled for 10 s, the robot's caps move by less than 0.1 mm in the minute after, also with restitution; the
    ground carries its weight and friction is at work."""
    structure, theta, rest = threebar_engine()
    theta = replace(theta, restitution=torch.full_like(theta.restitution, restitution))
    settled = simulate(structure, theta, rest, 10_000, 1e-3).at(-1)
    caps = simulate(structure, theta, settled, MINUTE, 1e-3, every=1000).end_caps()[0]
    assert float((caps - caps[0]).abs().max()) < 1e-4
    ground = read(structure, theta, settled).ground[0]
    assert float(ground[:, 2].sum()) == pytest.approx(float(theta.mass.sum()) * G, rel=1e-3)
    assert float(torch.linalg.vector_norm(ground[:, :2], dim=1).max()) > 0.1


def test_a_robot_rests_on_a_tilted_plane() -> None:
    """On a plane of 10 degrees about x and 5 about y, given in the world, the robot stays for 20 s where it settled."""
    structure, theta, rest = threebar_engine()
    plane = tilted(math.radians(10), math.radians(5), offset=0.3)
    start = plane.to_world(rest)
    still = start.p_WB.new_zeros(1, 1, 6)
    sim = simulator(structure)
    settled = sim.rollout(theta, start, still, hold=10_000, every=10_000, ground=plane, substeps=1).at(-1)
    caps = sim.rollout(theta, settled, still, hold=20_000, every=1000, ground=plane, substeps=1).end_caps()[0]
    assert float((caps - caps[0]).abs().max()) < 1e-4
    height = (end_caps(theta, settled) - plane.p_WG()) @ plane.normal
    assert float(height.min()) == pytest.approx(0.0175, abs=1e-5)
