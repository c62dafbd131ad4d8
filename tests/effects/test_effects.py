"""Every effect of the catalogue: off means off, derivatives are true, and its numbers say what they are."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from r2s2r_cli.effects import CATALOGUE, Effect, with_off_values
from r2s2r_cli.effects.ground_slope import GroundSlope
from r2s2r_cli.engine import Channel, State, end_caps, flat_step, pack_parameters, pack_state, tilted
from r2s2r_cli.engine.trace_key import trace_key
from tests.support import parity
from tests.support.engine import lowest_gap, random_gait, simulator
from tests.support.phases import STEP, expanded, phases, raised, shaken, stirred
from tests.support.variants import Variant, pair, plugged, robot

EFFECTS = pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)


@pytest.fixture(scope="module")
def nominal() -> Variant:
    """The 3-bar robot without effects."""
    return robot()


def falling(model: Variant, n: int) -> State:
    """The robot near the ground with some speed, so that caps hit and slip and cables work."""
    start = replace(model.start, rest=0.97 * model.start.rest)
    moving = shaken(start, n, seed=3, position=0.002, angle=0.05, speed=0.3, spin=1.0)
    moving = replace(moving, v_WB=moving.v_WB - moving.v_WB.new_tensor([0.0, 0.0, 0.5]))
    moving = raised(moving, 1e-4 - lowest_gap(model.theta, moving))
    return replace(stirred(moving, torch.Generator().manual_seed(1)), extra=moving.extra)


def after_steps(model: Variant, start: State, steps: int) -> Tensor:
    """The nominal numbers of the state after some steps in torch, (B, n)."""
    u = random_gait(1, model.structure.n_actuated, batch=len(start.p_WB), seed=2)[:, 0]
    s, p = pack_state(model.structure, start), pack_parameters(model.structure, model.theta)
    with torch.no_grad():
        for _ in range(steps):
            s = flat_step(model.structure)(s, u, p, s.new_full((len(s), 1), STEP))
    return s[:, : pack_state(robot().structure, replace(start, extra={})).shape[1]]


@EFFECTS
def test_off_is_bitwise_off(effect: Effect, nominal: Variant) -> None:
    """An effect at its off value leaves every number of the trajectories as it was, bit by bit."""
    off = plugged(nominal, effect, on=False)
    assert torch.equal(after_steps(nominal, falling(nominal, 8), 12), after_steps(off, falling(off, 8), 12))


def test_all_off_together_is_bitwise_off(nominal: Variant) -> None:
    """All effects of the catalogue plug in together, at their off values still bit by bit nothing."""
    off = plugged(nominal, *CATALOGUE, on=False)
    assert torch.equal(after_steps(nominal, falling(nominal, 8), 12), after_steps(off, falling(off, 8), 12))


@EFFECTS
def test_off_is_off_in_machine_code(effect: Effect) -> None:
    """One step in every phase of motion: at its off value an effect changes no number by 1e-12 of its size."""
    _machine_code_off(pair(rod_contact=False), effect)


@pytest.mark.slow
@pytest.mark.parametrize("effects", [*([e] for e in CATALOGUE), CATALOGUE], ids=lambda es: "+".join(e.name for e in es))
def test_off_is_off_in_machine_code_of_the_robot(effects: list[Effect]) -> None:
    """The same for the 3-bar robot, and for all effects at once."""
    _machine_code_off(robot(), *effects)


def _machine_code_off(plain: Variant, *effects: Effect) -> None:
    off = plugged(plain, *effects, on=False)
    _, states = phases(plain, simulator(plain.structure), 8)
    memory = {name: x.expand(len(states.p_WB), -1) for name, x in off.start.extra.items()}
    without, with_ = parity.problem(plain, states), parity.problem(off, replace(states, extra=memory))
    before = parity.native_step(simulator(plain.structure).kernels, without, STEP)
    now = parity.native_step(simulator(off.structure).kernels, with_, STEP)[:, : before.shape[1]]
    assert float(parity.value_error(without, now, before).max()) < 1e-12


@EFFECTS
def test_it_does_something(effect: Effect) -> None:
    """Every own parameter moves an end cap when it leaves its off value: no hook is dead."""
    off = plugged(pair(rod_contact=False), effect, on=False)
    names = [f"{effect.name}.{parameter.name}" for parameter in effect.own]
    values = {name: off.theta.extra[name].repeat(1 + len(names), 1) for name in names}
    for k, (name, parameter) in enumerate(zip(names, effect.own, strict=True)):
        values[name][k + 1] += parameter.scale
    theta = off.theta.with_values(values)
    moving = expanded(raised(off.start, 0.005 - lowest_gap(off.theta, off.start)), 1 + len(names))
    moving = replace(moving, v_WB=moving.v_WB + moving.v_WB.new_tensor([0.5, 0.3, 0.0]))
    gait = torch.tensor([[[1.0], [-1.0], [1.0]]], dtype=torch.float64).expand(len(moving.p_WB), -1, -1)
    run = simulator(off.structure).rollout(theta, moving, gait, step=STEP, hold=100, every=300)
    caps = end_caps(off.theta, run.at(-1))
    for k in range(len(names)):
        assert float((caps[k + 1] - caps[0]).abs().max()) > 1e-6, names[k]


@EFFECTS
def test_gradient_against_central_differences(effect: Effect, nominal: Variant) -> None:
    """The derivative of three steps with respect to the effect's numbers is that of central differences."""
    on = plugged(nominal, effect, on=True)
    names = [f"{effect.name}.{parameter.name}" for parameter in effect.own]
    start = pack_state(on.structure, falling(on, 4))
    weights = torch.randn(start.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)

    def outcome(values: Tensor) -> Tensor:
        parts = values.split([on.theta.extra[name].shape[1] for name in names], dim=1)
        p = pack_parameters(on.structure, on.theta.with_values(dict(zip(names, parts, strict=True))))
        s, p = start.repeat(len(values), 1), p.repeat_interleave(len(start), dim=0)
        u = s.new_full((len(s), on.structure.n_actuated), 0.7)
        for _ in range(3):
            s = flat_step(on.structure)(s, u, p, s.new_full((len(s), 1), STEP))
        return (weights.repeat(len(values), 1) * s).sum(1).reshape(len(values), -1).sum(1)

    middle = torch.cat([on.theta.extra[name] for name in names], dim=1).requires_grad_()
    (gradient,) = torch.autograd.grad(outcome(middle).sum(), middle)
    n, step = middle.shape[1], 1e-6
    with torch.no_grad():
        moved = outcome(middle + step * torch.cat([torch.eye(n), -torch.eye(n)]).to(torch.float64))
    central = (moved[:n] - moved[n:]) / (2 * step)
    assert torch.allclose(gradient[0], central, rtol=1e-5, atol=1e-8)
    assert float(gradient.abs().max()) > 1e-8


@EFFECTS
def test_it_says_what_it_is(effect: Effect) -> None:
    """Id, channel, title, signature, units and bounds with the off value inside; the docstring has all headings."""
    assert effect.channel in Channel
    assert effect.title
    assert effect.signature()
    assert effect.name
    for parameter in effect.own:
        assert parameter.lower <= parameter.off <= parameter.upper
        assert parameter.scale > 0
        assert parameter.what
    text = sys.modules[type(effect).__module__].__doc__ or ""
    for heading in ("What it is:", "Where it acts:", "Parameters:", "What it looks like", "confused with:", "Source:"):
        assert heading in text


def test_ids_are_unique() -> None:
    """No two effects of the catalogue have one name."""
    assert len({effect.name for effect in CATALOGUE}) == len(CATALOGUE)


def test_off_values_are_filled_in(nominal: Variant) -> None:
    """`with_off_values` gives every own parameter its off value, and leaves those that are given."""
    structure = nominal.structure.with_effects(*CATALOGUE)
    given = {"motor_lag.tau_s": torch.full((1, 1), 0.03, dtype=torch.float64)}
    theta = with_off_values(structure, nominal.theta.with_values(given))
    assert float(theta.extra["motor_lag.tau_s"]) == 0.03
    assert torch.equal(theta.extra["cap_friction.factor"], torch.ones(1, 6, dtype=torch.float64))


def test_slope_agrees_with_a_tilted_ground(nominal: Variant) -> None:
    """ground_slope is what the engine's tilted plane gives in the ground's own frame."""
    theta = nominal.theta
    x = {"angle_x_rad": theta.mass.new_tensor([[0.05]]), "angle_y_rad": theta.mass.new_tensor([[-0.03]])}
    by_effect = GroundSlope().parameters(x, theta).gravity[0]
    ground = tilted(0.05, -0.03)
    normal = ground.normal / torch.linalg.vector_norm(ground.normal)
    by_ground = ground.parameters(theta).gravity[0]
    assert by_effect[2] == pytest.approx(float(by_ground[2]), rel=1e-12)
    assert float(normal @ theta.gravity[0]) == pytest.approx(float(by_effect[2]), rel=1e-12)
    assert by_effect[:2] == pytest.approx(by_ground[:2].numpy(), rel=2e-3)  # the frames differ by a turn about z


def test_an_effect_changes_the_key_of_the_machine_code(nominal: Variant) -> None:
    """Kernels of a structure with and without an effect are never taken for each other."""
    keys = {trace_key(nominal.structure.with_effects(*effects)) for effects in ((), CATALOGUE[:1], CATALOGUE[1:2])}
    assert len(keys) == 3
