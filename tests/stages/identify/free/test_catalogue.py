"""The catalogue: what is there, how it starts, and what each number changes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import CATALOGUE, with_off_values
from r2s2r_cli.engine import Parameters
from r2s2r_cli.engine.parameters import shapes, value
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.free import Mapping, catalogue
from r2s2r_cli.stages.identify.free.catalogue import entries
from r2s2r_cli.stages.identify.free.entry import Entry
from r2s2r_cli.stages.model import parameters_of
from tests.support.engine import threebar
from tests.support.varied import varied

BESIDE = {"friction_anisotropy.ratio": 1.15, "friction_field.patch_factor": 0.8}
"""Numbers that begin beside their off values, which are no bounds."""
ENTRIES = {
    name: entry for name, entry in entries(varied()).items() if not entry.effect or entry.element in (None, 2)
}  # of effects one element stands for all: their numbers are made in one loop
FIELDS: dict[str, set[str]] = {
    "motor_speed": {"speed_in", "speed_out"}, "motor_speed_in": {"speed_in"}, "motor_speed_out": {"speed_out"},
    "motor_lag": {"lag"}, "load_droop": {"droop"}, "stiffness": {"stiffness", "stiffness2", "stiffness3"},
    "stiffness_actuated": {"stiffness"}, "stiffness_passive": {"stiffness", "stiffness2", "stiffness3"},
    "damping": {"damping"}, "damping_actuated": {"damping"}, "damping_passive": {"damping"},
    "rest_length": {"rest"}, "tendon_stiffness": {"tendon_stiffness"}, "mass": {"mass", "inertia"},
    "com": {"p_BE", "p_BS"}, "attachment_phase": {"p_BS"}, "friction": {"friction"}, "restitution": {"restitution"},
    "ground_slope_x": {"gravity"}, "ground_slope_y": {"gravity"},
}  # fmt: skip
"""Fields of Parameters that each family may change; what is outside the engine changes none."""


def changed(entry: Entry) -> tuple[Mapping, Parameters, Parameters]:
    """The mapping of one number, and the parameters without it and with it 10 % up (0.01 up from 0)."""
    mapping = Mapping(varied(), [entry.free])
    up = entry.nominal * 1.1 if entry.nominal else 0.01
    before = with_off_values(mapping.structure, parameters_of(varied()))
    return mapping, before, mapping.theta(np.array([up]))


def test_there_is_what_the_issue_asks_for() -> None:
    """Families of the issue, with an element for each motor, cable, rod and cap of the three-bar robot."""
    names = set(catalogue(varied()))
    counts = {"motor_speed": 6, "motor_speed_in": 6, "motor_speed_out": 6, "motor_lag": 6, "load_droop": 6,
              "tendon_stiffness": 6, "damping": 9, "mass": 3}  # fmt: skip
    for family, count in counts.items():
        assert {family, *(f"{family}.{k}" for k in range(count))} <= names
        assert f"{family}.{count}" not in names
    assert {"friction", "restitution", "rest_length", "rest_length.6", "com.2", "attachment_phase.0"} <= names
    assert {"friction.cap5", "stiffness.8", "stiffness_actuated", "stiffness_passive", "damping_passive"} <= names
    assert {"ground_slope_x", "ground_slope_y", "ground_height", "command_delay", "camera_delay"} <= names
    assert {"pid_p", "pid_i", "pid_d", "pid_tolerance", "pid_min_length", "pid_range"} <= names
    assert {f"{effect.name}.{own.name}" for effect in CATALOGUE for own in effect.own if own.fitted} <= names
    assert "dropout.lost" not in names  # frames that are missing say nothing about motion


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=lambda entry: entry.free.name)
def test_a_fit_can_start(entry: Entry) -> None:
    """Strictly inside the bounds, at the value of robot.toml where that is inside, with a prior and a sentence; only
    what gives other numbers something to do begins elsewhere."""
    free = entry.free
    assert free.lower < free.start < free.upper
    inside = free.lower < entry.nominal < free.upper
    assert (free.start == entry.nominal) == (inside and free.name not in BESIDE)
    assert free.prior_sd > 0
    assert free.what.endswith(".")
    assert math.isfinite(free.to_z(free.start))


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=lambda entry: entry.free.name)
def test_it_changes_what_it_says_and_nothing_else(entry: Entry) -> None:
    """Fields other than its own stay bit by bit; its own change, and only at its element."""
    mapping, before, after = changed(entry)
    moved = {
        name: (value(before, name) != value(after, name)).flatten().nonzero().flatten().tolist()
        for name in shapes(mapping.structure)
    }
    moved = {name: places for name, places in moved.items() if places}
    expected = {entry.family} if entry.effect and mapping.in_engine[0] else FIELDS.get(entry.family, set())
    if entry.family == "stiffness" and entry.element in varied().actuated:
        expected = {"stiffness"}
    assert set(moved) == expected
    if entry.element is not None and not {"p_BS", "inertia", "rest"} & set(moved):
        assert set(map(tuple, moved.values())) == {(entry.element,)}
    if entry.family == "mass" and entry.element is not None:
        assert moved["mass"] == [entry.element]
        assert moved["inertia"] == [9 * entry.element + k for k in (0, 4, 8)]


@pytest.mark.parametrize("entry", ENTRIES.values(), ids=lambda entry: entry.free.name)
def test_derivatives_are_those_of_what_the_engine_reads(entry: Entry) -> None:
    """The column equals central differences of the flat vector; it is 0 outside the engine and nowhere else."""
    mapping, _, _ = changed(entry)
    x = torch.tensor([entry.free.start], dtype=torch.float64)
    h = 1e-4 * max(abs(entry.free.start), 0.1)
    column = mapping.jacobian(x)[:, 0]
    quotient = (mapping.packed(x + h) - mapping.packed(x - h)) / (2 * h)
    assert column == pytest.approx(quotient, rel=1e-6, abs=1e-6 * float(quotient.abs().max()))
    assert bool(column.any()) == mapping.in_engine[0]


@pytest.mark.parametrize("robot", ["threebar", "sixbar"])
def test_every_robot_has_a_catalogue(robot: str) -> None:
    """Names, starts and parameters fit robots of any number of rods."""
    made = varied(robot)
    frees = catalogue(made)
    assert {f"mass.{len(made.rods) - 1}", f"friction.cap{made.n_caps - 1}"} <= set(frees)
    whole = [
        free for name, free in frees.items() if name in ("motor_speed", "friction", "mass", "com.5", "rest_length")
    ]
    mapping = Mapping(made, whole)
    own = parameters_of(made)
    theta = mapping.theta(np.array([free.start for free in whole]))
    for name in shapes(mapping.structure):
        assert torch.equal(value(theta, name), value(own, name)), name


def test_a_robot_without_sensor_tendons_has_none_to_free() -> None:
    """What the robot lacks is not in its catalogue."""
    assert not [name for name in catalogue(threebar()) if name.startswith("tendon_stiffness") and "factor" not in name]


def test_a_number_on_its_bound_starts_inside() -> None:
    """Restitution 0 in robot.toml: the fit starts a tenth of the prior's scale above it."""
    assert catalogue(threebar())["restitution"].start == pytest.approx(0.03)
    assert catalogue(threebar())["motor_lag"].start == pytest.approx(0.005)
    assert catalogue(threebar())["motor_lag.tau_s"].start == pytest.approx(0.005)


def test_a_fit_of_a_grain_or_a_patch_begins_with_one() -> None:
    """While its ratio is 1 an angle, or a place, does nothing, and a number that does nothing is not found. Without a
    fit the effect is off."""
    made = entries(varied())
    for name, start in BESIDE.items():
        assert made[name].free.start == start
        assert made[name].nominal == 1.0


def test_unknown_effects_are_refused() -> None:
    """With the name that was probably meant."""
    with pytest.raises(UsageError, match="unknown effect") as caught:
        catalogue(varied(), ("motor_lags",))
    assert "motor_lag" in caught.value.hint
