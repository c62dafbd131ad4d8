"""Every effect of the catalogue: off means off, derivatives are true, and its numbers say what they are."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects import CATALOGUE, FURTHER, Effect, with_off_values
from r2s2r_cli.engine import Channel, Simulator, State, flat_step, observe, pack_parameters, pack_state, sense
from r2s2r_cli.engine.trace_key import trace_key
from tests.support import parity
from tests.support.engine import lowest_gap, random_gait, simulator
from tests.support.phases import STEP, phases, raised, shaken, stirred
from tests.support.variants import Variant, pair, plugged, robot

ALL = (*CATALOGUE, *FURTHER)
EFFECTS = pytest.mark.parametrize("effect", ALL, ids=lambda effect: effect.name)
OUTSIDE = ("command_latency", "sensor_bias", "sensor_gain", "camera_pose", "camera_scale", "camera_delay", "dropout",
           "sensor_saturation")  # fmt: skip
"""Effects that the step does not see: they act before it, or on what is read off its states."""
DESIGN = [
    "motor_dead_zone", "command_latency", "motor_lag", "motor_speed_mismatch", "battery_sag", "load_droop",
    "spool_buildup", "backlash", "tendon_stiffness", "tendon_relaxation", "tendon_set", "com_offset", "payload",
    "friction_field", "rolling_resistance", "soft_ground", "cap_friction", "cap_radius", "ground_slope", "tether_drag",
    "sensor_bias", "sensor_gain", "camera_pose", "camera_scale", "camera_delay", "dropout",
]  # fmt: skip
SECOND = [
    "tendon_hysteresis", "capstan_friction", "attachment_offset", "friction_anisotropy", "stribeck", "viscous_contact",
    "obstacle", "air_drag", "sensor_saturation",
]  # fmt: skip


@pytest.fixture(scope="module")
def nominal() -> Variant:
    """The 3-bar robot without effects."""
    return robot()


@pytest.fixture(scope="module")
def bare(nominal: Variant) -> Tensor:
    """Its states after some steps."""
    return after_steps(nominal, nominal)


@pytest.fixture(scope="module")
def whole(nominal: Variant) -> Variant:
    """The same with all effects, every number away from its off value."""
    return plugged(nominal, *ALL, on=True)


def falling(model: Variant, n: int) -> State:
    """The robot near the ground with some speed, so that caps hit and slip and cables work; effects remember things."""
    start = replace(model.start, rest=0.97 * model.start.rest)
    moving = shaken(start, n, seed=3, position=0.002, angle=0.05, speed=0.3, spin=1.0)
    moving = replace(moving, v_WB=moving.v_WB - moving.v_WB.new_tensor([0.0, 0.0, 0.5]))
    moving = raised(moving, 1e-4 - lowest_gap(model.theta, moving))
    extra = dict(moving.extra)
    remembered = {
        "backlash.way": -1.0, "backlash.travel": 0.05, "rolling_resistance.force": 2.0, "battery_sag.charge": 9.0,
        "obstacle.force": 2.0, "tendon_relaxation.stretch": 1e-3, "soft_ground.sunk": 1e-4,
    }  # fmt: skip
    extra |= {name: torch.full_like(extra[name], value) for name, value in remembered.items() if name in extra}
    return replace(stirred(moving, torch.Generator().manual_seed(1)), extra=extra)


def after_steps(model: Variant, nominal: Variant, steps: int = 4) -> Tensor:
    """The nominal numbers of the state after some steps in torch, (B, n)."""
    start = falling(nominal, 4)
    count = pack_state(nominal.structure, start).shape[1]
    start = replace(start, extra={name: x.expand(4, -1) for name, x in model.start.extra.items()})
    u = random_gait(1, model.structure.n_actuated, batch=4, seed=2)[:, 0]
    s, p = pack_state(model.structure, start), pack_parameters(model.structure, model.theta)
    with torch.no_grad():
        for _ in range(steps):
            s = flat_step(model.structure)(s, u, p, s.new_full((len(s), 1), STEP))
    return s[:, :count]


def test_the_catalogue_is_the_designs() -> None:
    """All ids of the first release, in the order of the design, each in a file of its name."""
    assert [effect.name for effect in CATALOGUE] == DESIGN
    assert [effect.name for effect in FURTHER] == SECOND
    assert all(type(effect).__module__.endswith(f".{effect.name}") for effect in ALL)


@EFFECTS
def test_off_is_bitwise_off(effect: Effect, nominal: Variant, bare: Tensor) -> None:
    """An effect at its off value leaves every number of the trajectories as it was, bit by bit."""
    assert torch.equal(bare, after_steps(plugged(nominal, effect, on=False), nominal))


def test_all_off_together_is_bitwise_off(nominal: Variant, bare: Tensor) -> None:
    """All effects of the catalogue plug in together, at their off values still bit by bit nothing."""
    off = plugged(nominal, *ALL, on=False)
    assert torch.equal(bare, after_steps(off, nominal))


@EFFECTS
def test_off_is_bitwise_off_outside_the_step(effect: Effect, nominal: Variant) -> None:
    """Commands that arrive, lengths that are read and caps that are seen are what they are without the effect."""
    off = plugged(nominal, effect, on=False)
    t = torch.linspace(0.0, 0.4, 9, dtype=torch.float64)
    p_WE = torch.randn(1, 9, 6, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    assert torch.equal(observe(off.structure, off.theta, t, p_WE), p_WE)
    assert torch.equal(sense(off.structure, off.theta, p_WE[:, :, 0].abs().repeat(1, 1, 3), t[:, None]),
                       p_WE[:, :, 0].abs().repeat(1, 1, 3))  # fmt: skip
    if effect.name == "command_latency":
        runs = [
            Simulator(model.structure, native=False)
            .rollout(model.theta, model.start, random_gait(2, 6, batch=1, seed=2), step=STEP, hold=2, every=4)
            .states.p_WB
            for model in (nominal, off)
        ]
        assert torch.equal(*runs)


def test_off_is_off_in_machine_code() -> None:
    """One step in every phase of motion: at their off values effects change no number by 1e-12 of its size."""
    _machine_code_off(pair(rod_contact=False), *ALL)


@pytest.mark.slow
def test_off_is_off_in_machine_code_of_the_robot() -> None:
    """The same for the 3-bar robot."""
    _machine_code_off(robot(), *ALL)


def _machine_code_off(plain: Variant, *effects: Effect) -> None:
    off = plugged(plain, *effects, on=False)
    _, states = phases(plain, simulator(plain.structure), 8)
    memory = {name: x.expand(len(states.p_WB), -1) for name, x in off.start.extra.items()}
    without, with_ = parity.problem(plain, states), parity.problem(off, replace(states, extra=memory))
    before = parity.native_step(simulator(plain.structure).kernels, without, STEP)
    now = parity.native_step(simulator(off.structure).kernels, with_, STEP)[:, : before.shape[1]]
    assert float(parity.value_error(without, now, before).max()) < 1e-12


def test_every_number_has_its_true_derivative(whole: Variant) -> None:
    """Three steps with all effects on: the derivative by every number of every effect is that of central differences,
    and none is 0. A number that did nothing would be a dead hook."""
    # These caps slide too fast for a usual Stribeck speed to tell.
    slow = {"stribeck.speed_m_per_s": torch.full((1, 1), 0.19, dtype=torch.float64)}
    whole = replace(whole, theta=whole.theta.with_values(slow))
    names = [name for name in whole.theta.extra if not name.startswith(OUTSIDE)]
    moving = falling(whole, 4)
    # The play is taken up within these steps.
    travel = (whole.theta.extra["backlash.play_m"] - 1e-4).expand(4, -1)
    start = pack_state(whole.structure, replace(moving, extra={**moving.extra, "backlash.travel": travel}))
    weights = torch.randn(start.shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    threshold = whole.theta.extra["motor_dead_zone.threshold"]
    # Half the winches at the edge of their dead zone, half paying out at full speed after a reversal.
    u = torch.where(torch.arange(6) % 2 == 0, threshold - 0.01, -torch.ones_like(threshold))

    def outcome(values: Tensor) -> Tensor:
        parts = values.split([whole.theta.extra[name].shape[1] for name in names], dim=1)
        p = pack_parameters(whole.structure, whole.theta.with_values(dict(zip(names, parts, strict=True))))
        s, p = start.repeat(len(values), 1), p.repeat_interleave(len(start), dim=0)
        for _ in range(3):
            s = flat_step(whole.structure)(s, u.expand(len(s), -1), p, s.new_full((len(s), 1), STEP))
        return (weights.repeat(len(values), 1) * s).sum(1).reshape(len(values), -1).sum(1)

    middle = torch.cat([whole.theta.extra[name] for name in names], dim=1).requires_grad_()
    (gradient,) = torch.autograd.grad(outcome(middle).sum(), middle)
    n = middle.shape[1]
    scales = {f"{effect.name}.{one.name}": one.scale for effect in ALL for one in effect.own}
    counts = [whole.theta.extra[name].shape[1] for name in names]

    def central(share: float) -> Tensor:
        size = torch.cat([torch.full_like(whole.theta.extra[name], share * scales[name]) for name in names], dim=1)
        with torch.no_grad():
            moved = outcome(middle + torch.cat([torch.diag(size[0]), -torch.diag(size[0])]))
        return (moved[:n] - moved[n:]) / (2 * size[0])

    # A step may carry a cap over the edge of its contact, a smaller one tells small derivatives less well.
    differences = [central(share).split(counts) for share in (1e-4, 1e-5)]
    for name, ours, *both in zip(names, gradient[0].split(counts), *differences, strict=True):
        unit = float(both[0].abs().max())
        assert any(torch.allclose(ours, one, rtol=1e-4, atol=1e-4 * unit + 1e-9) for one in both), name
        assert unit > 1e-9, name


@pytest.mark.slow
def test_every_number_moves_the_robot(nominal: Variant) -> None:
    """A gait of 2.4 s on the example robot, and again upside down: every number of every effect, by itself away from
    its off value, moves an end cap, a length that is read or a cap that is seen."""
    off = plugged(nominal, *ALL, on=False)
    around, mirror = off.start.q_WR.new_tensor([1.0, 0.0, 0.0, 0.0]), off.start.p_WB.new_tensor([1.0, -1.0, -1.0])
    turned = roma.quat_product(around.expand_as(off.start.q_WR), off.start.q_WR)
    over = replace(off.start, q_WR=turned, p_WB=off.start.p_WB * mirror)
    starts = [off.start, raised(over, 0.001 - lowest_gap(off.theta, over))]
    aided = {
        "payload.mass_kg": 0.05, "payload.place_m": 0.1, "friction_field.patch_factor": 0.4,
        "tendon_relaxation.share": 0.3, "soft_ground.compliance_m_per_n": 1e-3, "tether_drag.force_n": 0.2,
        "friction_anisotropy.ratio": 1.3, "stribeck.static_factor": 1.2, "tendon_hysteresis.force_n": 1.0,
        "obstacle.height_m": 0.005, "sensor_saturation.top_share": 0.5, "sensor_saturation.top_m": 0.15,
        "sensor_saturation.bottom_share": 0.5, "sensor_saturation.bottom_m": 0.25,
    }  # fmt: skip
    found = {}
    for effect in ALL:
        own = {f"{effect.name}.{one.name}": one for one in effect.own}
        base = {name: off.theta.extra[name].clone() for name in own}
        help_ = {name: torch.full_like(base[name], aided[name]) for name in own if name in aided and len(own) > 1}
        rows, labels = [base], ["off"]
        for name, parameter in own.items():
            for k in range(base[name].shape[1]):
                # Beside what gives it something to do: a place needs a mass, a radius a patch.
                start = {**base, **help_}
                moved = {**start, name: start[name].clone()}
                moved[name][:, k] += 0.5 * parameter.scale
                rows += [start, moved]
                labels.append(f"{name}.{k}")
        theta = off.theta.with_values({name: torch.cat([row[name] for row in rows]) for name in own})
        u = torch.sin(torch.arange(24, dtype=torch.float64)[:, None] * 0.7 + torch.arange(6)).sign()[None] * 0.9
        u[:, 12:18] = 0.05
        commands = u.expand(len(rows), -1, -1)
        runs = [
            simulator(off.structure).rollout(theta, start, commands, step=STEP, hold=100, every=20) for start in starts
        ]
        caps = torch.cat([torch.nan_to_num(run.observed(), nan=9.0) for run in runs], dim=1)
        length = sense(off.structure, theta, caps.new_full((len(rows), 9), 0.2), 1.0)
        seen = torch.cat([caps.flatten(1), length], dim=1)
        for k, label in enumerate(labels[1:]):
            found[label] = float((seen[2 * k + 2] - seen[2 * k + 1]).abs().max())
    dead = {label: size for label, size in found.items() if size < 1e-6}
    assert not dead, dead
    assert len(found) == sum(x.shape[1] for x in off.theta.extra.values())


@EFFECTS
def test_it_says_what_it_is(effect: Effect) -> None:
    """Id, channel, title, signature, units and bounds with the off value inside; the docstring has all headings."""
    assert effect.channel in Channel
    assert effect.title
    assert effect.signature()
    assert effect.name
    assert set(effect.look_alikes) < {*DESIGN, *SECOND} - {effect.name}
    sizes = [parameter for parameter in effect.own if not parameter.only_shape]
    # A fit begins beside off with one of those that give a shape something to do.
    begun = [one.start not in (None, one.off) or one.off in (one.lower, one.upper) for one in sizes]
    assert any(begun) if len(sizes) < len(effect.own) else sizes
    for parameter in effect.own:
        assert parameter.lower <= parameter.off <= parameter.upper
        assert all(float(f"{bound:.4g}") == bound for bound in (parameter.lower, parameter.upper))  # as they are typed
        assert 0 < parameter.scale <= parameter.upper - parameter.lower
        assert parameter.what
    text = sys.modules[type(effect).__module__].__doc__ or ""
    for heading in ("What it is:", "Where it acts:", "Parameters:", "What it looks like", "confused with:", "Source:"):
        assert heading in text
    assert ".md" not in text  # a source is what a reader can open: literature, the paper, plain physics


def test_off_values_are_filled_in(nominal: Variant) -> None:
    """`with_off_values` gives every own parameter its off value, and leaves those that are given."""
    structure = nominal.structure.with_effects(*ALL)
    given = {"motor_lag.tau_s": torch.full((1, 1), 0.03, dtype=torch.float64)}
    theta = with_off_values(structure, nominal.theta.with_values(given))
    assert float(theta.extra["motor_lag.tau_s"]) == 0.03
    assert torch.equal(theta.extra["cap_friction.factor"], torch.ones(1, 6, dtype=torch.float64))


def test_an_effect_changes_the_key_of_the_machine_code(nominal: Variant) -> None:
    """Kernels of a structure with and without an effect are never taken for each other."""
    keys = {trace_key(nominal.structure.with_effects(*effects)) for effects in ((), CATALOGUE[:1], CATALOGUE[1:2])}
    assert len(keys) == 3
