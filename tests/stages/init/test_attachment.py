"""The attachment heuristic: geometry of the sites, assignment, and the roll of every rod."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.stages.init.attachment import (
    Attachment,
    attach,
    centre_rod,
    paper_labels,
    rod_frames,
    site_points,
)
from r2s2r_cli.stages.init.facts import FACTS
from r2s2r_cli.stages.init.prism import PRISM_CABLES
from r2s2r_cli.stages.init.robot_facts import RobotFacts
from r2s2r_cli.views.attachment import attachment_png

ROBOTS = sorted(FACTS)
RADIUS = 0.0175


def derived(name: str) -> tuple[RobotFacts, np.ndarray, Attachment, np.ndarray]:
    """Facts, rest caps, attachment and world sites of one robot."""
    facts = FACTS[name]
    p_WE = facts.rest_caps()
    found = attach(p_WE, facts.cables, RADIUS, guides=facts.guides)
    return facts, p_WE, found, site_points(p_WE, facts.cables, found.sites, found.R_WR)


def lengths(p_WS: np.ndarray) -> np.ndarray:
    """Site-to-site lengths of the cables."""
    return np.linalg.norm(p_WS[:, 0] - p_WS[:, 1], axis=-1)


@pytest.mark.parametrize("name", ROBOTS)
def test_rod_frames_are_rotations(name: str) -> None:
    """R is right-handed and orthonormal, z points to the odd cap, x lies in the vertical plane, upwards."""
    p_WE = FACTS[name].rest_caps()
    R_WR = rod_frames(p_WE)
    np.testing.assert_allclose(R_WR @ np.swapaxes(R_WR, 1, 2), np.broadcast_to(np.eye(3), R_WR.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(R_WR), 1.0, atol=1e-14)
    rod = p_WE[1::2] - p_WE[0::2]
    np.testing.assert_allclose(R_WR[:, :, 2], rod / np.linalg.norm(rod, axis=1, keepdims=True), atol=1e-14)
    assert np.all(R_WR[:, 2, 0] > 0)
    np.testing.assert_allclose(R_WR[:, 2, 1], 0.0, atol=1e-14)


def test_frame_of_a_vertical_rod() -> None:
    """A rod that stands upright has no upper side: its x is the world's x."""
    np.testing.assert_array_equal(rod_frames(np.array([[0.0, 0, 0], [0, 0, 0.3]]))[0], np.eye(3))


@pytest.mark.parametrize("name", ROBOTS)
def test_sites_lie_evenly_on_the_cap(name: str) -> None:
    """Every site is one cap radius from its cap's centre, perpendicular to the rod, 360/n degrees from the next."""
    facts, p_WE, _, p_WS = derived(name)
    for cap in range(len(p_WE)):
        arms = np.array([p_WS[k, e] - p_WE[cap] for k, c in enumerate(facts.cables) for e in (0, 1) if c[e] == cap])
        rod = p_WE[cap ^ 1] - p_WE[cap]
        np.testing.assert_allclose(np.linalg.norm(arms, axis=1), RADIUS, atol=1e-15)
        np.testing.assert_allclose(arms @ rod, 0.0, atol=1e-15)
        cosines = np.sort((arms @ arms[0]) / RADIUS**2)
        np.testing.assert_allclose(cosines, np.sort(np.cos(2 * np.pi * np.arange(len(arms)) / len(arms))), atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_each_site_is_used_once(name: str) -> None:
    """The cables of a cap take different sites, and together all of them."""
    facts, p_WE, found, _ = derived(name)
    for cap in range(len(p_WE)):
        slots = [found.slot[k, e] for k, c in enumerate(facts.cables) for e in (0, 1) if c[e] == cap]
        assert sorted(slots) == list(range(len(slots)))


def test_points_of_the_paper() -> None:
    """A is the top of its circle; AD, BE, CF are parallel to the centre rod; G, H are closest to their partners."""
    facts, p_WE, found, p_WS = derived("threebar")
    labels = paper_labels(found, facts.cables)
    assert list(labels) == list("ABCDEFGH")
    point = {name: p_WS[cable, end] for name, (cable, end) in labels.items()}
    rod = p_WE[3] - p_WE[2]
    assert found.centre == 1
    assert point["A"][2] - p_WE[2, 2] == pytest.approx(RADIUS * np.sqrt(1 - (rod[2] / 0.325) ** 2), abs=1e-12)
    for one, other in ("AD", "BE", "CF"):
        np.testing.assert_allclose(point[other] - point[one], rod, atol=1e-12)
    for name in "GH":
        cable, end = labels[name]
        cap = facts.cables[cable][end]
        R = found.R_WR[cap // 2]
        angle = np.linspace(0, 2 * np.pi, 3601)
        circle = p_WE[cap] + RADIUS * (np.outer(np.cos(angle), R[:, 0]) + np.outer(np.sin(angle), R[:, 1]))
        partner = p_WS[cable, 1 - end]
        nearest = np.linalg.norm(circle - partner, axis=1).min()
        assert np.linalg.norm(point[name] - partner) == pytest.approx(nearest, abs=1e-7)


def test_assignment_is_the_best_of_all() -> None:
    """No other way to hand a cap's three sites to its cables gives less squared length to the partners."""
    facts, p_WE, _, p_WS = derived("threebar")
    for cap in range(6):
        ends = [(k, e) for k, c in enumerate(facts.cables) for e in (0, 1) if c[e] == cap]
        sites = [p_WS[k, e] for k, e in ends]
        partners = [p_WE[facts.cables[k][1 - e]] for k, e in ends]
        costs = [
            sum(float(np.sum((s - p) ** 2)) for s, p in zip(order, partners, strict=True))
            for order in itertools.permutations(sites)
        ]
        assert costs[0] == min(costs)


def test_passive_guides_make_it_symmetric() -> None:
    """Guided by the passive tendons, equal cables come out equal to 4 mm; by the literal pair, to 12 mm only."""
    facts, p_WE, _, p_WS = derived("threebar")
    assert np.ptp(lengths(p_WS)[:6]) < 4e-3
    assert np.ptp(lengths(p_WS)[6:]) < 1.5e-3
    literal = attach(p_WE, facts.cables, RADIUS, guides=(3, 6))
    assert np.ptp(lengths(site_points(p_WE, facts.cables, literal.sites, literal.R_WR))[:6]) > 0.01


@pytest.mark.parametrize("name", ["threebar", "threebar-330"])
def test_heading_and_place_do_not_matter(name: str) -> None:
    """The same robot, turned about the vertical and moved, gets the same sites in its rods' frames."""
    facts, p_WE, found, _ = derived(name)
    c, s = np.cos(0.7), np.sin(0.7)
    moved = p_WE @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + [1.0, -2.0, 0.3]
    np.testing.assert_allclose(attach(moved, facts.cables, RADIUS, guides=facts.guides).sites, found.sites, atol=1e-12)


def test_rod_end_mode_joins_cap_centres() -> None:
    """In mode rod_end every cable runs from cap centre to cap centre."""
    facts = FACTS["threebar"]
    p_WE = facts.rest_caps()
    found = attach(p_WE, facts.cables, RADIUS, "rod_end")
    p_WS = site_points(p_WE, facts.cables, found.sites, found.R_WR)
    np.testing.assert_allclose(p_WS, p_WE[np.array(facts.cables)], atol=1e-15)
    assert paper_labels(found, facts.cables) == {}


def test_first_frame_of_the_real_crawl(real_dir: Path) -> None:
    """On the real robot's first pose rod 2-3 is central, and cables are 15-35 mm shorter than between cap centres."""
    row = np.genfromtxt(real_dir / "tribar_crawl" / "crawl.csv", delimiter=",", names=True, max_rows=1)
    p_WE = np.array([[float(row[f"cap{cap}_{axis}_m"]) for axis in "xyz"] for cap in range(6)])
    assert centre_rod(p_WE) == 1
    found = attach(p_WE, PRISM_CABLES, RADIUS, guides=(6, 7, 8))
    p_WS = site_points(p_WE, PRISM_CABLES, found.sites, found.R_WR)
    pairs = np.array(PRISM_CABLES)
    between_caps = np.linalg.norm(p_WE[pairs[:, 0]] - p_WE[pairs[:, 1]], axis=1)
    shorter = between_caps - lengths(p_WS)
    assert shorter.min() > 0.015
    assert shorter.max() < 0.035
    ideal = derived("threebar")[2].roll
    assert np.abs(np.rad2deg(found.roll - ideal)).max() < 6


def test_a_rod_that_no_cable_reaches_stands_alone() -> None:
    """A loose rod gets its own top as roll, and the others are not disturbed."""
    p_WE = np.array([[0, 0, 0.1], [1, 0, 0.1], [0, 1, 0.1], [1, 1, 0.1], [0, 9, 0.1], [1, 9, 0.1]], dtype=float)
    found = attach(p_WE, [(0, 2), (1, 3)], RADIUS)
    assert found.guide[2] == -1
    assert found.roll[2] == 0.0
    assert np.isfinite(found.sites).all()


@pytest.mark.parametrize(
    ("p_WE", "cables"),
    [
        (np.zeros((5, 3)), [(0, 2)]),
        (np.full((4, 3), np.nan), [(0, 2)]),
        (np.zeros((4, 3)), [(0, 2)]),
        (np.eye(4, 3), [(0, 1)]),
        (np.eye(4, 3), [(0, 4)]),
    ],
)
def test_bad_input_says_what_is_wrong(p_WE: np.ndarray, cables: list[tuple[int, int]]) -> None:
    """Odd caps, NaN, rods without length, cables on one rod or to nowhere: an input error with place and hint."""
    with pytest.raises(InputError) as caught:
        attach(p_WE, cables, RADIUS)
    assert caught.value.where
    assert caught.value.hint


def test_unknown_mode_is_a_usage_error() -> None:
    """An unknown attachment names the two that exist."""
    with pytest.raises(UsageError, match="surface or rod_end"):
        attach(FACTS["threebar"].rest_caps(), PRISM_CABLES, RADIUS, "glue")  # type: ignore[arg-type]


def test_picture_shows_the_sites() -> None:
    """The picture is a PNG, the same for the same sites and another for other sites."""
    facts, p_WE, found, p_WS = derived("threebar")
    labels = paper_labels(found, facts.cables)

    def draw(points: np.ndarray) -> bytes:
        return attachment_png(p_WE, facts.cables, 6, RADIUS, {"surface": points}, labels)

    png = draw(p_WS)
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    assert draw(p_WS) == png
    assert draw(p_WS + np.array([0, 0, 0.01])) != png
