"""Every variant of the model, for tests that compare machine code with torch: structures with numbers that matter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import roma
import torch
from torch import Tensor

from r2s2r_cli.effects import CATALOGUE, FURTHER, Effect, with_off_values
from r2s2r_cli.engine import Detach, Parameters, State, Structure, tilted
from r2s2r_cli.engine.state import cable_ends
from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of
from tests.support import engine
from tests.support.rig_robots import known


@dataclass(frozen=True)
class Variant:
    """A model. start: a pose of it in which no two rods overlap, batch 1."""

    structure: Structure
    theta: Parameters
    start: State


def robot(name: str = "threebar", attachment: Any = "surface", **switches: Any) -> Variant:
    """A known robot; switches: fields of Structure."""
    described = known(name, attachment)
    theta = parameters_of(described)
    return Variant(replace(structure_of(described), **switches), theta, rest_state(described))


def spread(variant: Variant, field: str, low: float, high: float) -> Variant:
    """The variant with a parameter field drawn from [low, high], each number its own."""
    generator = torch.Generator().manual_seed(len(field))
    old = getattr(variant.theta, field)
    drawn = low + (high - low) * torch.rand(old.shape, generator=generator, dtype=old.dtype)
    return replace(variant, theta=replace(variant.theta, **{field: drawn}))


def cubic() -> Variant:
    """Cables whose force grows with stretch, stretch^2 and stretch^3."""
    return spread(spread(robot(cubic=True), "stiffness2", -2e3, 2e4), "stiffness3", 0.0, 2e5)


def tendons() -> Variant:
    """Sensor tendons beside all cables; some are taut in the rest pose and some are slack."""
    return spread(spread(robot(tendons=True), "tendon_stiffness", 20.0, 80.0), "tendon_rest", 0.05, 0.35)


def lag_and_droop() -> Variant:
    """Winches with lag and droop."""
    return spread(spread(robot(lag=True, droop=True), "lag", 0.01, 0.1), "droop", 0.002, 0.02)


def crooked() -> Variant:
    """Rods with caps and centres of mass off their axis and three different moments of inertia about tilted axes."""
    plain = robot(axial=False)
    generator = torch.Generator().manual_seed(5)

    def noise(*shape: int) -> Tensor:
        return torch.randn(1, *shape, generator=generator, dtype=torch.float64)

    rods = plain.structure.n_rods
    com = torch.tensor([0.004, 0.003, 0.01], dtype=torch.float64) * noise(rods, 3)
    a = torch.linalg.qr(noise(rods, 3, 3)).Q
    moments = torch.tensor([1.7e-3, 1.2e-3, 2e-4], dtype=torch.float64)
    p_BS = plain.theta.p_BS - com[:, cable_ends(plain.structure, com.device)]
    theta = replace(
        plain.theta, inertia=a @ torch.diag(moments) @ a.mT, p_BS=p_BS,
        p_BE=plain.theta.p_BE - com[:, :, None] + 0.003 * noise(rods, 2, 3),
    )  # fmt: skip
    R_WR = roma.unitquat_to_rotmat(plain.start.q_WR)
    start = replace(plain.start, p_WB=plain.start.p_WB + torch.einsum("brij,brj->bri", R_WR, com))
    return Variant(plain.structure, theta, start)


def bouncing() -> Variant:
    """Restitution 0.5, for ground and rods."""
    plain = robot()
    return replace(plain, theta=replace(plain.theta, restitution=torch.full_like(plain.theta.restitution, 0.5)))


def on_a_slope(plain: Variant) -> Variant:
    """Gravity as a tilted ground's frame sees it."""
    return replace(plain, theta=tilted(0.2, -0.15).parameters(plain.theta))


def without_winches(plain: Variant) -> Variant:
    """A robot with its motors taken out: all cables passive."""
    theta, old = plain.theta, plain.structure
    place = {k: plain.start.rest[:, i] for i, k in enumerate(old.actuated)}
    place |= {k: theta.rest[:, i] for i, k in enumerate(old.passive)}
    none = {name: getattr(theta, name)[:, :0] for name in WINCH_FIELDS}
    theta = replace(theta, rest=torch.stack([place[k] for k in range(old.n_cables)], dim=1), **none)
    start = replace(plain.start, rest=plain.start.rest[:, :0], winding=plain.start.winding[:, :0])
    return Variant(replace(old, actuated=()), theta, start)


WINCH_FIELDS = ("speed_in", "speed_out", "rest_min", "rest_max", "lag", "droop")


def free_rods(**switches: Any) -> Variant:
    """Two rods without cables."""
    structure = engine.free_rods(2, **switches)
    places = torch.tensor([[0.0, 0.0, 0.3], [0.1, 0.2, 0.35]], dtype=torch.float64)
    return Variant(structure, engine.parameters(structure, restitution=0.3), engine.state(structure, places))


def one_crooked_rod() -> Variant:
    """A single free rod without any symmetry, three sweeps."""
    structure = engine.free_rods(1, axial=False, sweeps=3)
    a = torch.linalg.qr(torch.randn(3, 3, generator=torch.Generator().manual_seed(2), dtype=torch.float64)).Q
    ends = torch.tensor([[[0.004, -0.002, -0.15], [-0.003, 0.001, 0.17]]], dtype=torch.float64)
    theta = engine.parameters(structure, inertia=a @ torch.diag(engine.vector(1.5e-3, 1.2e-3, 2e-4)) @ a.T, p_BE=ends)
    return Variant(structure, theta, engine.state(structure, engine.vector(0.0, 0.0, 0.3)[None]))


def pair(**switches: Any) -> Variant:
    """Two rods, an actuated and two passive cables: small, compiles in a second."""
    structure = Structure(n_rods=2, cable_rods=((0, 1), (1, 0), (0, 1)), actuated=(1,), **switches)
    ends = torch.tensor(
        [
            [[0.017, 0.0, 0.16], [-0.01, 0.014, 0.16]],
            [[0.0, 0.016, -0.16], [0.017, 0.0, -0.16]],
            [[0.0, -0.017, 0.15], [0.0, 0.017, -0.15]],
        ],
        dtype=torch.float64,
    )
    theta = engine.parameters(
        structure, p_BS=ends, rest=0.19, restitution=0.4, stiffness2=4e3, stiffness3=1e5, tendon_stiffness=30.0,
        tendon_rest=0.18, lag=0.03 * structure.lag, droop=0.01 * structure.droop,
    )  # fmt: skip
    places = torch.tensor([[0.0, 0.0, 0.3], [0.0, 0.2, 0.3]], dtype=torch.float64)
    rest = torch.tensor([0.19], dtype=torch.float64)
    axes = torch.tensor([[1.0, 0.1, 0.2], [0.9, -0.2, 0.1]], dtype=torch.float64)
    return Variant(structure, theta, engine.state(structure, places, axis=axes, rest=rest))


def plugged(variant: Variant, *effects: Effect, on: bool) -> Variant:
    """The variant with effects, at their off values or each number away from its own by up to its scale."""
    structure = variant.structure.with_effects(*effects)
    theta = with_off_values(structure, variant.theta)
    if on:
        theta = theta.with_values(shifted(structure, theta, *effects))
    return Variant(structure, theta, with_memory(structure, variant.start))


def shifted(structure: Structure, theta: Parameters, *effects: Effect) -> dict[str, Tensor]:
    """Values of all own parameters of the effects, above their off values by 0.3 to 0.9 of their scales."""
    generator = torch.Generator().manual_seed(9)
    values = {}
    for effect in effects:
        for parameter in effect.own:
            name = f"{effect.name}.{parameter.name}"
            share = 0.3 + 0.6 * torch.rand(1, parameter.count(structure), generator=generator, dtype=torch.float64)
            values[name] = torch.clamp(theta.extra[name] + share * parameter.scale, parameter.lower, parameter.upper)
    return values


def with_memory(structure: Structure, state: State) -> State:
    """The state with the effects' own states at 0."""
    extra = {
        f"{effect.name}.{key}": state.p_WB.new_zeros(len(state.p_WB), n)
        for effect in structure.effects
        for key, n in effect.state_sizes(structure).items()
    }
    return replace(state, extra=extra)


SMALL: dict[str, Callable[[], Variant]] = {
    "pair": pair,
    "pair, every law": lambda: plugged(
        pair(cubic=True, tendons=True, axial=False, lag=True, droop=True, sweeps=3), *CATALOGUE, *FURTHER, on=True
    ),
    "free rods": free_rods,
    "one crooked rod": one_crooked_rod,
    "pair, no rod contact": lambda: pair(rod_contact=False, detach=Detach.GEOMETRY),
    "pair, detach impulse": lambda: pair(detach=Detach.IMPULSE),
    "pair on a slope, no winches": lambda: on_a_slope(without_winches(pair())),
}
"""Small ones that show most: quick to compile."""

VARIANTS: dict[str, Callable[[], Variant]] = {
    "threebar": robot,
    "cubic cables": cubic,
    "sensor tendons": tendons,
    "lag and droop": lag_and_droop,
    "crooked rods": crooked,
    "no rod contact": lambda: robot(rod_contact=False),
    "crooked, no rod contact": lambda: replace(crooked(), structure=robot(axial=False, rod_contact=False).structure),
    "detach geometry": lambda: robot(detach=Detach.GEOMETRY),
    "detach impulse": lambda: robot(detach=Detach.IMPULSE),
    "three sweeps": lambda: robot(sweeps=3),
    "restitution": bouncing,
    "tilted ground": lambda: on_a_slope(robot()),
    "rod ends": lambda: robot(attachment="rod_end"),
    "sixbar": lambda: robot("sixbar"),
    "no winches": lambda: without_winches(robot()),
    "all effects off": lambda: plugged(robot(), *CATALOGUE, *FURTHER, on=False),
    "all effects on": lambda: plugged(robot(), *CATALOGUE, *FURTHER, on=True),
}


@lru_cache(maxsize=4)
def variant(name: str) -> Variant:
    """A variant by its name."""
    return (VARIANTS | SMALL)[name]()
