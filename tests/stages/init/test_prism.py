"""The prism and the six-bar: closed forms, symmetry, and rest poses that stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.init.facts import FACTS
from r2s2r_cli.stages.init.prism import (
    PRISM_CABLES,
    PRISM_SUPPORT,
    TWIST,
    prism_caps,
    prism_caps_rate,
    prism_rest,
)
from r2s2r_cli.stages.init.sixbar import EDGE_PER_ROD, sixbar_cables, sixbar_rest, sixbar_support

ROD, RADIUS = 0.325, 0.0175
ROBOTS = sorted(FACTS)


def cable_lengths(p: np.ndarray, cables: tuple[tuple[int, int], ...]) -> np.ndarray:
    """Cap distances of the cables."""
    return np.array([np.linalg.norm(p[a] - p[b]) for a, b in cables])


def rod_lengths(p: np.ndarray) -> np.ndarray:
    """Cap distances of the rods."""
    return np.linalg.norm(p[1::2] - p[0::2], axis=1)


def passive_length(p: np.ndarray, edge_odd: float, edge_even: float) -> float:
    """Length of the passive tendons, cap centre to cap centre [m]: they turn by 180 - 150 = 30 degrees."""
    odd, even = edge_odd / np.sqrt(3.0), edge_even / np.sqrt(3.0)
    return float(np.sqrt(np.ptp(p[:, 2]) ** 2 + odd**2 + even**2 + 2 * odd * even * np.cos(TWIST)))


def support_margin(p_WE: np.ndarray, support: tuple[int, ...]) -> float:
    """How far the centre of mass stands inside its support triangle, seen from above [m]; negative: it tips over.

    All rods weigh the same and balance in their middle, so the centre of mass is the centroid of the caps.
    """
    com = p_WE.mean(axis=0)[:2]
    corners = p_WE[list(support), :2]
    edges = np.roll(corners, -1, axis=0) - corners
    arms = com - corners
    cross = edges[:, 0] * arms[:, 1] - edges[:, 1] * arms[:, 0]
    turn = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    return float((np.sign(turn) * cross / np.linalg.norm(edges, axis=1)).min())


@pytest.mark.parametrize(("odd", "even"), [(0.195, 0.195), (0.1, 0.2), (0.2, 0.1)])
def test_edges_rods_and_passive_tendons(odd: float, even: float) -> None:
    """Rods and actuated edges have exactly the lengths asked for, the passive tendons the closed form's."""
    p = prism_caps(ROD, odd, even)
    np.testing.assert_allclose(rod_lengths(p), ROD, rtol=0, atol=1e-15)
    lengths = cable_lengths(p, PRISM_CABLES)
    np.testing.assert_allclose(lengths[:3], odd, rtol=0, atol=1e-15)
    np.testing.assert_allclose(lengths[3:6], even, rtol=0, atol=1e-15)
    np.testing.assert_allclose(lengths[6:], passive_length(p, odd, even), rtol=0, atol=1e-15)


def test_threefold_symmetry() -> None:
    """A third of a turn about the axis maps rod 0-1 on 4-5, 4-5 on 2-3, and 2-3 on 0-1."""
    p = prism_caps(ROD, 0.18, 0.15)
    c, s = np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(p @ turn.T, p[[4, 5, 0, 1, 2, 3]], atol=1e-15)


def test_prestress_balances_without_load() -> None:
    """At 150 degrees some positive cable forces and rod compressions leave no net force at any cap."""
    p = prism_caps(ROD, 0.195, 0.195)
    members = [*PRISM_CABLES, (0, 1), (2, 3), (4, 5)]
    balance = np.zeros((18, len(members)))
    for k, (a, b) in enumerate(members):
        balance[3 * a : 3 * a + 3, k] = p[b] - p[a]
        balance[3 * b : 3 * b + 3, k] = p[a] - p[b]
    _, singular, vt = np.linalg.svd(balance)
    assert singular[-1] < 1e-12 * singular[0]
    density = vt[-1] / vt[-1][6]
    assert np.all(density[:9] > 0.1)
    assert np.all(density[9:] < -0.1)


def test_rate_is_the_derivative() -> None:
    """`prism_caps_rate` equals the central difference of `prism_caps`."""
    h, rates = 1e-6, (0.03, -0.05)
    ahead = prism_caps(ROD, 0.15 + h * rates[0], 0.18 + h * rates[1])
    behind = prism_caps(ROD, 0.15 - h * rates[0], 0.18 - h * rates[1])
    np.testing.assert_allclose(prism_caps_rate(ROD, 0.15, 0.18, *rates), (ahead - behind) / (2 * h), atol=1e-9)


@pytest.mark.parametrize("edge", [0.0, -0.1, 0.3, float("nan")])
def test_impossible_edges_are_refused(edge: float) -> None:
    """Triangles that no rod of that length can join are an input error with a hint, never NaN."""
    with pytest.raises(InputError) as caught:
        prism_caps(ROD, edge, edge)
    assert caught.value.hint


@pytest.mark.parametrize("name", ROBOTS)
def test_rest_pose_stands(name: str) -> None:
    """Three caps touch the ground, none lies lower, and the centre of mass is well inside their triangle."""
    facts = FACTS[name]
    p_WE = facts.rest_caps()
    radius = facts.cap_radius.value
    on_ground = np.flatnonzero(np.abs(p_WE[:, 2] - radius) < 1e-12)
    assert sorted(on_ground) == sorted(facts.support)
    assert p_WE[:, 2].min() >= radius - 1e-12
    assert support_margin(p_WE, facts.support) > 0.02
    np.testing.assert_allclose(rod_lengths(p_WE), facts.rod_length.value, atol=1e-12)
    np.testing.assert_allclose(cable_lengths(p_WE, facts.actuated), facts.rest_edge, atol=1e-6)


def test_support_margin_knows_a_pose_that_tips() -> None:
    """The margin is the inradius over an equilateral triangle's centre, and negative outside of it."""
    corners = np.array([[np.cos(a), np.sin(a), 0.0] for a in np.deg2rad([0, 120, 240])])
    over = np.vstack([corners, corners + np.array([0, 0, 1])])
    assert support_margin(over, (0, 1, 2)) == pytest.approx(0.5)
    assert support_margin(over, (2, 1, 0)) == pytest.approx(0.5)
    aside = np.vstack([corners, corners + np.array([3, 0, 1])])
    assert support_margin(aside, (0, 1, 2)) < 0


def test_rest_pose_is_that_of_the_real_robot(real_dir: Path) -> None:
    """The real crawl starts on the same three caps, with the same hand, and each cap within 25 mm after alignment."""
    text = np.genfromtxt(real_dir / "tribar_crawl" / "crawl.csv", delimiter=",", names=True, max_rows=1)
    real = np.array([[float(text[f"cap{cap}_{axis}_m"]) for axis in "xyz"] for cap in range(6)])
    assert set(np.argsort(real[:, 2])[:3]) == set(PRISM_SUPPORT)
    p_WE = prism_rest(ROD, 0.195, RADIUS)
    a, b = real - real.mean(axis=0), p_WE - p_WE.mean(axis=0)
    turned = np.sum(b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0])
    angle = np.arctan2(turned, np.sum(b[:, :2] * a[:, :2]))
    c, s = np.cos(angle), np.sin(angle)
    aligned = b @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    assert np.linalg.norm(aligned - a, axis=1).max() < 0.025


def test_sixbar_has_24_equal_cables() -> None:
    """24 different cables of sqrt(6)/4 rod lengths, four a cap: two winched, two passive."""
    p_WE = sixbar_rest(ROD, RADIUS)
    actuated, passive = sixbar_cables()
    assert len(set(actuated + passive)) == 24
    np.testing.assert_allclose(cable_lengths(p_WE, actuated + passive), EDGE_PER_ROD * ROD, atol=1e-12)
    for cables in (actuated, passive):
        assert np.bincount(np.array(cables).ravel(), minlength=12).tolist() == [2] * 12
    assert all(
        tuple(sorted(pair)) in actuated for pair in zip(sixbar_support(), np.roll(sixbar_support(), 1), strict=True)
    )
