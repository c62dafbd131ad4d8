"""Robots, states and commands that cannot be: an error that names the field."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    EngineInputError,
    NonFiniteError,
    Parameters,
    State,
    Structure,
    check_parameters,
    check_state,
    closed_loop,
)  # fmt: skip
from r2s2r_cli.engine.rollout import Simulator
from tests.support.engine import simulator, threebar_engine
from tests.support.robots import rested, subject

STILL = torch.zeros(1, 10, 6, dtype=torch.float64)


def changed(x: Tensor, index: tuple[int, ...], value: float) -> Tensor:
    """A copy with one number changed."""
    x = x.clone()
    x[index] = value
    return x


def with_parameter(name: str, index: tuple[int, ...], value: float) -> Callable[[Parameters], Parameters]:
    """What replaces one number of a field."""
    return lambda theta: replace(theta, **{name: changed(getattr(theta, name), index, value)})


PARAMETERS: dict[str, tuple[str, Callable[[Parameters], Parameters]]] = {
    "zero mass": ("mass.1", with_parameter("mass", (0, 1), 0.0)),
    "negative mass": ("mass.2", with_parameter("mass", (0, 2), -0.1)),
    "negative stiffness": ("stiffness.4", with_parameter("stiffness", (0, 4), -10.0)),
    "negative damping": ("damping.8", with_parameter("damping", (0, 8), -1.0)),
    "negative friction": ("friction.1.0", with_parameter("friction", (0, 1, 0), -0.1)),
    "negative rest length": ("rest.0", with_parameter("rest", (0, 0), -0.1)),
    "restitution above 1": ("restitution.0", with_parameter("restitution", (0, 0), 1.2)),
    "cap of no size": ("cap_radius.0.1", with_parameter("cap_radius", (0, 0, 1), 0.0)),
    "rod of zero length": ("p_BE", lambda theta: replace(theta, p_BE=0 * theta.p_BE)),
    "no inertia": ("inertia", lambda theta: replace(theta, inertia=0 * theta.inertia)),
    "NaN stiffness": ("stiffness", with_parameter("stiffness", (0, 4), math.nan)),
    "infinite speed": ("speed_in", with_parameter("speed_in", (0, 0), math.inf)),
    "winch ends crossed": ("rest_min.3", with_parameter("rest_min", (0, 3), 0.5)),
    "too few masses": ("mass", lambda theta: replace(theta, mass=theta.mass[:, :2])),
    "no batch axis": ("mass", lambda theta: replace(theta, mass=theta.mass[0])),
    "gravity of two numbers": ("gravity", lambda theta: replace(theta, gravity=theta.gravity[:, :2])),
}

STATES: dict[str, tuple[str, Callable[[State], State]]] = {
    "NaN position": ("p_WB.0.2", lambda s: replace(s, p_WB=changed(s.p_WB, (0, 0, 2), math.nan))),
    "NaN rest length": ("rest.3", lambda s: replace(s, rest=changed(s.rest, (0, 3), math.nan))),
    "infinite velocity": ("v_WB.1.0", lambda s: replace(s, v_WB=changed(s.v_WB, (0, 1, 0), math.inf))),
    "no unit quaternion": ("q_WR", lambda s: replace(s, q_WR=2 * s.q_WR)),
    "two rods": ("p_WB", lambda s: replace(s, p_WB=s.p_WB[:, :2])),
    "no batch axis": ("w_R", lambda s: replace(s, w_R=s.w_R[0])),
}


@pytest.mark.parametrize("case", list(PARAMETERS))
def test_impossible_parameters(case: str) -> None:
    """Each impossible number of a robot raises an error that names its field, alone and through the simulator."""
    field, change = PARAMETERS[case]
    structure, theta, start = threebar_engine()
    with pytest.raises(EngineInputError) as error:
        check_parameters(structure, change(theta))
    assert error.value.field == field
    assert field in str(error.value)
    with pytest.raises(EngineInputError) as error:
        simulator(structure).rollout(change(theta), start, STILL)
    assert error.value.field == field


@pytest.mark.parametrize(("name", "index"), [("gravity", (0, 2)), ("p_BE", (0, 1, 0, 2)), ("inertia", (0, 2, 1, 1))])
def test_the_number_that_is_none_is_shown(name: str, index: tuple[int, ...]) -> None:
    """Of a field with zeros and negative numbers, which are good there, the NaN is shown, and its place."""
    structure, theta, _ = threebar_engine()
    with pytest.raises(EngineInputError) as error:
        check_parameters(structure, with_parameter(name, index, math.nan)(theta))
    assert (error.value.field, error.value.received) == (name, f"nan at {index[1:]}")


def test_winch_ends_of_different_batches() -> None:
    """One end shared by three robots: the winch of the third whose ends are crossed is named. Batches that do not fit:
    the odd one is named."""
    structure, theta, start = threebar_engine()
    longest = changed(theta.rest_max.expand(3, -1), (2, 1), 1e-3)
    with pytest.raises(EngineInputError) as error:
        simulator(structure).rollout(replace(theta, rest_max=longest), start, STILL)
    assert error.value.field == "rest_min.1"
    with pytest.raises(EngineInputError) as error:
        simulator(structure).rollout(
            replace(theta, rest_max=longest, rest_min=theta.rest_min.expand(2, -1)), start, STILL
        )
    assert error.value.field == "rest_max"


@pytest.mark.parametrize("case", list(STATES))
def test_impossible_states(case: str) -> None:
    """Each impossible state raises an error that names its field, alone and through the simulator."""
    field, change = STATES[case]
    structure, theta, start = threebar_engine()
    with pytest.raises(EngineInputError) as error:
        check_state(structure, change(start))
    assert error.value.field == field
    with pytest.raises(EngineInputError) as error:
        simulator(structure).rollout(theta, change(start), STILL)
    assert error.value.field == field


@pytest.mark.parametrize(
    ("field", "how"),
    [
        ("commands", {"commands": STILL[:, :, :5]}),
        ("commands", {"commands": STILL[0]}),
        ("commands", {"commands": STILL[:, :0]}),
        ("commands", {"commands": STILL * math.nan}),
        ("step", {"step": 0.0}),
        ("step", {"step": math.nan}),
        ("every", {"every": 7}),
        ("every", {"hold": 0}),
        ("substeps", {"substeps": -1}),
        ("p_WB", {"commands": STILL.expand(3, -1, -1), "state0": "two"}),
    ],
)
def test_impossible_rollouts(field: str, how: dict[str, object]) -> None:
    """Commands, steps and batches that do not fit raise an error that names what is wrong."""
    structure, theta, start = threebar_engine()
    if how.get("state0") == "two":
        start = start.select(torch.tensor([0, 0]))
    commands = how.get("commands", STILL)
    rest = {key: value for key, value in how.items() if key not in ("commands", "state0")}
    with pytest.raises(EngineInputError) as error:
        simulator(structure).rollout(theta, start, commands, **rest)
    assert error.value.field == field


@pytest.mark.parametrize(
    ("field", "how"),
    [
        ("n_rods", {"n_rods": 0, "cable_rods": (), "actuated": ()}),
        ("cable_rods.1", {"n_rods": 2, "cable_rods": ((0, 1), (1, 1)), "actuated": ()}),
        ("cable_rods.0", {"n_rods": 2, "cable_rods": ((0, 2),), "actuated": ()}),
        ("actuated", {"n_rods": 2, "cable_rods": ((0, 1),), "actuated": (1,)}),
        ("actuated", {"n_rods": 2, "cable_rods": ((0, 1), (0, 1)), "actuated": (1, 0)}),
        ("sweeps", {"n_rods": 1, "cable_rods": (), "actuated": (), "sweeps": 0}),
    ],
)
def test_impossible_structures(field: str, how: dict[str, object]) -> None:
    """A cable between points of one rod, to no rod, a winch on no cable, no rods: refused with the field's name."""
    with pytest.raises(EngineInputError) as error:
        Structure(**how)
    assert error.value.field == field


@pytest.mark.parametrize("native", [None, False], ids=["native", "torch"])
def test_a_simulation_that_leaves_the_finite_numbers(native: bool | None) -> None:
    """A spring far too stiff for the forced step: the error names step, time, environment, body and term; the healthy
    environment beside it is not blamed."""
    structure, theta, start = threebar_engine()
    stiff = torch.cat([theta.stiffness, theta.stiffness * 1e12])
    start = start.select(torch.tensor([0, 0]))
    commands = torch.zeros(2, 40, 6, dtype=torch.float64)
    theta = theta.map(lambda x: x.expand(2, *x.shape[1:]))
    with pytest.raises(NonFiniteError) as error:
        Simulator(structure, native=native).rollout(replace(theta, stiffness=stiff), start, commands, substeps=1)
    found = error.value
    assert found.environment == 1
    assert 0 <= found.step < 40
    assert found.time == pytest.approx(found.step * 1e-3, abs=1.1e-3)
    assert found.body.split()[0] in ("rod", "cable")
    assert found.term
    assert f"step {found.step}" in str(found)


@pytest.mark.parametrize(
    ("field", "shape"),
    [
        ("d_parameters", (3, 2)),
        ("d_parameters", (135, 0)),
        ("d_state", (3, 51, 2)),
        ("d_commands", (10, 6)),
    ],
)
def test_impossible_directions(field: str, shape: tuple[int, ...]) -> None:
    """Directions of another length, of another batch, or none at all: named as the caller calls them."""
    structure, theta, start = threebar_engine()
    with pytest.raises(EngineInputError) as error:
        simulator(structure).jvp(theta, start, STILL, **{field: torch.zeros(shape, dtype=torch.float64)})
    assert error.value.field == field


@pytest.mark.parametrize(
    ("field", "motors", "tail"), [("pid.actuated", (0, 1), 0.0), ("tail", None, math.nan), ("tail", None, -1.0)]
)
def test_impossible_loops(field: str, motors: tuple[int, ...] | None, tail: float) -> None:
    """The controller of a robot with other motors, and times that cannot be waited."""
    model, start = subject(), rested().state
    pid = model.pid() if motors is None else replace(model.pid(), actuated=motors)
    one, none = torch.ones(1, 6, dtype=torch.float64), torch.zeros(1, dtype=torch.float64)
    with pytest.raises(EngineInputError) as error:
        closed_loop(model.simulator, model.theta, start, pid, one, none, none + 0.1, tail=tail)
    assert error.value.field == field
