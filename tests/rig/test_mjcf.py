"""The MJCF text: it compiles, holds the robot's own numbers to the last digit, and needs no MuJoCo to be written."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import mujoco
import numpy as np
import pytest

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.rig.model import Options, body_of, mjcf, rest_pose
from r2s2r_cli.rig.model.frames import cap_spans, rotation
from r2s2r_cli.rig.model.mjcf_text import winch_range, winch_speed
from r2s2r_cli.rig.model.sim import build
from r2s2r_cli.stages.model import parameters_of
from r2s2r_cli.store.toml import check_model
from schemas.robot import Robot
from tests.support.rig_robots import known, values

ROBOTS = ["threebar", "threebar-330", "sixbar"]
FIELDS = (
    "qpos0", "body_mass", "body_inertia", "body_ipos", "body_iquat", "geom_size", "geom_pos", "geom_friction",
    "geom_solref", "geom_solimp", "geom_contype", "site_pos", "tendon_stiffness", "tendon_stiffnesspoly",
    "tendon_lengthspring", "actuator_gainprm", "actuator_biasprm", "actuator_ctrlrange", "actuator_trnid", "key_ctrl",
)  # fmt: skip


@pytest.mark.parametrize("name", ROBOTS)
def test_the_model_holds_the_numbers_of_robot_toml(name: str) -> None:
    """Masses, inertias, sites, cap radii and cable laws survive the way through the text without losing a bit."""
    robot = known(name)
    model = build(robot)
    for i, rod in enumerate(robot.rods):
        body, link = body_of(rod), model.body(f"rod_{rod.name}")
        assert link.mass[0] == body.mass
        np.testing.assert_allclose(np.sort(link.inertia), np.sort(body.inertia), rtol=1e-12)
        np.testing.assert_array_equal(link.ipos, body.p_RB)
        for cap, side in ((2 * i, -1), (2 * i + 1, 1)):
            np.testing.assert_array_equal(model.geom(f"cap{cap}").pos, [0, 0, side * rod.length_m / 2])
            assert model.geom(f"cap{cap}").size[0] == rod.cap_radius_m
    assert model.body_mass.sum() == pytest.approx(sum(p.mass_kg for rod in robot.rods for p in rod.parts), rel=1e-15)
    winched = dict(zip(robot.actuated, rest_pose(robot).rest, strict=True))
    for k, cable in enumerate(robot.cables):
        for cap, site in zip(cable.caps, cable.sites_m, strict=True):
            np.testing.assert_array_equal(model.site(f"cable{k}_cap{cap}").pos, site)
        kind = "winch" if cable.kind == "actuated" else "passive"
        law = model.actuator(f"{kind}{k}").biasprm[:3]
        rest = winched[k] if cable.rest_length_m is None else cable.rest_length_m
        constant = cable.stiffness_n_per_m * rest
        np.testing.assert_array_equal(law, [constant, -cable.stiffness_n_per_m, -cable.damping_n_s_per_m])
    assert model.geom("ground").friction[0] == robot.contact.friction


@pytest.mark.parametrize("name", ROBOTS)
def test_the_text_re_parses_to_the_same_model(name: str) -> None:
    """MuJoCo's own XML of the parsed text compiles to the same numbers, to the digits that it writes."""
    spec = mujoco.MjSpec.from_string(mjcf(known(name)))
    first = spec.compile()
    second = mujoco.MjModel.from_xml_string(spec.to_xml())
    for field in FIELDS:
        np.testing.assert_allclose(getattr(second, field), getattr(first, field), rtol=1e-5, atol=1e-9, err_msg=field)


def test_the_same_robot_gives_the_same_text() -> None:
    """Two writings are equal byte by byte, and short enough to be read."""
    assert mjcf(known()) == mjcf(known())
    assert len(mjcf(known()).splitlines()) < 150


def test_the_text_needs_no_mujoco() -> None:
    """Where MuJoCo is not installed, the text is written all the same."""
    code = (
        "import sys; sys.modules['mujoco'] = None\n"
        "from tests.support.rig_robots import known\nfrom r2s2r_cli.rig.model import mjcf\n"
        "assert mjcf(known()).startswith('<!-- ')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ROBOTS)
def test_winches_have_the_same_range_and_speed_as_in_the_engine(name: str) -> None:
    """Limits of cap distances become the same limits of rest lengths, the motors the same speeds."""
    robot = known(name)
    theta = parameters_of(robot)
    np.testing.assert_allclose(winch_range(robot)[:, 0], theta.rest_min[0], rtol=1e-12)
    np.testing.assert_allclose(winch_range(robot)[:, 1], theta.rest_max[0], rtol=1e-12)
    np.testing.assert_allclose(winch_speed(robot), theta.speed_in[0], rtol=1e-12)


def test_the_rest_pose_is_the_keyframe() -> None:
    """Reset to keyframe `rest`, the caps are those of robot.toml and winched cables, all controls 0, just not taut."""
    robot = known()
    model = build(robot)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("rest").id)
    mujoco.mj_forward(model, data)
    caps = [data.site(f"centre{cap}").xpos for cap in range(6)]
    np.testing.assert_allclose(caps, robot.rest_caps_m, atol=2e-6)  # robot.toml rounds them to the micrometre
    np.testing.assert_allclose(data.actuator_force[:6], 0.0, atol=1e-9)
    np.testing.assert_array_equal(data.ctrl, 0.0)
    pose = rest_pose(robot)
    assert (cap_spans(robot)[:6] > pose.rest).all()
    np.testing.assert_allclose(data.site("centre1").xpos, pose.p_WR[0] + 0.1625 * rotation(pose.q_WR[0])[:, 2])


def test_cubic_passive_cables_and_sensor_tendons_are_springs_with_a_dead_band() -> None:
    """Their three coefficients and rest lengths reach MuJoCo; linear cables beside them stay actuators."""
    robot = values()
    robot["cables"][7] |= {"stiffness2_n_per_m2": 30.0, "stiffness3_n_per_m3": 500.0}
    robot["sensors"][2] |= {"stiffness_n_per_m": 25.0, "rest_length_m": 0.11}
    model = build(Robot.model_validate(robot))
    cubic, sensor = model.tendon("cable7").id, model.tendon("sensor2").id
    assert [model.tendon_stiffness[cubic], *model.tendon_stiffnesspoly[cubic]] == [100.0, 30.0, 500.0]
    assert [model.tendon_stiffness[sensor], *model.tendon_stiffnesspoly[sensor]] == [25.0, 0.0, 0.0]
    np.testing.assert_array_equal(model.tendon_lengthspring[[cubic, sensor]], [[0.0, 0.165], [0.0, 0.11]])
    names = [*(f"winch{k}" for k in range(6)), "passive6", "passive8"]
    assert [model.actuator(i).name for i in range(model.nu)] == names


def test_options_reach_the_model() -> None:
    """Step, gravity, friction, solver and a tilted, shifted ground plane are in the compiled model."""
    options = Options(
        timestep_s=0.002, gravity=(0.0, 1.0, -9.0), friction=0.25, cone="pyramidal", impratio=7.0,
        integrator="implicitfast", ground_normal=(0.0, 3.0, 4.0), ground_offset_m=0.5, rod_friction=0.1,
        rod_contact=False,
    )  # fmt: skip
    model = build(known(), options)
    assert (model.opt.timestep, model.opt.impratio) == (0.002, 7.0)
    assert model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    np.testing.assert_array_equal(model.opt.gravity, [0.0, 1.0, -9.0])
    ground = model.geom("ground")
    assert (ground.friction[0], model.geom("cap0").friction[0]) == (0.25, 0.1)
    np.testing.assert_allclose(ground.pos, [0.0, 0.3, 0.4])
    np.testing.assert_allclose(rotation(np.roll(ground.quat, -1))[:, 2], [0.0, 0.6, 0.8], atol=1e-15)
    assert (model.geom("shaft0").contype[0], model.geom("cap0").contype[0]) == (0, 1)


def test_odd_names_do_not_break_the_text() -> None:
    """Names and titles with the signs of XML are only text."""
    robot = values()
    robot["title"], robot["name"], robot["rods"][0]["name"] = 'a--b & <"c"> --', 'x"&<y', 'r "&> d'
    robot["colors"] = []
    model = build(Robot.model_validate(robot))
    assert model.body('rod_r "&> d').id == 1


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("rods", 1, "parts", 0, "mass_kg"), 0.0, "rods.1.parts.0.mass_kg"),
        (("rods", 0, "length_m"), 0.0, "rods.0.length_m"),
        (("cables", 3, "stiffness_n_per_m"), -1.0, "cables.3.stiffness_n_per_m"),
        (("cables", 3, "caps"), [0, 1], "a cable must join two rods, caps (0, 1) lie on one"),
        (("contact", "friction"), float("nan"), "contact.friction"),
    ],
)
def test_robots_that_cannot_be_are_refused_by_the_schema(path: tuple[Any, ...], value: object, says: str) -> None:
    """Zero mass, no length, negative stiffness, a cable on one rod, NaN: the error names the key."""
    robot = values()
    place: Any = robot
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises(InputError) as caught:
        check_model(robot, Robot, "robot.toml")
    assert says in str(caught.value)


def test_a_winched_cubic_cable_is_refused() -> None:
    """MuJoCo's actuators are linear: the error names the cable and the two keys."""
    robot = values()
    robot["cables"][4]["stiffness3_n_per_m3"] = 10.0
    with pytest.raises(InputError, match="no winched cable with a cubic law, and cable 4 is one") as caught:
        mjcf(Robot.model_validate(robot))
    assert "stiffness3_n_per_m3" in caught.value.expected


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("timestep_s", 0.0), ("impratio", -1.0), ("contact_time_s", 0.0), ("friction", -0.1), ("rod_friction", -0.1),
        ("restitution", 1.5), ("ground_normal", (0.0, 0.0, 0.0)), ("ground_offset_m", float("inf")),
        ("gravity", (0.0, 0.0, float("nan"))), ("timestep_s", float("nan")),
        ("cone", "round"), ("integrator", "RK4"), ("impedance", (0.9, 1.5, 0.001)),
    ],
)  # fmt: skip
def test_options_that_cannot_be_are_refused(name: str, value: Any) -> None:
    """Each wrong option is named."""
    with pytest.raises(UsageError) as caught:
        Options(**{name: value})
    assert name in caught.value.where
