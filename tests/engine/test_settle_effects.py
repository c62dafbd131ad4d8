"""Start states of a robot with effects: settling and balancing see the robot that the effects make."""

from __future__ import annotations

import pytest
import roma
import torch
from torch import Tensor

from r2s2r_cli.effects import Effect, with_off_values
from r2s2r_cli.effects.cap_radius import CapRadius
from r2s2r_cli.effects.com_offset import ComOffset
from r2s2r_cli.effects.payload import Payload
from r2s2r_cli.effects.tendon_set import TendonSet
from r2s2r_cli.engine import Simulator, State, Structure, balance, end_caps, pose_state, read
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.roll import resting
from r2s2r_cli.engine.settle import consistent, settled
from tests.support.engine import MASS, free_rods, lying, parameters, threebar, threebar_engine
from tests.support.variants import with_memory

GRAVITY = 9.81


def made(effect: Effect, **values: float | list[float]) -> tuple[Structure, Parameters, State]:
    """The three-bar robot at rest with an effect at these values."""
    structure, theta, start = threebar_engine()
    structure = structure.with_effects(effect)
    theta = with_off_values(structure, theta)
    given = {}
    for name, value in values.items():
        field = f"{effect.name}.{name}"
        given[field] = torch.as_tensor(value, dtype=torch.float64).expand(theta.extra[field].shape)
    return structure, theta.with_values(given), with_memory(structure, start)


@pytest.mark.parametrize(
    ("effect", "values", "load", "lever"),
    [(Payload(), {"mass_kg": 0.05, "place_m": 0.0}, MASS + 0.05, 0.0), (ComOffset(), {"axial_m": 0.02}, MASS, 0.02)],
)
def test_balance_bears_the_true_weight_at_the_true_place(
    effect: Effect, values: dict[str, float], load: float, lever: float
) -> None:
    """A lying rod with a payload, or its centre of mass off: the ground's forces are those of the lever rule."""
    bare = free_rods(1, rod_contact=False)
    structure = bare.with_effects(effect)
    theta = with_off_values(structure, parameters(bare))
    theta = theta.with_values({f"{effect.name}.{k}": theta.extra[f"{effect.name}.{k}"] + x for k, x in values.items()})
    force = balance(structure, theta, lying(structure)).ground[0, :, 2]
    half = 0.16
    right = load * GRAVITY * (half + lever) / (2 * half)
    assert force.numpy() == pytest.approx([load * GRAVITY - right, right], rel=2e-3)


def test_winches_give_what_the_effect_adds() -> None:
    """Cables 4 mm longer by an effect: winches of a consistent state have wound in 4 mm more, tensions are equal."""
    structure, theta, start = made(TendonSet(), shift_m=[0.004] * 6 + [0.0] * 3)
    plain, bare, _ = made(TendonSet(), shift_m=0.0)
    with_, without = consistent(structure, theta, start), consistent(plain, bare, start)
    inside = (without.rest > bare.rest_min + 0.005) & (without.rest < bare.rest_max - 0.005)
    assert int(inside.sum()) >= 3
    assert torch.allclose(with_.rest[inside], without.rest[inside] - 0.004, rtol=0, atol=1e-9)
    now, before = (read(s, p, resting(x)).tension for s, p, x in ((structure, theta, with_), (plain, bare, without)))
    assert torch.allclose(now[:, :6][inside], before[:, :6][inside], rtol=0, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "values"),
    [(CapRadius(), {"change_m": -0.003}), (Payload(), {"mass_kg": [0.08, 0.0, 0.0], "place_m": 0.1}),
     (TendonSet(), {"shift_m": 0.003})],
)  # fmt: skip
def test_a_settled_robot_rests(effect: Effect, values: dict[str, float | list[float]]) -> None:
    """Settled from the nominal pose it does not move in the next second, and its lowest caps touch the ground."""
    structure, theta, start = made(effect, **values)
    simulator = Simulator(structure)
    caps = end_caps(theta, start)
    cable_caps = tuple((cable.caps[0], cable.caps[1]) for cable in threebar().cables)
    found = settled(simulator, theta, caps, _frames(start), cable_caps)
    still = simulator.rollout(
        theta, found.state, caps.new_zeros(1, 1, structure.n_actuated), step=1e-3, hold=1000, every=1000
    )
    moved = (still.end_caps()[0, -1] - still.end_caps()[0, 0]).norm(dim=-1)
    assert float(moved.max()) < 2e-4
    radius = theta.cap_radius.flatten(1) + values.get("change_m", 0.0)  # type: ignore[operator]
    assert float((end_caps(theta, found.state)[..., 2] - radius).amin()) == pytest.approx(0.0, abs=1e-5)


def _frames(start: State) -> Tensor:
    return roma.unitquat_to_rotmat(start.q_WR)


def test_off_a_pose_is_the_nominal_pose() -> None:
    """An effect at its off value changes no start state, bit by bit."""
    structure, theta, start = made(Payload(), mass_kg=0.0, place_m=0.1)
    plain, bare, nominal = threebar_engine()
    assert torch.equal(consistent(structure, theta, start).rest, consistent(plain, bare, nominal).rest)
    caps = end_caps(bare, nominal)
    one = pose_state(structure, theta, caps, _frames(start), rest=start.rest)
    two = pose_state(plain, bare, caps, _frames(start), rest=start.rest)
    assert torch.equal(one.p_WB, two.p_WB)
