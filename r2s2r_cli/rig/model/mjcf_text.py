"""`robot.toml` -> MJCF text: what MuJoCo, and people, read. Needs no MuJoCo.

Every cable is a spatial tendon between two sites with an actuator that can only pull (`forcerange` ends at 0):
force = clip(stiffness (rest - length) - damping rate, -inf, 0), so a cable never pushes. The control of a winched cable
is what it has reeled in since the rest pose of `robot.toml` [m], so that all zero, MuJoCo's default, is that pose; the
control of a passive cable (`gainprm` 0) is not read. What MuJoCo cannot:

- a slack cable that lengthens faster than stiffness / damping times its slack still pulls (its damper does not know);
- a cubic law has no actuator. Passive cubic cables are springs with a dead band instead, whose damping acts on slack
  cables too, in both directions; winched cubic cables are refused;
- friction is MuJoCo's convex one, contacts are soft, and restitution is a damping ratio.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.rig.model.bodies import body_of
from r2s2r_cli.rig.model.frames import Pose, cap_spans, quaternion, rest_pose, rotation, site_spans, wxyz
from r2s2r_cli.rig.model.options import Options, damping_ratio
from schemas.robot import Cable, Robot, Rod

REST_MIN_M = 0.005
"""No winch winds its cable shorter."""
_GROUND, _SHAFT = 1, 2
"""Collision bits: caps meet the ground and other rods, shafts meet other rods alone."""
_COLORS = ("0.85 0.2 0.2 1", "0.2 0.65 0.3 1", "0.2 0.4 0.85 1", "0.9 0.7 0.2 1", "0.6 0.35 0.75 1", "0.3 0.7 0.75 1")


def mjcf(robot: Robot, options: Options | None = None) -> str:
    """The robot on its ground as MJCF text, SI units; keyframe `rest` is the rest pose of `robot.toml`.

    Bodies are the rods, each in its frame R. Raises InputError for a robot that MuJoCo cannot model.
    """
    options = options or Options()
    pose = rest_pose(robot)
    lines = [
        *_head(robot, options),
        *_world(robot, options, pose),
        *_tendons(robot),
        *_actuators(robot, pose),
        *_keyframe(pose),
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def winch_range(robot: Robot) -> np.ndarray:
    """Shortest and longest rest length of every winched cable [m], (actuated, 2), between attachment points.

    The limits of `robot.toml` are for distances of cap centres; the rest pose says how much shorter a cable is.
    """
    pose = rest_pose(robot)
    shorter = (site_spans(robot, pose.p_WR, rotation(pose.q_WR)) - cap_spans(robot))[list(robot.actuated)]
    low = np.maximum(robot.limits.cable_length_min_m + shorter, REST_MIN_M)
    return np.stack([low, robot.limits.cable_length_max_m + shorter], axis=-1)


def winch_speed(robot: Robot) -> np.ndarray:
    """Speed of every winched cable at full command [m/s], (actuated,), in the order of `Robot.actuated`."""
    motors = {motor.cable: motor for motor in robot.motors}
    return np.array([m.no_load_rad_per_s * m.speed * m.winch_radius_m for m in (motors[k] for k in robot.actuated)])


def ground_rotation(normal: tuple[float, float, float]) -> np.ndarray:
    """A rotation R_WG (3, 3) of the ground frame G, whose z axis is the direction `normal` in W."""
    z = np.array(normal, dtype=float)
    z = z / np.linalg.norm(z)
    x = np.cross(np.cross(z, (1.0, 0.0, 0.0) if abs(z[0]) < 0.9 else (0.0, 1.0, 0.0)), z)
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _head(robot: Robot, options: Options) -> Iterator[str]:
    yield f"<!-- {escape(_comment(robot.title))}"
    yield "     Written from robot.toml. SI units: metre, kilogram, second, newton, radian; world z up."
    yield "     Body axes: z along the rod towards its odd cap, x upwards in the rest pose."
    yield "     Controls: length [m] that each winch has reeled in since the rest pose; below 0: paid out. -->"
    yield f"<mujoco model={quoteattr(robot.name)}>"
    yield '  <compiler angle="radian" autolimits="true"/>'
    yield (
        f'  <option timestep="{_n(options.timestep_s)}" gravity="{_n(*options.gravity)}" cone="{options.cone}" '
        f'integrator="{options.integrator}" solver="Newton" impratio="{_n(options.impratio)}"/>'
    )
    e = robot.contact.restitution if options.restitution is None else options.restitution
    ratio = damping_ratio(e)
    solref, solimp = _n(options.contact_time_s / ratio, ratio), _n(*options.impedance)
    ends = _GROUND | (_SHAFT if options.rod_contact else 0)
    shaft = _SHAFT if options.rod_contact else 0
    yield "  <default>"
    yield f"    <!-- restitution {_n(e)} as the damping ratio of solref; solimp's last number [m] -->"
    yield f'    <geom condim="3" solref="{solref}" solimp="{solimp}" friction="{_n(options.rod_friction)} 0 0"/>'
    # Where two geoms meet, the friction of the one with the higher priority holds: the ground's.
    friction = robot.contact.friction if options.friction is None else options.friction
    yield (
        f'    <default class="ground"><geom type="plane" size="5 5 0.1" friction="{_n(friction)} 0 0" priority="1" '
        f'contype="{_GROUND}" conaffinity="{_GROUND}" rgba="0.9 0.9 0.9 1"/></default>'
    )
    yield f'    <default class="cap"><geom type="sphere" contype="{ends}" conaffinity="{ends}"/></default>'
    yield f'    <default class="shaft"><geom type="capsule" contype="{shaft}" conaffinity="{shaft}"/></default>'
    yield '    <default class="cable"><tendon width="0.001"/></default>'
    yield '    <default class="point"><site size="0.002"/></default>'
    yield "  </default>"


def _world(robot: Robot, options: Options, pose: Pose) -> Iterator[str]:
    R_WG = ground_rotation(options.ground_normal)
    yield "  <worldbody>"
    yield '    <light pos="0 0 3" dir="0 0 -1" directional="true"/>'
    yield (
        f'    <geom name="ground" class="ground" pos="{_n(*(options.ground_offset_m * R_WG[:, 2]))}" '
        f'quat="{_n(*wxyz(quaternion(R_WG)))}"/>'
    )
    for i, ridge in enumerate(options.ridges):
        yield (
            f'    <geom name="ridge{i}" class="ground" type="capsule" fromto="{_n(*ridge.a, *ridge.b)}" '
            f'size="{_n(ridge.radius)}"/>'
        )
    for i, rod in enumerate(robot.rods):
        yield from _rod(robot, rod, i, pose, options)
    yield "  </worldbody>"


def _rod(robot: Robot, rod: Rod, i: int, pose: Pose, options: Options) -> Iterator[str]:
    body, half, color = body_of(rod), rod.length_m / 2, _COLORS[i % len(_COLORS)]
    yield ""
    yield f"    <!-- rod {i}, end caps {2 * i} and {2 * i + 1} -->"
    kind = ' simple="false"' if options.movable_mass else ""
    place = f'pos="{_n(*pose.p_WR[i])}" quat="{_n(*wxyz(pose.q_WR[i]))}"'
    yield f"    <body name={quoteattr('rod_' + rod.name)} {place}{kind}>"
    yield "      <freejoint/>"
    yield f'      <inertial mass="{_n(body.mass)}" pos="{_n(*body.p_RB)}" diaginertia="{_n(*body.inertia)}"/>'
    yield (
        f'      <geom name="shaft{i}" class="shaft" fromto="{_n(0, 0, -half, 0, 0, half)}" size="{_n(rod.radius_m)}" '
        f'rgba="{color}"/>'
    )
    for cap, side in ((2 * i, -half), (2 * i + 1, half)):
        yield (
            f'      <geom name="cap{cap}" class="cap" pos="{_n(0, 0, side)}" size="{_n(rod.cap_radius_m)}" '
            f'rgba="{color}"/>'
        )
        yield f'      <site name="centre{cap}" class="point" pos="{_n(0, 0, side)}"/>'
    for k, cable in enumerate(robot.cables):
        for cap, site in zip(cable.caps, cable.sites_m, strict=True):
            if cap // 2 == i:
                yield f'      <site name="cable{k}_cap{cap}" class="point" pos="{_n(*site)}"/>'
    yield "    </body>"


def _tendons(robot: Robot) -> Iterator[str]:
    yield ""
    yield "  <!-- springlength: a dead band up to the rest length [m]; stiffness [N/m N/m^2 N/m^3], damping [N s/m] -->"
    yield "  <tendon>"
    for k, cable in enumerate(robot.cables):
        spring = ""
        if _cubic(cable):
            law = (cable.stiffness_n_per_m, cable.stiffness2_n_per_m2, cable.stiffness3_n_per_m3)
            band = f'springlength="{_n(0, _rest(k, cable))}"'
            spring = f' stiffness="{_n(*law)}" damping="{_n(cable.damping_n_s_per_m)}" {band}'
        yield _spatial(f"cable{k}", k, cable, spring)
    for sensor in robot.sensors:
        if sensor.stiffness_n_per_m > 0 and sensor.rest_length_m is not None:
            spring = f' stiffness="{_n(sensor.stiffness_n_per_m)}" springlength="{_n(0, sensor.rest_length_m)}"'
            yield _spatial(f"sensor{sensor.cable}", sensor.cable, robot.cables[sensor.cable], spring)
    yield "  </tendon>"


def _spatial(name: str, k: int, cable: Cable, spring: str) -> str:
    sites = "".join(f'<site site="cable{k}_cap{cap}"/>' for cap in cable.caps)
    return f'    <spatial name="{name}" class="cable"{spring}>{sites}</spatial>'


def _actuators(robot: Robot, pose: Pose) -> Iterator[str]:
    yield ""
    yield "  <!-- force [N] = gainprm control [m] + biasprm (1, length, rate), at most 0: cables only pull -->"
    yield "  <actuator>"
    # Reeled in by c, a winched cable pulls with stiffness (length - (rest - c)).
    winched = {
        k: (rest, rest - limits[::-1])
        for k, rest, limits in zip(robot.actuated, pose.rest, winch_range(robot), strict=True)
    }
    for k in (*robot.actuated, *(k for k, cable in enumerate(robot.cables) if cable.kind == "passive")):
        cable = robot.cables[k]
        if _cubic(cable):
            continue
        stiffness, damping = cable.stiffness_n_per_m, cable.damping_n_s_per_m
        if k in winched:
            rest, travel = winched[k]
            bias = _n(stiffness * rest, -stiffness, -damping)
            law = f'ctrlrange="{_n(*travel)}" gainprm="{_n(-stiffness)}" biasprm="{bias}"'
        else:
            law = f'gainprm="0" biasprm="{_n(stiffness * _rest(k, cable), -stiffness, -damping)}"'
        name = "winch" if k in winched else "passive"
        yield f'    <general name="{name}{k}" tendon="cable{k}" biastype="affine" forcerange="-1e6 0" {law}/>'
    yield "  </actuator>"


def _keyframe(pose: Pose) -> Iterator[str]:
    qpos = [_n(*p, *wxyz(q)) for p, q in zip(pose.p_WR, pose.q_WR, strict=True)]
    yield ""
    yield "  <keyframe>"
    yield f'    <key name="rest" qpos="{" ".join(qpos)}"/>'
    yield "  </keyframe>"


def _cubic(cable: Cable) -> bool:
    return cable.stiffness2_n_per_m2 != 0 or cable.stiffness3_n_per_m3 != 0


def _rest(k: int, cable: Cable) -> float:
    if cable.rest_length_m is None:
        raise InputError(
            f"MuJoCo has no winched cable with a cubic law, and cable {k} is one", where=f"robot.toml: cables.{k}",
            expected="stiffness2_n_per_m2 = 0 and stiffness3_n_per_m3 = 0",
            received="a cable without rest_length_m whose coefficients are not 0",
            hint=f"set both to 0 on cable {k} in robot.toml",
        )  # fmt: skip
    return cable.rest_length_m


def _n(*numbers: float) -> str:
    """Numbers as the shortest text that reads back to the same doubles."""
    return " ".join(f"{x:g}" if float(f"{x:g}") == x else repr(x) for x in (float(number) + 0.0 for number in numbers))


def _comment(text: str) -> str:
    """Two hyphens would end an XML comment."""
    while "--" in text:
        text = text.replace("--", "- -")
    return text
