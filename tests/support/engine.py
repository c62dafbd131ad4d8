"""Builders for tests of the engine: a few rods and cables with plain numbers, the threebar robot, random states."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import lru_cache

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure, end_caps, step
from r2s2r_cli.engine.parameters import shapes
from r2s2r_cli.engine.rollout import Simulator
from r2s2r_cli.engine.state import state_shapes
from r2s2r_cli.engine.trajectory import Trajectory
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import parameters_of, rest_state, structure_of
from schemas.robot import Robot

torch.set_num_threads(1)  # the tensors of these tests are tiny: threads cost more than they give

G = 9.81
MASS, HALF, RADIUS, TRANSVERSE, AXIAL = 0.13, 0.16, 0.0175, 1.5e-3, 4e-5
"""The rod of these tests: mass [kg], half length [m], cap radius [m], moments across and along its axis [kg m^2]."""

Number = float | list[float] | Tensor

_DEFAULTS: dict[str, Number] = {
    "mass": MASS, "inertia": torch.diag(torch.tensor([TRANSVERSE, TRANSVERSE, AXIAL], dtype=torch.float64)),
    "p_BE": torch.tensor([[0.0, 0.0, -HALF], [0.0, 0.0, HALF]], dtype=torch.float64), "cap_radius": RADIUS,
    "rod_radius": 2e-3, "friction": 0.6, "restitution": 0.0, "impact_speed": 0.05, "rod_friction": 0.3,
    "p_BS": 0.0, "stiffness": 2000.0, "stiffness2": 0.0, "stiffness3": 0.0, "damping": 4.0, "rest": 0.1,
    "tendon_stiffness": 0.0, "tendon_rest": 0.0, "speed_in": 0.06, "speed_out": 0.06, "rest_min": 0.01,
    "rest_max": 1.0, "lag": 0.0, "droop": 0.0,
    "gravity": torch.tensor([0.0, 0.0, -G], dtype=torch.float64),
}  # fmt: skip


def free_rods(n: int = 1, **switches: bool) -> Structure:
    """Rods without cables."""
    return Structure(n_rods=n, cable_rods=(), actuated=(), **switches)


def parameters(structure: Structure, **numbers: Number) -> Parameters:
    """Parameters of the structure, float64: the rod of these tests unless a field says otherwise. A value is spread
    over the field's shape; a tensor with one axis more than the field is a batch."""
    made = {}
    for name, shape in shapes(structure).items():
        tensor = torch.as_tensor(numbers.pop(name, _DEFAULTS[name]), dtype=torch.float64)
        made[name] = tensor if tensor.ndim == len(shape) + 1 else tensor.expand(1, *shape)
    if numbers:
        raise TypeError(f"no parameter of the engine: {', '.join(numbers)}")
    return Parameters(**made)


def slope(angle: Number) -> Tensor:
    """Gravity [m/s^2] in the frame of a plane that falls towards +x by `angle` [rad], (..., 3)."""
    a = torch.as_tensor(angle, dtype=torch.float64)
    return G * torch.stack([torch.sin(a), torch.zeros_like(a), -torch.cos(a)], dim=-1)


def vector(*xyz: float) -> Tensor:
    """A float64 vector."""
    return torch.tensor(xyz, dtype=torch.float64)


def pointing(axis: Tensor) -> Tensor:
    """Quaternions (..., 4) that turn z into `axis` (..., 3), by the shortest way; not for -z."""
    axis = axis / torch.linalg.vector_norm(axis, dim=-1, keepdim=True)
    x, y, z = axis.unbind(-1)
    q = torch.stack([-y, x, torch.zeros_like(z), 1.0 + z], dim=-1)
    return q / torch.linalg.vector_norm(q, dim=-1, keepdim=True)


def state(
    structure: Structure, p: Tensor, *, axis: Tensor | None = None, q: Tensor | None = None,
    v: Tensor | None = None, w: Tensor | None = None, rest: Tensor | None = None,
) -> State:  # fmt: skip
    """A state from centres of mass p, (rod, 3) or (B, rod, 3) [m]; the rest may have fewer axes and is 0 by default.

    axis: of the rods (default x), or q: their orientation. v [m/s], w in rod axes [rad/s], rest [m] (actuated,).
    """
    p = p if p.ndim == 3 else p[None]
    if q is None:
        q = pointing(vector(1.0, 0.0, 0.0) if axis is None else axis)
    named = {"p_WB": p, "q_WR": q, "v_WB": v, "w_R": w, "rest": rest, "winding": None}
    made, extra = {}, {}
    for name, shape in state_shapes(structure).items():
        value = named.get(name)
        value = torch.zeros((), dtype=torch.float64) if value is None else value
        (extra if "." in name else made)[name] = value.expand(len(p), *shape)
    return State(**made, extra=extra)


def lying(structure: Structure, *, batch: int = 1, axis: Tensor | None = None, v: Tensor | None = None) -> State:
    """One rod that lies on both caps without gap, along x unless `axis` says otherwise."""
    return state(structure, vector(0.0, 0.0, RADIUS).expand(batch, 1, 3), axis=axis, v=v)


def roll(
    structure: Structure, theta: Parameters, start: State, steps: int, h: float | Tensor, *,
    u: Tensor | None = None, every: int = 1,
) -> list[State]:  # fmt: skip
    """The start and the state after every `every` steps, in torch. u: (B, actuated), held; h: [s] or (B, 1)."""
    h = torch.as_tensor(h, dtype=start.p_WB.dtype).reshape(-1, 1)
    u = start.p_WB.new_zeros(len(start.p_WB), structure.n_actuated) if u is None else u
    states = [start]
    for k in range(1, steps + 1):
        start = step(structure, theta, start, u, h)
        if k % every == 0:
            states.append(start)
    return states


@lru_cache(maxsize=64)
def simulator(structure: Structure) -> Simulator:
    """The simulator of a structure; its kernels are compiled once a test session."""
    return Simulator(structure)


def simulate(
    structure: Structure, theta: Parameters, start: State, steps: int, h: float, *,
    u: Tensor | None = None, every: int = 1,
) -> Trajectory:  # fmt: skip
    """A trajectory in machine code: steps of h [s], no substeps. u: (B, actuated), held throughout."""
    batch = max(len(start.p_WB), len(theta.mass))
    u = start.p_WB.new_zeros(batch, structure.n_actuated) if u is None else u
    return simulator(structure).rollout(theta, start, u[:, None], step=h, hold=steps, every=every, substeps=1)


def after(
    structure: Structure, theta: Parameters, start: State, steps: int, h: float, *, u: Tensor | None = None
) -> State:
    """The state after so many steps, in machine code."""
    return simulate(structure, theta, start, steps, h, u=u, every=steps).at(-1)


def track(states: list[State], field: str = "p_WB") -> Tensor:
    """A field of all states, (B, F, ...)."""
    return torch.stack([getattr(s, field) for s in states], dim=1)


def lowest_gap(theta: Parameters, p: State) -> Tensor:
    """Height of the lowest point of all caps above the ground [m], (B,)."""
    return (end_caps(theta, p)[..., 2] - theta.cap_radius.flatten(1)).amin(1)


@lru_cache
def threebar() -> Robot:
    """The three-bar robot of `r2s2r init`."""
    return Robot.model_validate(tomllib.loads(robot_toml("threebar")))


def threebar_engine() -> tuple[Structure, Parameters, State]:
    """Structure, parameters and rest pose of the three-bar robot. Its winches work between 0.10 m and 0.20 m here, so
    that no random gait folds the robot up."""
    robot = threebar()
    theta = parameters_of(robot)
    low, high = torch.full_like(theta.rest_min, 0.10), torch.full_like(theta.rest_max, 0.20)
    return structure_of(robot), replace(theta, rest_min=low, rest_max=high), rest_state(robot)


def random_gait(rows: int, actuated: int, *, batch: int, seed: int) -> Tensor:
    """Motor commands -1, 0 and 1, independent, (batch, rows, actuated)."""
    made = torch.randint(-1, 2, (batch, rows, actuated), generator=torch.Generator().manual_seed(seed))
    return made.to(torch.float64)


def shaken(start: State, batch: int, *, seed: int, position: float, angle: float, speed: float, spin: float) -> State:
    """Random neighbours of a state: normal offsets of positions [m], angles [rad], velocities [m/s], spins [rad/s]."""
    generator = torch.Generator().manual_seed(seed)
    rods = start.p_WB.shape[1]

    def noise() -> Tensor:
        return torch.randn(batch, rods, 3, generator=generator, dtype=torch.float64)

    turn = roma.rotvec_to_unitquat((angle * noise()).reshape(-1, 3)).reshape(batch, rods, 4)
    return State(
        p_WB=start.p_WB + position * noise(), q_WR=roma.quat_product(start.q_WR.expand(batch, -1, -1), turn),
        v_WB=start.v_WB + speed * noise(), w_R=start.w_R + spin * noise(),
        rest=start.rest.expand(batch, -1), winding=start.winding.expand(batch, -1),
    )  # fmt: skip


def roll_between(a: State, b: State) -> Tensor:
    """Angle about the rods' own axes by which b is turned against a [rad], (B, rod)."""
    between = roma.quat_product(roma.quat_conjugation(a.q_WR), b.q_WR)
    return 2 * torch.atan2(between[..., 2], between[..., 3])
