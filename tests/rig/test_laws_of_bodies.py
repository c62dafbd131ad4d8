"""The laws of the rig's bodies, contacts and floor against closed forms."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from r2s2r_cli.rig.effects.base import Scene
from r2s2r_cli.rig.effects.cables import CapstanFriction
from r2s2r_cli.rig.effects.friction import Soles
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from tests.support.rig_laws import DT, SCENE, world
from tests.support.rig_robots import known, two_rods


def test_payload_is_the_parallel_axis_theorem() -> None:
    """Mass, centre and inertia of MuJoCo's body are those of rod and point mass together."""
    at, m = np.array([0.01, -0.02, 0.1]), 0.05
    plain, heavy = (
        Plant(known(), world(**e)).sim.model for e in ({}, {"payload": {"rod": 1, "mass_kg": m, "at_m": at.tolist()}})
    )
    body = plain.body("rod_green").id
    M, I0 = plain.body_mass[body], np.diag(plain.body_inertia[body])
    assert heavy.body_mass[body] == pytest.approx(M + m)
    np.testing.assert_allclose(heavy.body_ipos[body], m * at / (M + m), atol=1e-15)
    reduced = M * m / (M + m)
    expected = I0 + reduced * (at @ at * np.eye(3) - np.outer(at, at))
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, heavy.body_iquat[body])
    R = flat.reshape(3, 3)
    np.testing.assert_allclose(R @ np.diag(heavy.body_inertia[body]) @ R.T, expected, atol=1e-12)


def test_rolling_resistance_has_the_distance_of_its_lever_arm() -> None:
    """A rolling rod stops after v^2 (1 + I / m r^2) / (2 g d / r), d the lever arm."""
    robot, v, d = two_rods(friction=0.8), 0.3, 0.001
    plant = Plant(robot, world(rolling_resistance={"rolling_m": d, "turning_m": 0.0}))
    model, r = plant.sim.model, robot.rods[0].cap_radius_m
    for i in range(2):
        plant.sim.data.qvel[6 * i + 1] = v
        plant.sim.data.qvel[6 * i + 5] = -v / r
    start = plant.truth().p_WR[:, 1]
    plant.advance(3.0, np.zeros(0))
    went = plant.truth().p_WR[:, 1] - start
    share = model.body_inertia[1].min() / (model.body_mass[1] * r * r)
    np.testing.assert_allclose(went, v**2 * (1 + share) / (2 * 9.81 * d / r), rtol=0.05)


def test_friction_field_has_the_deceleration_of_its_patch() -> None:
    """Two rods that slide along their axis on a patch of factor 0.25 slide four times as far, v^2 / (2 g mu)."""
    robot, v = two_rods(friction=0.4), 0.5
    for factor in (1.0, 0.25):
        patch = {"center_m": [0.0, 0.0], "radius_m": 2.0, "factor": factor}
        plant = Plant(robot, world(friction_field={"patches": [patch]}))
        plant.sim.data.qvel[0::6] = v
        start = plant.truth().p_WR[:, 0]
        plant.advance(1.0, np.zeros(0))
        np.testing.assert_allclose(plant.truth().p_WR[:, 0] - start, v**2 / (2 * 9.81 * 0.4 * factor), rtol=0.04)


def test_a_carpet_slides_by_its_direction() -> None:
    """Along the pile, across it, with the nap and against it: mu times 1 -+ across, -+ against, v^2 / (2 g mu)."""
    robot, v, across, against = two_rods(friction=0.4), 0.5, 0.3, 0.2
    table = {"friction_anisotropy": {"angle_rad": 0.0, "across": across, "against": against}}
    for way, factor in ((1.0, 1 - across - against), (-1.0, 1 - across + against)):
        plant = Plant(robot, world(**table))
        plant.sim.data.qvel[0::6] = way * v
        start = plant.truth().p_WR[:, 0]
        plant.advance(0.5, np.zeros(0))
        went = way * (plant.truth().p_WR[:, 0] - start)
        np.testing.assert_allclose(went, v**2 / (2 * 9.81 * 0.4 * factor), rtol=0.05)


def test_a_rolling_cap_does_not_slip() -> None:
    """The point that touches stands still under a rod that rolls, and has the rod's speed under one that slides."""
    robot = two_rods()
    plant = Plant(robot, world())
    soles = Soles(Scene(robot, plant.sim, np.zeros(0), np.random.default_rng(0)))
    plant.sim.data.qvel[1::6] = 0.3
    np.testing.assert_allclose(soles.velocity(), np.tile([0.0, 0.3, 0.0], (4, 1)), atol=1e-3)
    plant.sim.data.qvel[5::6] = -0.3 / robot.rods[0].cap_radius_m
    np.testing.assert_allclose(soles.velocity(), 0.0, atol=2e-3)


def test_capstan_friction_keeps_its_share() -> None:
    """Reeling in, the cable gets exp(-wrap) of what the winch pulls; letting out, exp(wrap); at rest as it was."""
    law = CapstanFriction(wrap=0.3, length_m=0.001).law(SCENE)
    k, pull, rest = 2000.0, 6.0, 0.2
    for way in (1.0, -1.0):
        by = np.zeros(6)
        for _ in range(400):
            rest -= way * 5e-5
            # The winch pulls with `pull`; what arrives is less by what the cable is held back.
            arrives = np.full(6, pull) - k * by
            by = law.rest(DT, np.full(6, rest), arrives) - rest
        np.testing.assert_allclose(pull - k * by, pull * np.exp(-0.3 * way), rtol=1e-3)
        before = by.copy()
        np.testing.assert_allclose(law.rest(DT, np.full(6, rest), pull - k * by) - rest, before, atol=1e-9)


def test_a_slope_pushes_with_g_sin() -> None:
    """Two rods on a frictionless slope accelerate along it with g sin(angle)."""
    robot, angle = two_rods(friction=0.0), 0.04
    world_ = World.model_validate({"effects": {"ground_slope": {"angle_y_rad": angle}}, "start": {"settle_s": 0.0}})
    plant = Plant(robot, world_)
    plant.advance(0.2, np.zeros(0))
    before = plant.truth().v_WR
    plant.advance(0.5, np.zeros(0))
    a = (plant.truth().v_WR - before)[0] / 0.5
    downhill = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    assert a @ downhill == pytest.approx(9.81 * np.sin(angle), rel=0.01)


def test_the_camera_sees_the_floor_as_it_lies() -> None:
    """The normal that the camera is told is that of MuJoCo's plane."""
    world_ = world(ground_slope={"angle_x_rad": 0.03, "angle_y_rad": -0.05})
    model = Plant(known(), world_).sim.model
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, model.geom_quat[model.geom("ground").id])
    np.testing.assert_allclose(world_.seen().floor_normal, flat.reshape(3, 3)[:, 2], atol=1e-12)


def test_a_ridge_holds_a_cap_up_and_is_seen() -> None:
    """A cap at rest on the ridge is carried by it: its centre is the sum of both radii from the bar's axis, the force
    is counted, and the camera has the same bar, also on a slope."""
    robot = two_rods(friction=1.0)
    half, r, h = robot.rods[0].length_m / 2, robot.rods[0].cap_radius_m, 0.01
    bar = {"from_m": [half, -0.5], "to_m": [half, 0.5], "height_m": h}
    world_ = World.model_validate({"effects": {"obstacle": bar}, "start": {"settle_s": 1.0}})
    plant = Plant(robot, world_)
    truth = plant.truth()
    assert truth.contact.all()
    np.testing.assert_allclose(np.linalg.norm(truth.p_WE[[1, 3]][:, [0, 2]] - [half, 0.0], axis=1), r + h, atol=3e-4)
    assert truth.force[:, 2].sum() == pytest.approx(9.81 * plant.sim.model.body_mass.sum(), rel=0.05)
    (seen,) = world_.seen().occluders
    assert (seen.a_m, seen.b_m, seen.radius_m) == ((half, -0.5, 0.0), (half, 0.5, 0.0), h)
    tilted = world(ground_slope={"angle_y_rad": 0.1}, obstacle=bar)
    model = Plant(robot, tilted).sim.model
    (seen,) = tilted.seen().occluders
    middle = (np.array(seen.a_m) + np.array(seen.b_m)) / 2
    np.testing.assert_allclose(model.geom_pos[model.geom("ridge0").id], middle, atol=1e-12)
    assert middle @ np.array(tilted.seen().floor_normal) == pytest.approx(0.0, abs=1e-12)
