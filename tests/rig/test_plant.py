"""The plant: winches, time, truth and faults of the mechanical side of the rig."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import UsageError
from r2s2r_cli.rig.plant import Plant, Truth
from r2s2r_cli.rig.world import World
from schemas.robot import Robot
from tests.support.rig_robots import known, values

STILL = np.zeros(6)


def make(robot: Robot | None = None, **tables: object) -> Plant:
    """A plant that has settled quickly."""
    start = {"settle_s": 0.3} | dict(tables.pop("start", {}))  # type: ignore[call-overload]
    return Plant(robot or known(), World.model_validate({"start": start, **tables}))


def test_an_ideal_winch_winds_radius_times_speed() -> None:
    """Without laws a duty u winds r no_load u a second, from the first step to the last, and nothing else moves."""
    plant = make()
    motor = plant.robot.motors[0]
    before = plant.truth()
    plant.advance(0.5, np.array([0.6, 0.0, -0.1, 0.0, 0.0, 0.0]))
    after = plant.truth()
    wound = motor.no_load_rad_per_s * motor.winch_radius_m * 0.5
    np.testing.assert_allclose(before.rest - after.rest, wound * np.array([0.6, 0, -0.1, 0, 0, 0]), atol=1e-12)
    np.testing.assert_allclose((after.angle - before.angle)[0], 0.6 * motor.no_load_rad_per_s * 0.5, rtol=1e-12)


def test_sign_and_order_of_motors_are_those_of_the_wire() -> None:
    """A motor of sign -1 reels in for a negative duty; duties follow the list of motors, not of cables."""
    facts = values()
    facts["motors"] = facts["motors"][::-1]
    facts["motors"][0]["sign"] = -1
    plant = make(Robot.model_validate(facts))
    before = plant.truth().rest
    plant.advance(0.2, np.array([-0.5, 0.0, 0.0, 0.0, 0.0, 0.0]))
    moved = before - plant.truth().rest
    assert moved[5] > 0
    assert (moved[:5] == 0).all()


def test_a_winch_stops_at_the_end_of_its_travel() -> None:
    """Neither cable nor shaft goes beyond the limits of robot.toml."""
    plant = make()
    plant.advance(6.0, np.array([-1.0, 0, 0, 0, 0, 0]))
    first = plant.truth()
    plant.advance(1.0, np.array([-1.0, 0, 0, 0, 0, 0]))
    again = plant.truth()
    assert first.rest[0] == again.rest[0]
    assert first.angle[0] == pytest.approx(again.angle[0], abs=1e-12)
    assert plant.winches.w[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    "effects", [{}, {"command_latency": {"delay_s": 0.03, "jitter_s": 0.02}, "tendon_relaxation": {}}]
)
def test_same_world_same_motion(effects: dict[str, object]) -> None:
    """Two plants agree to the last bit, laws with random numbers included."""

    def run() -> Truth:
        plant = make(effects=effects, seed=5)
        for k in range(20):
            plant.advance(0.02, np.sin(np.arange(6) + k))
        return plant.truth()

    a, b = run(), run()
    for name in ("p_WE", "q_WR", "v_WR", "rest", "force"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_how_time_is_cut_does_not_matter() -> None:
    """Many short advances of odd lengths make the same steps as one long one."""
    u = np.array([0.7, -0.2, 0.0, 0.3, 0.0, 0.0])
    whole, pieces = make(), make()
    whole.advance(0.1, u)
    for dt in (0.0333, 0.0004, 0.0007, 0.0256, 0.04):
        pieces.advance(dt, u)
    assert pieces.t == pytest.approx(0.1, abs=1e-12)
    np.testing.assert_array_equal(whole.truth().p_WE, pieces.truth().p_WE)


def test_time_does_not_drift() -> None:
    """After 500 ticks of 20 ms MuJoCo has made exactly the steps of 10 s."""
    plant = make(timestep_s=0.004)
    for _ in range(500):
        plant.advance(0.02, STILL)
    assert plant.sim.t == pytest.approx(0.3 + 10.0, abs=1e-9)
    assert plant.t == pytest.approx(10.0, abs=1e-9)


def test_the_floor_carries_the_robot_and_nothing_pushes_it_sideways() -> None:
    """At rest the forces of the floor add up to the weight, on the caps that it touches."""
    plant = make(start={"settle_s": 4.0})
    plant.advance(1.0, STILL)
    truth = plant.truth()
    weight = 9.81 * plant.sim.model.body_mass.sum()
    np.testing.assert_allclose(truth.force.sum(axis=0), [0.0, 0.0, weight], atol=0.02 * weight)
    assert (truth.force[:, 2] > 0).tolist() == truth.contact.tolist()


def test_it_starts_where_the_world_says() -> None:
    """The caps at time 0 are those of the rest pose, turned by the heading and moved, as far as it does not settle."""
    plant = make(start={"position_m": [0.3, -0.2], "heading_rad": 0.5, "settle_s": 0.0})
    c, s = np.cos(0.5), np.sin(0.5)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    expected = np.array(plant.robot.rest_caps_m) @ R.T + [0.3, -0.2, 0.0]
    np.testing.assert_allclose(plant.truth().p_WE, expected, atol=1e-5)
    plain = make(start={"settle_s": 0.0})
    np.testing.assert_allclose(plant.sim.read().span, plain.sim.read().span, atol=1e-9)


def test_lengths_are_distances_of_caps() -> None:
    """What the sensors are stretched by is the truth's length, one step old at most."""
    plant = make()
    plant.advance(0.4, np.array([0.8, 0, 0, 0.8, 0, 0]))
    np.testing.assert_allclose(plant.lengths(), plant.truth().length, atol=1e-3)


def test_a_dead_motor_and_a_torn_cable() -> None:
    """From its time on the motor stands still; a torn cable pulls no more, and its caps part."""
    faults = [
        {"kind": "motor_dead", "motor": 0, "at_s": 0.2, "for_s": 0.2},
        {"kind": "cable_torn", "cable": 7, "at_s": 0.5},
    ]
    plant = make(faults=faults)
    rest = []
    for _ in range(5):
        rest.append(plant.truth().rest[0])
        plant.advance(0.1, np.array([0.5, 0, 0, 0, 0, 0]))
    assert rest[0] > rest[1] > rest[2] == rest[3] == rest[4]
    assert plant.truth().tension[7] > 1
    plant.advance(0.5, STILL)
    assert plant.truth().tension[7] == 0


@pytest.mark.parametrize(
    ("tables", "where"),
    [
        ({"effects": {"payload": {"rod": 3}}}, "effects.payload.rod"),
        (
            {"effects": {"attachment_offset": {"moved": [{"cable": 9, "by_m": [0, 0, 0]}]}}},
            "effects.attachment_offset.moved.0.cable",
        ),
        ({"faults": [{"kind": "motor_dead", "motor": 6, "at_s": 0.0}]}, "faults.0.motor"),
        ({"faults": [{"kind": "sensor_stuck", "sensor": 9, "at_s": 0.0}]}, "faults.0.sensor"),
    ],
)
def test_a_world_that_names_what_the_robot_lacks_is_refused(tables: dict[str, object], where: str) -> None:
    """The message names the key and the numbers that there are."""
    with pytest.raises(UsageError) as error:
        make(**tables)
    assert where in error.value.where
    assert error.value.expected.startswith("0 to ")


def test_the_six_bar_robot_has_a_plant_too() -> None:
    """Another robot is another file: it builds, settles and moves."""
    plant = make(known("sixbar"))
    n = len(plant.robot.motors)
    plant.advance(0.2, np.full(n, 0.3))
    assert (plant.truth().angle > 0).all()
