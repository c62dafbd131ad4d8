"""The laws of the rig against closed forms, and apart from the catalogue of `diagnose`."""

from __future__ import annotations

import ast
from pathlib import Path

import mujoco
import numpy as np
import pytest

import r2s2r_cli.effects
import r2s2r_cli.rig
from r2s2r_cli.rig.effects.base import Law, Scene
from r2s2r_cli.rig.effects.battery import BatterySag
from r2s2r_cli.rig.effects.cables import CapstanFriction
from r2s2r_cli.rig.effects.friction import Soles
from r2s2r_cli.rig.effects.motors import CommandLatency, LoadDroop, MotorDeadZone, MotorLag
from r2s2r_cli.rig.effects.parameters import Effects
from r2s2r_cli.rig.effects.winches import Backlash, SpoolBuildup
from r2s2r_cli.rig.model.sim import MujocoSim
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World
from tests.support.rig_robots import known, two_rods

DT = 0.001
NONE = np.zeros(6)

STARRED = {
    "motor_dead_zone", "command_latency", "motor_lag", "motor_speed_mismatch", "battery_sag", "load_droop",
    "spool_buildup", "backlash", "tendon_stiffness", "tendon_relaxation", "tendon_set", "com_offset", "payload",
    "friction_field", "rolling_resistance", "soft_ground", "cap_friction", "cap_radius", "ground_slope", "tether_drag",
    "sensor_bias", "sensor_gain", "camera_pose", "camera_scale", "camera_delay",
}  # fmt: skip
"""The effects of the first release."""

OTHERS = {
    "tendon_hysteresis", "capstan_friction", "attachment_offset", "friction_anisotropy", "stribeck", "viscous_contact",
    "obstacle", "air_drag", "sensor_saturation", "dropout",
}  # fmt: skip
"""The rest of the catalogue."""


def scene() -> Scene:
    """A robot to make laws with that do not touch its model."""
    robot = known()
    return Scene(robot, MujocoSim(robot), np.full(6, 0.0035), np.random.default_rng(0))


SCENE = scene()


def world(**effects: object) -> World:
    """A world with effects, settled quickly."""
    return World.model_validate({"effects": effects, "start": {"settle_s": 0.2}})


def test_every_effect_of_the_first_release_is_there() -> None:
    """The 25 starred ids of the design, the other ten, and no id that the design does not have."""
    assert set(Effects.model_fields) == STARRED | OTHERS


def test_nothing_is_shared_with_the_catalogue() -> None:
    """No file of the rig imports the catalogue or the engine, and no file of the catalogue imports the rig."""
    for package, forbidden in (
        (r2s2r_cli.rig, ("r2s2r_cli.effects", "r2s2r_cli.engine", "torch")),
        (r2s2r_cli.effects, ("r2s2r_cli.rig", "mujoco")),
    ):
        files = list(Path(str(package.__path__[0])).rglob("*.py"))
        assert files
        for path in files:
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
                names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
                assert not [name for name in names if name.startswith(forbidden)], path


def test_no_function_is_a_copy_of_the_catalogues() -> None:
    """No function of the rig's effects has the same body as one of the catalogue."""

    def bodies(package: object) -> set[str]:
        found = set()
        for path in Path(str(package.__path__[0])).rglob("*.py"):  # type: ignore[attr-defined]
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.FunctionDef):
                    code = [part for part in node.body if not isinstance(getattr(part, "value", None), ast.Constant)]
                    text = "\n".join(ast.dump(part) for part in code)
                    if len(text) > 200:
                        found.add(text)
        return found

    import r2s2r_cli.rig.effects as rig_effects

    assert not bodies(rig_effects) & bodies(r2s2r_cli.effects)


@pytest.mark.parametrize(
    ("name", "table"),
    [
        ("motor_dead_zone", {"start": 0.0, "keep": 0.0}),
        ("command_latency", {"delay_s": 0.0}),
        ("motor_lag", {"start_s": 0.0}),
        ("motor_speed_mismatch", {"factors": []}),
        ("battery_sag", {"fall": 0.0, "per_motor": 0.0}),
        ("spool_buildup", {"layer_m": 0.0}),
        ("backlash", {"play_m": 0.0}),
        ("tendon_stiffness", {"factors": []}),
        ("tendon_set", {"lengths_m": []}),
        ("tendon_relaxation", {"fast_share": 0.0, "slow_share": 0.0}),
        ("tendon_hysteresis", {"force_n": 0.0}),
        ("capstan_friction", {"wrap": 0.0}),
        ("cap_radius", {"by_m": []}),
        ("ground_slope", {}),
        ("viscous_contact", {"drag_n_s_per_m": 0.0}),
        ("tether_drag", {"weight_n": 0.0, "largest_n": 0.0}),
        ("sensor_bias", {"lengths_m": []}),
    ],
)
def test_a_law_of_size_0_changes_nothing(name: str, table: dict[str, object]) -> None:
    """The motion under a law of size 0 is the motion without it, but for rounding of numbers that were added to 0."""
    duty = np.array([0.8, 0.0, -0.4, 0.5, 0.0, 0.0])
    caps = []
    for effects in ({}, {name: table}):
        plant = Plant(known(), world(**effects))
        plant.advance(0.2, duty)
        plant.advance(0.1, -duty)
        caps.append(np.append(plant.truth().p_WE, plant.sensed()))
    np.testing.assert_allclose(caps[1], caps[0], atol=1e-9)


def test_dead_zone_has_hysteresis() -> None:
    """A motor starts at the upper threshold and stops at the lower one."""
    law = MotorDeadZone(start=0.2, keep=0.1).law(SCENE)
    seen = [float(law.command(0.0, np.full(6, u))[0]) for u in (0.15, 0.2, 0.15, 0.1, 0.09, 0.15, -0.19, -0.2)]
    assert seen == [0.0, 0.2, 0.15, 0.1, 0.0, 0.0, 0.0, -0.2]


def test_latency_shifts_and_keeps_the_order() -> None:
    """Without jitter every change comes exactly that much later; with it none overtakes another."""
    law = CommandLatency(delay_s=0.1).law(SCENE)
    out = [float(law.command(k * 0.01, np.full(6, float(k // 7)))[0]) for k in range(60)]
    assert out[10:] == [float(k // 7) for k in range(50)]
    law = CommandLatency(delay_s=0.02, jitter_s=0.05).law(SCENE)
    late = [float(law.command(k * 0.01, np.full(6, float(k)))[0]) for k in range(200)]
    assert (np.diff(late) >= 0).all()
    assert np.mean(np.arange(50, 200) - late[50:]) > 7


def test_lag_is_the_exact_exponential() -> None:
    """After one time constant a step has come to 1 - 1/e, whatever the step of time; it stops with its own."""
    for n in (1, 10, 100):
        law = MotorLag(start_s=0.2, stop_s=0.05).law(SCENE)
        for _ in range(n):
            w = law.turn(0.2 / n, np.full(6, 10.0), NONE)
        np.testing.assert_allclose(w, 10 * (1 - np.exp(-1)), rtol=1e-12)
        np.testing.assert_allclose(law.turn(0.05, NONE, NONE), w * np.exp(-1), rtol=1e-12)


def test_droop_stalls_at_its_tension() -> None:
    """Half the stall tension is half the speed, the stall tension is none; letting out, it helps."""
    law = LoadDroop(stall_n=20.0, help_share=0.3).law(SCENE)
    tension = np.array([0.0, 10.0, 20.0, 30.0, 10.0, 10.0])
    w = law.turn(DT, np.array([5.0, 5.0, 5.0, 5.0, -5.0, 0.0]), tension)
    np.testing.assert_allclose(w, [5.0, 2.5, 0.0, 0.0, -5.75, 0.0])


def test_battery_falls_with_the_square_of_the_charge() -> None:
    """Half the charge gone costs a quarter of the fall, all of it all, and never more."""
    law = BatterySag(motor_s=10.0, fall=0.4, per_motor=0.0).law(SCENE)
    one = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert law.volts(5.0, 1.0, one) == pytest.approx(1 - 0.4 / 4)
    assert law.volts(5.0, 1.0, one) == pytest.approx(0.6)
    assert law.volts(50.0, 1.0, one) == pytest.approx(0.6)


def test_a_spool_grows_by_one_layer_a_layer() -> None:
    """After n full layers the radius is n layers larger, and it never falls while the spool winds."""
    law = SpoolBuildup(layer_m=0.0005, wraps=2.0).law(SCENE)
    angles = np.linspace(0, 8 * 2 * np.pi, 801)
    r = np.array([law.radius(np.full(6, a), SCENE.r)[0] for a in angles])
    np.testing.assert_allclose(r[[0, 200, 400, 600, 800]] - 0.0035, 0.0005 * np.arange(5), atol=1e-12)
    assert (np.diff(r) >= -1e-15).all()


def test_backlash_loses_its_play_at_every_reversal() -> None:
    """Winding in and out by more than the play moves the cable by that much less, and out again it comes back."""
    law = Backlash(play_m=0.006, soft_share=0.0).law(SCENE)
    way = np.concatenate([np.linspace(0.2, 0.15, 500), np.linspace(0.15, 0.2, 500)])
    out = np.array([law.rest(DT, np.full(6, rest), NONE)[0] for rest in way])
    assert out[0] == pytest.approx(0.2)
    assert out[499] == pytest.approx(0.15 + 0.006, abs=2e-4)
    assert out[-1] == pytest.approx(0.2, abs=2e-4)
    soft = Backlash(play_m=0.006, soft_share=1.0).law(SCENE)
    smooth = np.array([soft.rest(DT, np.full(6, rest), NONE)[0] for rest in way])
    assert np.abs(np.diff(smooth, n=2))[:498].max() < np.abs(np.diff(out, n=2))[:498].max() / 3


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


def test_effects_of_the_camera_reach_its_settings() -> None:
    """Each changes what it says, keeps the rest, and leaves the table as it was."""
    world_ = world(
        camera_pose={"turn_rad": [0, 0, 0.1], "at_s": 3.0}, camera_scale={"depth_error": 0.03},
        camera_delay={"delay_s": 0.07}, dropout={"frames": 0.5},
    )  # fmt: skip
    seen = world_.seen()
    assert (seen.turn_rad, seen.knocked_at_s, seen.depth_error) == ((0.0, 0.0, 0.1), 3.0, 0.03)
    assert (seen.clock.stamp_delay_s, seen.clock.lost_share) == (0.07, 0.5)
    assert seen.clock.rate_hz == world_.camera.clock.rate_hz
    assert world_.camera.clock.stamp_delay_s == 0.0


def test_a_law_without_hooks_is_no_law() -> None:
    """The base class passes everything on."""
    law, x = Law(), np.arange(6.0)
    for out in (
        law.command(0, x),
        law.turn(DT, x, x),
        law.radius(x, x),
        law.rest(DT, x, x),
        law.friction(x),
        law.sense(0, x),
    ):
        assert out is x
    assert law.volts(DT, 0.7, x) == 0.7
