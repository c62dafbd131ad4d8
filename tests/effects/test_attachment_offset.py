"""Cables that are tied elsewhere: which points move, by what, and that the rest of the robot does not notice."""

from __future__ import annotations

from dataclasses import replace

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects.attachment_offset import AttachmentOffset
from r2s2r_cli.effects.com_offset import ComOffset
from r2s2r_cli.engine import Structure, end_caps, read
from r2s2r_cli.engine.hooks import effective
from tests.support.engine import parameters, roll, threebar
from tests.support.rig_robots import known
from tests.support.variants import Variant, plugged, robot

EFFECT = AttachmentOffset()
BY = torch.tensor([0.004, -0.002, 0.005], dtype=torch.float64)
AXES = ("x_m", "y_m", "axial_m")


def offset(model: Variant, cap: int, by: Tensor) -> Variant:
    """The model with the attachment points of one cap moved [m]."""
    made = plugged(model, EFFECT, on=False)
    values = {f"attachment_offset.{name}": made.theta.extra[f"attachment_offset.{name}"].clone() for name in AXES}
    for name, value in zip(AXES, by.tolist(), strict=True):
        values[f"attachment_offset.{name}"][:, cap] = value
    return replace(made, theta=made.theta.with_values(values))


@pytest.fixture(scope="module")
def plain() -> Variant:
    """The 3-bar robot, a little twisted and tense, so that no cable lies in a plane of symmetry."""
    model = robot()
    turn = roma.rotvec_to_unitquat(torch.tensor([[0.05, -0.02, 0.1], [0.0, 0.07, -0.03], [0.02, 0.0, 0.04]]).double())
    q = roma.quat_product(model.start.q_WR, turn[None])
    return replace(model, start=replace(model.start, q_WR=q, rest=model.start.rest - 0.02))


@pytest.mark.parametrize("name", ["threebar", "sixbar"])
def test_the_points_of_a_cap_move(name: str) -> None:
    """Each cap's number moves the ends that `robot.toml` ties to this cap by the vector, and no other."""
    described, model = known(name, "surface"), robot(name)
    caps = torch.tensor([cable.caps for cable in described.cables])
    for cap in range(2 * model.structure.n_rods):
        moved = offset(model, cap, BY)
        by = effective(moved.structure, moved.theta).p_BS - model.theta.p_BS
        assert torch.allclose(by[0], (caps == cap)[..., None] * BY, rtol=0, atol=1e-16)
        assert bool((caps == cap).any())


def test_it_is_a_robot_described_otherwise(plain: Variant) -> None:
    """It moves as a robot whose description has the points there, bit by bit, and not as the one without."""
    moved = offset(plain, 3, BY)
    ends = torch.tensor([cable.caps for cable in threebar().cables]) == 3
    other = replace(plain.theta, p_BS=plain.theta.p_BS + ends[..., None] * BY)
    ours = roll(moved.structure, moved.theta, moved.start, 20, 1e-3)[-1]
    theirs, nominal = (roll(plain.structure, one, plain.start, 20, 1e-3)[-1] for one in (other, plain.theta))
    assert torch.equal(ours.p_WB, theirs.p_WB)
    assert torch.equal(ours.w_R, theirs.w_R)
    assert float((end_caps(moved.theta, ours) - end_caps(plain.theta, nominal)).abs().max()) > 1e-4


def test_lengths_change_along_the_cable(plain: Variant) -> None:
    """The derivative of a cable's length by an offset is its direction at that end, seen in the axes of the rod; 0 for
    cables of other caps."""
    model = plugged(plain, EFFECT, on=False)
    caps = [cable.caps for cable in threebar().cables]
    R = roma.unitquat_to_rotmat(plain.start.q_WR)[0]
    sites = [[plain.start.p_WB[0, rod] + R[rod] @ plain.theta.p_BS[0, k, side] for side, rod in enumerate(rods)]
             for k, rods in enumerate(plain.structure.cable_rods)]  # fmt: skip
    d = 1e-5
    for cap in range(6):
        for axis in range(3):
            by = d * torch.eye(3, dtype=torch.float64)[axis]
            up, down = (offset(plain, cap, one) for one in (by, -by))
            slope = (
                read(up.structure, up.theta, model.start).length - read(down.structure, down.theta, model.start).length
            )
            expected = torch.zeros(9, dtype=torch.float64)
            for k, ends in enumerate(caps):
                if cap in ends:
                    mine, other = sites[k] if ends[0] == cap else sites[k][::-1]
                    expected[k] = (R[cap // 2].T @ (mine - other))[axis] / torch.linalg.vector_norm(mine - other)
            assert torch.allclose(slope[0] / (2 * d), expected, rtol=0, atol=1e-8)


def test_one_number_of_a_batch(plain: Variant) -> None:
    """Robots that differ in one of the three numbers share the others: each has the points that it has alone."""
    model = offset(plain, 2, BY)
    sizes = (0.0, 0.003, -0.004)
    field = "attachment_offset.axial_m"
    rows = [model.theta.extra[field] + size for size in sizes]
    many = effective(model.structure, model.theta.with_values({field: torch.cat(rows)})).p_BS
    alone = [effective(model.structure, model.theta.with_values({field: row})).p_BS for row in rows]
    assert torch.equal(many, torch.cat(alone))
    assert not torch.equal(many[0], many[1])


def test_no_force_from_nowhere(plain: Variant) -> None:
    """In the air the pulls of all cables cancel wherever they are tied: the centre of mass falls as ever."""
    free = replace(plain, start=replace(plain.start, p_WB=plain.start.p_WB + torch.tensor([0.0, 0.0, 1.0])))
    for cap in (0, 5):
        moved = offset(free, cap, BY)
        after = roll(moved.structure, moved.theta, moved.start, 10, 1e-3)[-1]
        share = moved.theta.mass / moved.theta.mass.sum()
        speed = (share[..., None] * after.v_WB).sum(1)
        assert torch.allclose(speed, 10e-3 * moved.theta.gravity, rtol=0, atol=1e-12)
        assert float((after.v_WB - speed[:, None]).abs().max()) > 1e-3


def test_with_another_centre_of_mass(plain: Variant) -> None:
    """A moved centre of mass leaves points where they are on the rod: both effects act the same in either order."""
    x = {"com_offset.axial_m": torch.tensor([[0.01, -0.02, 0.0]], dtype=torch.float64)}
    x |= {f"attachment_offset.{name}": 0.003 * torch.arange(6, dtype=torch.float64)[None] / 5 for name in AXES}
    ours = []
    for effects in ((EFFECT, ComOffset()), (ComOffset(), EFFECT)):
        model = plugged(plain, *effects, on=False)
        ours.append(roll(model.structure, model.theta.with_values(x), model.start, 10, 1e-3)[-1].p_WB)
    assert torch.equal(*ours)


def test_a_point_in_the_middle_moves_too() -> None:
    """A cable that is tied between the caps moves with the nearer one."""
    structure = Structure(n_rods=2, cable_rods=((0, 1),), actuated=())
    points = torch.tensor([[[0.01, 0.0, 0.02], [0.01, 0.0, -0.02]]], dtype=torch.float64)
    bare = parameters(structure, p_BS=points)
    structure = structure.with_effects(EFFECT)
    extra = {f"attachment_offset.{name}": torch.zeros(1, 4, dtype=torch.float64) for name in AXES}
    extra["attachment_offset.axial_m"] = torch.tensor([[0.001, 0.002, 0.003, 0.004]], dtype=torch.float64)
    found = effective(structure, bare.with_values(extra)).p_BS
    assert (found - bare.p_BS)[0, 0, :, 2].numpy() == pytest.approx([0.002, 0.003], abs=1e-15)
