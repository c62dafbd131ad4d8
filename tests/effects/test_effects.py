"""Every effect of the catalogue: off means off, derivatives are true, and its numbers say what they are."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import pytest
import torch

from r2s2r_cli.effects import CATALOGUE, Effect, with_off_values
from r2s2r_cli.engine import (
    Channel,
    Parameters,
    State,
    Structure,
    end_caps,
    flat_step,
    pack_parameters,
    pack_state,
    step,
    unpack_state,
)
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of
from schemas.robot import Robot

torch.set_default_dtype(torch.float64)
EFFECTS = pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)


@pytest.fixture(scope="module")
def robot() -> tuple[Structure, Parameters, State]:
    """The 3-bar robot, dropped from 1 cm with some speed, so that caps slip and cables work."""
    described = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
    state = rest_state(described)
    generator = torch.Generator().manual_seed(3)
    state = replace(
        state, p_WB=state.p_WB + torch.tensor([0.0, 0.0, 0.01]), rest=0.97 * state.rest,
        v_WB=0.3 * torch.randn(state.v_WB.shape, generator=generator),
        w_R=torch.randn(state.w_R.shape, generator=generator),
    )  # fmt: skip
    return structure_of(described), parameters_of(described), state


def _run(structure: Structure, theta: Parameters, state: State, steps: int = 60) -> torch.Tensor:
    u = torch.tensor([[1.0, -1.0, 0.5, -0.5, 0.0, 0.3]])
    for _ in range(steps):
        state = step(structure, theta, state, u, torch.full((1, 1), 1e-3))
    return pack_state(structure, state)


@EFFECTS
def test_off_is_bitwise_off(effect: Effect, robot: tuple[Structure, Parameters, State]) -> None:
    """An effect at its off value leaves every number of the trajectory as it was, bit by bit."""
    structure, theta, state = robot
    plugged = structure.with_effects(effect)
    assert torch.equal(_run(structure, theta, state), _run(plugged, with_off_values(plugged, theta), state))


@EFFECTS
def test_it_does_something(effect: Effect, robot: tuple[Structure, Parameters, State]) -> None:
    """Every own parameter moves an end cap when it leaves its off value: no hook is dead."""
    structure, theta, state = robot
    plugged = structure.with_effects(effect)
    off = with_off_values(plugged, theta)
    nominal = unpack_state(plugged, _run(plugged, off, state, 200))
    for parameter in effect.own:
        name = f"{effect.name}.{parameter.name}"
        changed = off.with_values({name: off.extra[name] + parameter.scale})
        moved = unpack_state(plugged, _run(plugged, changed, state, 200))
        assert (end_caps(theta, moved) - end_caps(theta, nominal)).abs().max() > 1e-6


@EFFECTS
def test_gradient_against_central_differences(effect: Effect, robot: tuple[Structure, Parameters, State]) -> None:
    """The derivative of a step with respect to the effect's numbers is that of central differences."""
    structure, theta, state = robot
    plugged = structure.with_effects(effect)
    off = with_off_values(plugged, theta)
    state = replace(state, p_WB=state.p_WB - torch.tensor([0.0, 0.0, 0.0104]))
    weights = torch.randn(1, pack_state(plugged, state).shape[1], generator=torch.Generator().manual_seed(1))

    def outcome(values: torch.Tensor) -> torch.Tensor:
        start, extra = 0, {}
        for parameter in effect.own:
            n = parameter.count(plugged)
            extra[f"{effect.name}.{parameter.name}"] = values[None, start : start + n]
            start += n
        p = pack_parameters(plugged, off.with_values(extra))
        s = pack_state(plugged, state)
        for _ in range(3):
            s = flat_step(plugged)(s, torch.full((1, 6), 0.7), p, torch.full((1, 1), 1e-3))
        return (weights * s).sum()

    middle = torch.cat([off.extra[f"{effect.name}.{p.name}"][0] + 0.5 * p.scale for p in effect.own])
    gradient = torch.autograd.functional.jacobian(outcome, middle)
    for k in range(len(middle)):
        unit = torch.zeros_like(middle)
        unit[k] = 1e-6
        central = (outcome(middle + unit) - outcome(middle - unit)) / 2e-6
        assert gradient[k] == pytest.approx(float(central), rel=1e-5, abs=1e-8)


@EFFECTS
def test_it_says_what_it_is(effect: Effect) -> None:
    """Id, channel, title, signature, units and bounds with the off value inside; the docstring has all headings."""
    import sys

    assert effect.channel in Channel and effect.title and effect.signature() and effect.name
    for parameter in effect.own:
        assert parameter.lower <= parameter.off <= parameter.upper and parameter.scale > 0 and parameter.what
    text = sys.modules[type(effect).__module__].__doc__ or ""
    for heading in ("What it is:", "Where it acts:", "Parameters:", "What it looks like", "confused with:", "Source:"):
        assert heading in text


def test_ids_are_unique_and_effects_combine(robot: tuple[Structure, Parameters, State]) -> None:
    """All effects of the catalogue plug in together, at their off values still bit by bit nothing."""
    structure, theta, state = robot
    assert len({effect.name for effect in CATALOGUE}) == len(CATALOGUE)
    plugged = structure.with_effects(*CATALOGUE)
    assert torch.equal(_run(structure, theta, state), _run(plugged, with_off_values(plugged, theta), state))


def test_slope_agrees_with_a_tilted_ground(robot: tuple[Structure, Parameters, State]) -> None:
    """ground_slope is what the engine's tilted plane gives in the ground's own frame."""
    from r2s2r_cli.effects.ground_slope import GroundSlope
    from r2s2r_cli.engine.ground import tilted

    theta = robot[1]
    x = {"angle_x_rad": torch.tensor([[0.05]]), "angle_y_rad": torch.tensor([[-0.03]])}
    by_effect = GroundSlope().parameters(x, theta).gravity[0]
    ground = tilted(0.05, -0.03)
    normal = ground.normal / torch.linalg.vector_norm(ground.normal)
    by_ground = ground.parameters(theta).gravity[0]
    assert by_effect[2] == pytest.approx(float(by_ground[2]), rel=1e-12)
    assert float(normal @ theta.gravity[0]) == pytest.approx(float(by_effect[2]), rel=1e-12)
    assert by_effect[:2] == pytest.approx(by_ground[:2].numpy(), rel=2e-3)  # the frames differ by a turn about z
