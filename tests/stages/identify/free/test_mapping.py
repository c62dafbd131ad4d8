"""Values at work: exact at robot.toml, closed forms, batches, laws and effects, what lies outside the engine."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import GroundSlope, with_off_values
from r2s2r_cli.engine import check_parameters
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.parameters import shapes, value
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.free import Mapping, catalogue, select
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.model import parameters_of, structure_of
from tests.support.varied import varied

ROBOT = varied()
APART = (
    "motor_speed_in", "motor_speed_out", "motor_lag", "load_droop", "stiffness_actuated", "stiffness_passive",
    "damping", "rest_length", "tendon_stiffness", "mass", "com.0", "com.1", "com.2", "attachment_phase.0",
    "attachment_phase.1", "attachment_phase.2", "friction", "restitution", "ground_slope_x", "ground_slope_y",
    "ground_height", "command_delay", "camera_delay", "pid_p", "pid_i", "pid_d", "pid_tolerance", "pid_min_length",
    "pid_range", "cap_friction.factor.2", "payload.mass_kg.1", "friction_field.gradient_x_per_m",
    "camera_pose.turn_z_rad",
)  # fmt: skip
"""Names that can all be free together."""


def mapping(*specs: str, **options: object) -> Mapping:
    """The mapping of specs on the varied robot."""
    return Mapping(ROBOT, select(specs, ROBOT), **options)  # type: ignore[arg-type]


def test_at_the_values_of_robot_toml_it_is_the_robot() -> None:
    """All numbers together at their nominal values: bit by bit parameters_of, effects at their off values."""
    made = mapping(*APART)
    theta = made.theta(np.array([entries(ROBOT)[name].nominal for name in made.names]))
    own = with_off_values(made.structure, parameters_of(ROBOT))
    for name in shapes(made.structure):
        assert torch.equal(value(theta, name), value(own, name)), name


def test_the_starts_are_a_robot_that_the_engine_takes() -> None:
    """check_parameters, axial bodies included."""
    made = mapping(*APART)
    check_parameters(made.structure, made.theta(np.array([free.start for free in made.frees])))


def test_all_derivatives_together() -> None:
    """The Jacobian of everything at once, away from the starts, is that of differentiating everything at once: the
    columns that are computed once stay true."""
    made = mapping(*APART)
    x = torch.tensor([free.start for free in made.frees], dtype=torch.float64)
    made.jacobian(x)
    x = x + 0.03 * x.abs() + 0.001
    assert torch.allclose(made.jacobian(x), torch.func.jacfwd(made.packed)(x), rtol=1e-13, atol=1e-14)


def test_a_batch_is_its_rows() -> None:
    """Values (B, n) give what each row gives alone."""
    made = mapping("motor_speed", "attachment_phase.1", "ground_slope_y", "motor_lag")
    x = torch.tensor([[0.5, 0.1, 0.02, 0.05], [0.9, -0.2, 0.0, 0.1]], dtype=torch.float64)
    assert torch.equal(made.packed(x), torch.stack([made.packed(row) for row in x]))


def test_one_number_for_many_is_their_mean_and_a_factor() -> None:
    """motor_speed at twice the mean doubles each winch, which differ among themselves."""
    mean = np.mean([motor.speed for motor in ROBOT.motors])
    theta, own = mapping("motor_speed").theta(np.array([2 * mean])), parameters_of(ROBOT)
    assert theta.speed_in == pytest.approx(2 * own.speed_in)
    assert theta.speed_out == pytest.approx(2 * own.speed_out)


def test_rest_length_moves_all_by_the_same_length() -> None:
    """Its mean is shown; the differences between cables stay."""
    own = parameters_of(ROBOT).rest
    theta = mapping("rest_length").theta(np.array([float(own.mean()) + 0.004]))
    assert theta.rest - own == pytest.approx(torch.full_like(own, 0.004))


def test_a_centre_of_mass_leaves_the_rod_as_it_is() -> None:
    """Caps and attachment points keep their distances from each other; the caps lie where the value says."""
    theta, own = mapping("com.1").theta(np.array([0.02])), parameters_of(ROBOT)
    half = ROBOT.rods[1].length_m / 2
    assert theta.p_BE[0, 1, :, 2].tolist() == pytest.approx([-half - 0.02, half - 0.02])
    for k, cable in enumerate(ROBOT.cables):
        for side, cap in enumerate(cable.caps):
            to_cap = [one.p_BS[0, k, side] - one.p_BE[0, cap // 2, 0] for one in (theta, own)]
            assert to_cap[0] == pytest.approx(to_cap[1])


def test_an_attachment_phase_turns_the_points_of_one_rod() -> None:
    """A quarter turn takes (x, y, z) to (-y, x, z) on rod 2, and leaves the others."""
    theta, own = mapping("attachment_phase.2").theta(np.array([math.pi / 2])), parameters_of(ROBOT)
    for k, cable in enumerate(ROBOT.cables):
        for side, cap in enumerate(cable.caps):
            x, y, z = own.p_BS[0, k, side].tolist()
            expected = (-y, x, z) if cap // 2 == 2 else (x, y, z)
            assert theta.p_BS[0, k, side].tolist() == pytest.approx(expected, abs=1e-15)


@pytest.mark.parametrize(("free", "given"), [("x", "y"), ("y", "x")])
def test_of_two_slopes_one_may_be_given(free: str, given: str) -> None:
    """Many values of the one with the one value of the other, as a population asks for them: each as by itself."""
    made = mapping(f"ground_slope_{free}", fixed={f"ground_slope_{given}": 0.01})
    many = np.array([[0.02], [0.03], [0.04]])
    assert torch.equal(made.theta(many).gravity, torch.cat([made.theta(one).gravity for one in many]))


def test_a_slope_is_that_of_the_effect() -> None:
    """Gravity of ground_slope_x and ground_slope_y together is gravity under effects/ground_slope."""
    theta = mapping("ground_slope_x", "ground_slope_y").theta(np.array([0.03, -0.05]))
    structure = structure_of(ROBOT).with_effects(GroundSlope())
    angles = {"ground_slope.angle_x_rad": torch.tensor([[0.03]]), "ground_slope.angle_y_rad": torch.tensor([[-0.05]])}
    effect = parameters_of(ROBOT).with_values({name: angle.double() for name, angle in angles.items()})
    assert theta.gravity == pytest.approx(effective(structure, effect).gravity, abs=1e-7)


def test_laws_and_effects_are_switched_on_where_they_are_needed() -> None:
    """Lag, droop and effects, by a free number, a fixed one or by name; else the structure is the robot's."""
    assert mapping("motor_speed").structure == structure_of(ROBOT)
    assert mapping("motor_lag.2").structure == replace(structure_of(ROBOT), lag=True)
    assert mapping(fixed={"load_droop": 0.01}).structure == replace(structure_of(ROBOT), droop=True)
    by_number = mapping("cap_friction.factor.3").structure
    assert [effect.name for effect in by_number.effects] == ["cap_friction"]
    by_name = Mapping(ROBOT, (), ("motor_lag", "cap_friction")).structure
    assert by_name.lag
    assert {effect.name for effect in by_name.effects} == {"motor_lag", "cap_friction"}


def test_the_structure_can_be_given() -> None:
    """Without rod contact the flat vector lacks what it needs, in the derivatives as well."""
    bare = replace(structure_of(ROBOT), rod_contact=False)
    x = torch.tensor([0.6], dtype=torch.float64)
    whole, short = mapping("friction"), mapping("friction", structure=bare)
    assert len(short.jacobian(x)) == len(short.packed(x)) == len(whole.packed(x)) - len(ROBOT.rods) - 1


def test_outside_the_engine() -> None:
    """Heights and delays are plain numbers; gains are those of robot.toml but for the free ones, with derivatives."""
    made = mapping("ground_height", "pid_p", "camera_delay", fixed={"pid_d": 0.7, "command_delay": 0.04})
    seen = made.observation(np.array([0.002, 5.0, 0.03]))
    assert (seen.ground_height, seen.camera_delay, seen.command_delay) == (0.002, 0.03, 0.04)
    x = torch.tensor([[0.0, 5.0, 0.0], [0.0, 4.0, 0.0]], dtype=torch.float64, requires_grad=True)
    pid = made.pid(x)
    assert (pid.i, pid.d, pid.range) == (ROBOT.pid.i, 0.7, ROBOT.pid.range_m)
    lengths = torch.full((2, len(ROBOT.cables)), 0.13, dtype=torch.float64)
    target = torch.zeros(2, len(ROBOT.actuated), dtype=torch.float64) + 0.2
    u, _ = pid.tick(pid.start(lengths), lengths, target)
    error = (0.13 - ROBOT.pid.min_length_m) / ROBOT.pid.range_m - 0.2
    assert u[:, 0].tolist() == pytest.approx([(gain + ROBOT.pid.i + 0.7) * error for gain in (5.0, 4.0)])
    (slope,) = torch.autograd.grad(u.sum(), x)
    assert slope[:, 1].tolist() == pytest.approx([len(ROBOT.actuated) * error] * 2)


def test_a_fixed_number_holds_and_a_part_of_it_can_be_free() -> None:
    """All winches at 0.4, winch 2 free: it alone follows the value."""
    theta = mapping("motor_speed.2", fixed={"motor_speed": 0.4}).theta(np.array([0.9]))
    factor = 0.4 / np.mean([motor.speed for motor in ROBOT.motors])
    for motor, speed in zip(ROBOT.motors, theta.speed_in[0].tolist(), strict=True):
        shown = 0.9 if motor.cable == 2 else motor.speed * factor
        assert speed == pytest.approx(shown * motor.no_load_rad_per_s * motor.winch_radius_m)


def test_delays_of_effects_come_on_top_of_what_is_given() -> None:
    """The shift of the log is the robot's delay and the effect's; the step's own number stays off, so that nothing is
    late twice. Free beside the robot's own it is refused."""
    made = mapping("command_latency.tau_s", "camera_delay.tau_s", fixed={"command_delay": 0.02})
    seen = made.observation(np.array([0.05, -0.01]))
    assert (seen.command_delay, seen.camera_delay) == pytest.approx((0.07, -0.01))
    assert made.delays == (0, 1)
    assert float(made.theta(np.array([0.05, -0.01])).extra["command_latency.tau_s"]) == 0.0
    given = mapping("friction", fixed={"command_latency.tau_s": 0.03, "command_delay": 0.02})
    assert given.observation(np.array([0.5])).command_delay == pytest.approx(0.05)
    with pytest.raises(UsageError, match="set the same number"):
        mapping("command_latency.tau_s", "command_delay")


def test_an_effect_adds_to_what_is_fixed() -> None:
    """The lag of a robot is given, and that of the effect on top is free: no contradiction."""
    made = mapping("motor_lag.tau_s", fixed={"motor_lag": 0.03})
    theta = effective(made.structure, made.theta(np.array([0.02])))
    assert theta.lag.tolist() == [pytest.approx([0.05] * len(ROBOT.actuated))]


def test_nothing_free_is_the_robot() -> None:
    """No columns, and the robot's own parameters."""
    made = Mapping(ROBOT, ())
    assert made.jacobian(np.zeros(0)).shape == (len(made.packed(np.zeros(0))), 0)


@pytest.mark.parametrize("fixed", ["motor_speed.2", "motor_speed_in.2", "motor_speed"])
def test_what_is_fixed_is_not_free_as_well(fixed: str) -> None:
    """A free number that sets all of a fixed one, or the same one."""
    with pytest.raises(UsageError, match="is free and"):
        mapping("motor_speed", fixed={fixed: 0.5})


def test_fixed_values_are_checked() -> None:
    """Names and bounds, each with the option that was meant."""
    with pytest.raises(UsageError, match="unknown parameter 'frictoin'") as caught:
        mapping(fixed={"frictoin": 0.5})
    assert "--fix friction=" in caught.value.hint
    for bad in (-0.1, math.nan):
        with pytest.raises(UsageError, match="out of its bounds") as outside:
            mapping(fixed={"friction": bad})
        assert outside.value.expected == "0.038 to 5"  # of no unit


def test_the_catalogue_has_the_whole_before_its_parts() -> None:
    """So that the more special of a fixed and a free number is applied last."""
    known = list(entries(ROBOT).values())
    for first, entry in enumerate(known):
        for other in known[first + 1 :]:
            assert not entry.action.touches < other.action.touches, (entry.free.name, other.free.name)


def test_catalogue_and_mapping_agree_on_names() -> None:
    """Every name of the catalogue can be fixed at its start."""
    for name, free in catalogue(ROBOT).items():
        assert mapping(fixed={name: free.start}).fixed == {name: free.start}
