"""`robot.toml` becomes the engine's structure and numbers."""

from __future__ import annotations

import math
import tomllib
from typing import Any

import numpy as np
import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, cap_lengths, end_caps
from r2s2r_cli.engine.state import cable_ends
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.masses import mass_properties
from r2s2r_cli.stages.init.facts import FACTS
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import REST_MIN, parameters_of, rest_state, structure_of
from schemas.robot import Robot

DATA = tomllib.loads(robot_toml("threebar"))


def robot(**changes: Any) -> Robot:
    """The three-bar robot with tables replaced."""
    return Robot.model_validate({**DATA, **changes})


def changed(table: str, **values: object) -> Robot:
    """The three-bar robot with values changed in the first entry of a list of tables, or in a table."""
    old = DATA[table]
    return robot(**{table: [{**old[0], **values}, *old[1:]] if isinstance(old, list) else {**old, **values}})


def unchecked(field: str, value: float) -> Robot:
    """The three-bar robot with a number of its first cable, rod or contact that the schema would not let pass."""
    good = robot()
    if field in ("friction", "restitution"):
        return good.model_copy(update={"contact": good.contact.model_copy(update={field: value})})
    key = "cables" if field in good.cables[0].model_dump() else "rods"
    items = getattr(good, key)
    return good.model_copy(update={key: (items[0].model_copy(update={field: value}), *items[1:])})


def sites(known: Robot, theta: Parameters, state: State) -> Tensor:
    """Attachment points p_WS [m], (B, cable, 2, 3)."""
    R_WR = roma.unitquat_to_rotmat(state.q_WR)
    rods = cable_ends(structure_of(known), R_WR.device)
    return state.p_WB[:, rods] + torch.einsum("bkeij,bkej->bkei", R_WR[:, rods], theta.p_BS)


@pytest.mark.parametrize("name", FACTS)
def test_every_robot_fits_its_structure(name: str) -> None:
    """Rods, cables and winches of each known robot, at the pose of its file."""
    known = Robot.model_validate(tomllib.loads(robot_toml(name)))
    structure, theta, state = structure_of(known), parameters_of(known), rest_state(known)
    assert (structure.n_rods, structure.n_cables) == (len(known.rods), len(known.cables))
    assert structure.actuated == known.actuated
    assert structure.cable_rods == tuple((a // 2, b // 2) for a, b in (cable.caps for cable in known.cables))
    expected = torch.tensor(known.rest_caps_m, dtype=torch.float64)[None]
    torch.testing.assert_close(end_caps(theta, state), expected, rtol=0, atol=2e-6)
    assert theta.mass.dtype == torch.float64


def test_masses_and_inertia_are_those_of_the_parts() -> None:
    """The parts of a rod add up, about their own centre of mass."""
    theta = parameters_of(robot())
    parts = robot().rods[0].parts
    body = mass_properties(parts)
    assert float(theta.mass[0, 0]) == pytest.approx(sum(part.mass_kg for part in parts))
    assert torch.diagonal(theta.inertia[0, 0]).tolist() == pytest.approx(
        [body.inertia_transverse, body.inertia_transverse, body.inertia_axial]
    )


def test_an_off_centre_part_moves_caps_and_sites_in_the_body_frame() -> None:
    """A point mass at one end: caps and sites are counted from the centre of mass, and stay where they were in W."""
    rod = DATA["rods"][0]
    extra = {"name": "lump", "shape": "point", "mass_kg": 0.05, "offset_m": 0.1}
    heavy = robot(rods=[{**rod, "parts": [*rod["parts"], extra]}, *DATA["rods"][1:]])
    plain = robot()
    theta, before = parameters_of(heavy), parameters_of(plain)
    com = 0.1 * 0.05 / float(theta.mass[0, 0])
    half = rod["length_m"] / 2
    assert theta.p_BE[0, 0, :, 2].tolist() == pytest.approx([-half - com, half - com])
    assert not theta.p_BE[..., :2].any()
    shift = (before.p_BS - theta.p_BS)[0]
    ends = torch.tensor([cable.caps for cable in heavy.cables]) // 2
    expected = torch.where(ends == 0, torch.tensor(com, dtype=torch.float64), 0.0)
    torch.testing.assert_close(shift[..., 2], expected, rtol=0, atol=1e-12)
    torch.testing.assert_close(shift[..., :2], torch.zeros_like(shift[..., :2]))
    for name in ("caps", "sites"):
        where = [
            end_caps(t, rest_state(r)) if name == "caps" else sites(r, t, rest_state(r))
            for t, r in ((theta, heavy), (before, plain))
        ]
        torch.testing.assert_close(where[0], where[1], rtol=0, atol=1e-12)


def test_winches_turn_at_the_speed_of_their_motors() -> None:
    """No-load speed, its share and the drum's radius multiply; every cable has its own motor, whatever their order."""
    motors = [{**motor, "speed": 0.1 * (k + 1)} for k, motor in enumerate(DATA["motors"])]
    theta = parameters_of(robot(motors=motors[::-1]))
    drum = DATA["motors"][0]["no_load_rad_per_s"] * DATA["motors"][0]["winch_radius_m"]
    assert theta.speed_in[0].tolist() == pytest.approx([0.1 * (k + 1) * drum for k in range(6)])
    assert torch.equal(theta.speed_in, theta.speed_out)


def test_winch_limits_are_between_attachment_points() -> None:
    """limits are distances of cap centres: at the rest pose sites are so much closer, and the limits with them."""
    theta, state, known = parameters_of(robot()), rest_state(robot()), robot()
    p_WS = sites(known, theta, state)[0]
    apart = torch.linalg.vector_norm(p_WS[:, 1] - p_WS[:, 0], dim=-1)
    caps = cap_lengths(tuple((a, b) for a, b in (c.caps for c in known.cables)), end_caps(theta, state))[0]
    offset = (apart - caps)[:6]
    assert float(offset.max()) < -0.01
    torch.testing.assert_close(theta.rest_max[0], known.limits.cable_length_max_m + offset, rtol=0, atol=1e-6)
    torch.testing.assert_close(theta.rest_min[0], known.limits.cable_length_min_m + offset, rtol=0, atol=1e-6)
    torch.testing.assert_close(state.rest[0], apart[:6], rtol=0, atol=1e-6)


def test_no_winch_winds_to_nothing() -> None:
    """A least length of a millimetre between caps would be less than nothing between sites."""
    theta = parameters_of(changed("limits", cable_length_min_m=0.001))
    assert theta.rest_min.tolist() == [[REST_MIN] * 6]


def test_cables_at_the_rod_ends() -> None:
    """attachment rod_end: the sites are cap centres, cable lengths distances of caps, and limits unshifted."""
    known = Robot.model_validate(tomllib.loads(robot_toml("threebar", "rod_end")))
    theta, state = parameters_of(known), rest_state(known)
    assert not theta.p_BS[..., :2].any()
    pairs = tuple((a, b) for a, b in (cable.caps for cable in known.cables))
    p_WS = sites(known, theta, state)
    torch.testing.assert_close(torch.linalg.vector_norm(p_WS[:, :, 1] - p_WS[:, :, 0], dim=-1),
                               cap_lengths(pairs, end_caps(theta, state)), rtol=0, atol=2e-6)  # fmt: skip
    assert theta.rest_max[0].tolist() == pytest.approx([known.limits.cable_length_max_m] * 6, abs=2e-6)


def test_laws_are_switched_on_by_the_numbers_that_need_them() -> None:
    """Cubic terms and sensor tendons cost time: only where the file has them."""
    assert not structure_of(robot()).cubic
    assert not structure_of(robot()).tendons
    assert structure_of(changed("cables", stiffness3_n_per_m3=1e4)).cubic
    tendon = changed("sensors", stiffness_n_per_m=30.0, rest_length_m=0.12)
    assert structure_of(tendon).tendons
    theta = parameters_of(tendon)
    k = tendon.sensors[0].cable
    assert (float(theta.tendon_stiffness[0, k]), float(theta.tendon_rest[0, k])) == (30.0, 0.12)
    assert float(theta.tendon_stiffness.sum()) == 30.0


def test_passive_cables_bring_their_rest_lengths() -> None:
    """In the order of the passive cables, stiffness and damping in that of all."""
    cables = [dict(cable) for cable in DATA["cables"]]
    for k, cable in enumerate(cables):
        cable["stiffness_n_per_m"], cable["damping_n_s_per_m"] = 100.0 + k, 1.0 + k
        if cable["kind"] == "passive":
            cable["rest_length_m"] = 0.2 + 0.001 * k
    theta = parameters_of(robot(cables=cables))
    assert theta.rest[0].tolist() == pytest.approx([0.206, 0.207, 0.208])
    assert theta.stiffness[0].tolist() == [100.0 + k for k in range(9)]
    assert theta.damping[0].tolist() == [1.0 + k for k in range(9)]


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("stiffness_n_per_m", -5.0, "stiffness.0"), ("stiffness_n_per_m", math.nan, "stiffness"),
        ("stiffness_n_per_m", 0.0, "stiffness.0"), ("damping_n_s_per_m", -1.0, "damping.0"),
        ("damping_n_s_per_m", math.inf, "damping"), ("friction", -0.1, "friction.0.0"),
        ("restitution", math.nan, "restitution"), ("cap_radius_m", 0.0, "cap_radius.0.0"),
        ("radius_m", -0.01, "rod_radius.0"), ("length_m", 0.0, "p_BE"),
    ],
)  # fmt: skip
def test_numbers_no_robot_has_are_named(field: str, value: float, named: str) -> None:
    """Past the schema, which refuses most of it, the engine names the field, and what it expected."""
    with pytest.raises(InputError) as caught:
        parameters_of(unchecked(field, value))
    assert caught.value.where == f"robot.toml: {named}"
    assert caught.value.expected


def test_the_schema_refuses_a_rod_without_mass() -> None:
    """Zero mass never gets as far as the engine."""
    rod = DATA["rods"][0]
    weightless = [{**part, "mass_kg": 0.0} for part in rod["parts"]]
    with pytest.raises(ValueError, match="mass_kg"):
        robot(rods=[{**rod, "parts": weightless}, *DATA["rods"][1:]])


def test_the_schema_refuses_a_cable_on_one_rod() -> None:
    """Nor does a cable between the two caps of one rod."""
    with pytest.raises(ValueError, match="two rods"):
        changed("cables", caps=[0, 1])


def test_rods_of_points_have_no_axial_inertia() -> None:
    """A rod of nothing but points on its axis cannot be turned about it: named, not divided by."""
    rod = DATA["rods"][0]
    parts = [{"name": str(x), "shape": "point", "mass_kg": 0.05, "offset_m": x} for x in (-0.1, 0.1)]
    with pytest.raises(InputError) as caught:
        parameters_of(robot(rods=[{**rod, "parts": parts}, *DATA["rods"][1:]]))
    assert caught.value.where == "robot.toml: inertia"


def test_a_rest_pose_of_one_point_is_refused() -> None:
    """Two caps of a rod in one place have no direction."""
    caps = np.array(DATA["rest_caps_m"])
    caps[1] = caps[0]
    with pytest.raises(InputError, match="length"):
        rest_state(robot(rest_caps_m=caps.tolist()))
