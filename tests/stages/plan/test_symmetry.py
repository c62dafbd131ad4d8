"""The symmetry group of a robot: group axioms, the published maps, poses mapped back, and the engine itself."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import Parameters, State, end_caps
from r2s2r_cli.engine.closed_loop import closed_loop
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.plan.placement import Reference, reference_of, turned, wrapped
from r2s2r_cli.stages.plan.symmetry import Symmetry, SymmetryGroup, principal_axis, support_caps, symmetry_group
from schemas.robot import Robot
from tests.support.robots import Subject, subject

PUBLISHED: dict[tuple[int, ...], tuple[int, ...]] = {
    (0, 2, 5): (0, 1, 2, 3, 4, 5), (0, 3, 5): (0, 1, 2, 3, 4, 5), (1, 2, 4): (1, 2, 0, 4, 5, 3),
    (1, 2, 5): (1, 2, 0, 4, 5, 3), (0, 3, 4): (2, 0, 1, 5, 3, 4), (1, 3, 4): (2, 0, 1, 5, 3, 4),
}  # fmt: skip
"""By bottom triangle: motor k takes the target of this motor of the policy as written (public host of the robot)."""


@pytest.fixture(scope="module", params=["threebar", "sixbar"])
def case(request: pytest.FixtureRequest) -> tuple[Robot, SymmetryGroup]:
    """A robot and its group."""
    robot = subject(request.param).robot
    return robot, symmetry_group(robot)


def reverses(one: Symmetry) -> list[bool]:
    """Of each rod, whether its even cap takes the place of an odd one."""
    return [one.caps[2 * rod] % 2 == 1 for rod in range(len(one.rods))]


def orders(group: SymmetryGroup) -> list[int]:
    """How often each element must be done until nothing has changed, sorted."""
    found = []
    for k in range(len(group)):
        power, at = 1, k
        while at != 0:
            power, at = power + 1, group.product(at, k)
        found.append(power)
    return sorted(found)


def test_the_prism_has_the_dihedral_group_and_the_six_bar_the_tetrahedral_one() -> None:
    """D3: the identity, three half-turns, two turns by a third. T: three half-turns and eight thirds. No others."""
    assert orders(symmetry_group(subject("threebar").robot)) == [1, 2, 2, 2, 3, 3]
    assert orders(symmetry_group(subject("sixbar").robot)) == [1, *[2] * 3, *[3] * 8]


def test_group_axioms(case: tuple[Robot, SymmetryGroup]) -> None:
    """The first is the identity; every product and inverse is there; permutations of all parts follow the product."""
    robot, group = case
    assert group.elements[0].caps == tuple(range(robot.n_caps))
    for a, b in product(range(len(group)), repeat=2):
        c = group.elements[group.product(a, b)]
        one, two = group.elements[a], group.elements[b]
        for name in ("caps", "rods", "cables", "motors"):
            first, then = getattr(one, name), getattr(two, name)
            assert getattr(c, name) == tuple(then[i] for i in first)
        assert np.allclose(c.turn, two.turn @ one.turn, atol=1e-4)
    for k in range(len(group)):
        assert group.product(k, group.inverse(k)) == 0


def test_parts_go_where_their_caps_go(case: tuple[Robot, SymmetryGroup]) -> None:
    """Rods, cables and motors of the image join the images of the caps; every turn is the proper rotation there."""
    robot, group = case
    p = np.array(robot.rest_caps_m)
    p = p - p.mean(axis=0)
    for g in group.elements:
        assert np.allclose(g.turn @ g.turn.T, np.eye(3)) and np.isclose(np.linalg.det(g.turn), 1)
        assert np.allclose(p[list(g.caps)], p @ g.turn.T, atol=5e-6)
        for k, cable in enumerate(robot.cables):
            assert set(robot.cables[g.cables[k]].caps) == {g.caps[i] for i in cable.caps}
        for k, cable_number in enumerate(robot.actuated):
            assert robot.actuated[g.motors[k]] == g.cables[cable_number]


def test_the_published_maps_of_the_three_bar_robot() -> None:
    """Triangles of one type: turns from (0, 2, 5) and from (0, 3, 5) relabel targets as the authors' table does."""
    robot = subject("threebar").robot
    group = symmetry_group(robot)
    for start in ((0, 2, 5), (0, 3, 5)):
        turns = [g for g in group.elements if not any(reverses(g))]
        seen = {tuple(sorted(g.caps[i] for i in start)): g for g in turns}
        assert len(seen) == 3
        for triangle, g in seen.items():
            assert g.relabelled(np.arange(6)).tolist() == list(PUBLISHED[triangle])
    # Every triangle of the table is reached from the rest triangle, each by one element.
    assert sorted(group.supports((0, 2, 5))) == sorted(PUBLISHED)


def test_a_robot_with_one_odd_part_has_fewer_symmetries() -> None:
    """Another stiffness of one passive tendon leaves its own half-turn, a heavier rod its own too; both different
    nothing but the identity."""
    robot = subject("threebar").robot
    cables = list(robot.cables)
    cables[6] = cables[6].model_copy(update={"stiffness_n_per_m": 2 * cables[6].stiffness_n_per_m})
    odd = robot.model_copy(update={"cables": tuple(cables)})
    assert orders(symmetry_group(odd)) == [1, 2]
    parts = tuple(part.model_copy(update={"mass_kg": 2 * part.mass_kg}) for part in robot.rods[1].parts)
    heavy = (robot.rods[0], robot.rods[1].model_copy(update={"parts": parts}), robot.rods[2])
    assert orders(symmetry_group(robot.model_copy(update={"rods": heavy}))) == [1, 2]
    assert orders(symmetry_group(odd.model_copy(update={"rods": heavy}))) == [1]


def test_a_mirror_is_no_symmetry() -> None:
    """The prism mirrored has the same distances between caps, and its own group; never one element more."""
    robot = subject("threebar").robot
    mirrored = tuple((x, -y, z) for x, y, z in robot.rest_caps_m)
    assert len(symmetry_group(robot.model_copy(update={"rest_caps_m": mirrored}))) == 6


def test_nearly_symmetric_is_said() -> None:
    """A tolerance that joins some of the parts and not all of them leaves no group: an error, never a guess."""
    robot = subject("threebar").robot
    cables = list(robot.cables)
    for k, factor in ((6, 1.0), (7, 1.08), (8, 1.16)):
        cables[k] = cables[k].model_copy(update={"stiffness_n_per_m": factor * cables[k].stiffness_n_per_m})
    with pytest.raises(InputError, match="no group"):
        symmetry_group(robot.model_copy(update={"cables": tuple(cables)}))


def test_cables_side_by_side_change_places_one_by_one() -> None:
    """A second cable beside each, of its kind or passive beside a winched one: the same symmetries, and each motor,
    cable and target goes to one of its own."""
    robot = subject("threebar").robot
    plain = symmetry_group(robot)
    doubled = robot.cables + robot.cables
    passive = next(one for one in robot.cables if one.kind != robot.cables[robot.actuated[0]].kind)
    beside = tuple(passive.model_copy(update={"caps": robot.cables[k].caps}) for k in robot.actuated)
    for cables in (doubled, robot.cables + beside):
        wide = robot.model_copy(update={"cables": tuple(
            one.model_copy(update={"name": f"c{k}"}) for k, one in enumerate(cables)
        )})  # fmt: skip
        group = symmetry_group(wide)
        assert [one.caps for one in group.elements] == [one.caps for one in plain.elements]
        assert group.elements[0].cables == tuple(range(len(cables)))
        motors = len(wide.actuated)
        for element in group.elements:
            assert sorted(element.motors) == list(range(motors))
            assert sorted(element.relabelled(np.arange(motors, dtype=float)).tolist()) == list(range(motors))


def test_after_which_symmetries_there_is_no_heading() -> None:
    """Those of the prism all have one; three of the twelve of a robot of six bars do not."""
    assert three_bar().upright() == 0
    robot = subject("sixbar").robot
    assert reference_of(np.array(robot.rest_caps_m), symmetry_group(robot)).upright() == 3


def three_bar() -> Reference:
    """The reference of the paper's robot."""
    robot = subject("threebar").robot
    return reference_of(np.array(robot.rest_caps_m), symmetry_group(robot))


def lying_as(reference: Reference, k: int, xy: np.ndarray, yaw: float) -> np.ndarray:
    """Caps (cap, 3) of the robot that has undergone element k: cap i's place in the reference is taken by caps[i]."""
    flat = turned(reference.p[:, :2], yaw) + xy
    p_WE = np.empty_like(reference.p)
    p_WE[list(reference.group.elements[k].caps)] = np.concatenate([flat, reference.p[:, 2:]], axis=1)
    return p_WE


def test_every_pose_is_mapped_back() -> None:
    """Planted element, place and direction come back from end caps with noise, on all six triangles of the prism; on
    the triangle that the element says."""
    reference, generator = three_bar(), np.random.default_rng(0)
    for k in range(6):
        xy, yaw = generator.normal(size=2), float(generator.uniform(-np.pi, np.pi))
        p_WE = lying_as(reference, k, xy, yaw)
        found = reference.place((p_WE + 1e-4 * generator.normal(size=p_WE.shape))[None])
        assert found.element.tolist() == [k]
        assert np.allclose(found.xy, xy, atol=3e-4) and abs(wrapped(found.yaw[0] - yaw)) < 3e-3
        assert support_caps(p_WE) == reference.group.supports(reference.support)[k]
        # A half-turn points the principal axis the other way: forward and backward change places.
        axis = turned(principal_axis(p_WE)[:2], -yaw)
        assert np.sign(axis[0]) == (-1 if any(reverses(reference.group.elements[k])) else 1)


def test_an_upright_axis_has_no_direction() -> None:
    """A robot whose principal axis stands upright is refused: it has no heading."""
    p = np.array([[0, 0, 0.0], [0, 0, 1], [1, 0, 0], [1, 0, 1], [0, 1, 0], [0, 1, 1]])
    with pytest.raises(InputError, match="no direction"):
        reference_of(p, three_bar().group)


# The engine: a renamed robot with a renamed policy moves as before, renamed.


def alike(s: Subject) -> Parameters:
    """The parameters with those of parts that symmetry makes equal equal to rounding."""
    theta = s.theta
    means = {name: getattr(theta, name).mean() + 0 * getattr(theta, name) for name in ("rest_min", "rest_max")}
    return replace(theta, **means)


def renamed(s: State, g: Symmetry) -> State:
    """The state after rods, caps and cables have changed places; a rod that is reversed has its frame turned by pi
    about its own x axis. For cables that end on the rods' axes."""
    rods = torch.tensor(np.argsort(g.rods))
    flip = torch.tensor([[1.0, 0, 0, 0] if back else [0, 0, 0, 1.0] for back in reverses(g)], dtype=torch.float64)
    x, y, z, w = s.q_WR.unbind(-1)
    turned_q = torch.stack([w, z, -y, -x], dim=-1)  # q (1, 0, 0, 0)
    back = flip[:, 0] > 0
    q = torch.where(back[:, None], turned_q, s.q_WR)
    w_R = torch.where(back[:, None], s.w_R * torch.tensor([1.0, -1, -1], dtype=torch.float64), s.w_R)
    winches = torch.tensor(np.argsort(g.motors))
    return State(s.p_WB[:, rods], q[:, rods], s.v_WB[:, rods], w_R[:, rods], s.rest[:, winches], s.winding[:, winches])


@pytest.mark.parametrize("k", [pytest.param(1, marks=pytest.mark.slow), pytest.param(2, marks=pytest.mark.slow), 5])
def test_the_engine_knows_the_symmetries(k: int) -> None:
    """simulate(relabel(policy, g)) from g(pose) = g(simulate(policy)): turns and half-turns of the prism, the robot's
    controller included, to the accuracy of the contact solver; what moves, moves by centimetres."""
    s = subject("threebar", "rod_end")
    g, theta = symmetry_group(s.robot).elements[k], alike(s)
    start = s.settle(s.p_WE).state
    targets = np.array([[1.0, 0, 1, 1, 0, 1], [0.5, 1, 1, 0, 1, 1]])
    holds, timeouts = torch.zeros(2, dtype=torch.float64), torch.full((2,), 3.0, dtype=torch.float64)

    def end(state: State, goals: np.ndarray) -> torch.Tensor:
        run = closed_loop(s.simulator, theta, state, s.pid(), torch.as_tensor(goals), holds, timeouts)
        assert not bool(run.timed_out.any())
        return end_caps(theta, run.trajectory.at(-1))[0]

    one, other = end(start, targets), end(renamed(start, g), g.relabelled(targets))
    assert float((other[list(g.caps)] - one).abs().max()) < 1e-6
    assert float((one - end_caps(theta, start)[0]).abs().max()) > 0.03
