"""How far machine code, torch and central differences agree, and how large derivatives of long gaits are: functions."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import gettempdir

import numpy as np
import torch
from torch import Tensor

from r2s2r_cli.engine import (
    LatchedPid,
    Parameters,
    Simulator,
    State,
    Structure,
    closed_loop,
    end_caps,
    pack_parameters,
    pack_state,
    settled,
    unpack_state,
)
from r2s2r_cli.stages.init.attachment import rod_frames
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.model import parameters_of, structure_of
from schemas.robot import Robot

STEP = 1e-3
"""[s]"""
TIMES = (1.0, 2.0, 5.0, 10.0)
"""[s] at which derivatives are reported."""


@dataclass(frozen=True)
class Bench:
    """A settled robot, and the gaits of seeded random policies: commands (seed, tick, actuated), each held `hold`
    steps; start: batch 1."""

    structure: Structure
    theta: Parameters
    simulator: Simulator
    start: State
    commands: Tensor
    hold: int


def bench(name: str = "threebar", *, seeds: int = 8, seconds: float = 10.0, cache_dir: Path | None = None) -> Bench:
    """The robot, and closed-loop runs of random binary shapes, replayed by their motor commands."""
    robot = Robot.model_validate(tomllib.loads(robot_toml(name)))
    structure, theta = structure_of(robot), parameters_of(robot)
    simulator = Simulator(structure, cache_dir=cache_dir or Path(gettempdir()) / "r2s2r-accuracy")
    p_WE, pid = np.array(robot.rest_caps_m), robot.pid
    cable_caps = tuple(cable.caps for cable in robot.cables)
    start = settled(simulator, theta, torch.tensor(p_WE)[None], torch.tensor(rod_frames(p_WE))[None], cable_caps).state
    controller = LatchedPid(
        p=pid.p, i=pid.i, d=pid.d, tolerance=pid.tolerance, min_length=pid.min_length_m, range=pid.range_m,
        period=1 / pid.rate_hz, cable_caps=cable_caps, actuated=robot.actuated,
    )  # fmt: skip
    ticks = round(seconds * pid.rate_hz)
    gaits = []
    for seed in range(seeds):
        # A shape takes some 2 s: these are more than 10 s.
        shapes = torch.randint(0, 2, (12, structure.n_actuated), generator=torch.Generator().manual_seed(seed))
        none, most = torch.zeros(len(shapes)), torch.full((len(shapes),), pid.step_timeout_s)
        with torch.no_grad():
            run = closed_loop(simulator, theta, start, controller, shapes.to(torch.float64), none, most, step=STEP)
        if run.u.shape[1] < ticks:
            raise RuntimeError(f"the policy of seed {seed} is through after {run.u.shape[1]} of {ticks} ticks")
        gaits.append(run.u[0, :ticks])
    return Bench(structure, theta, simulator, start, torch.stack(gaits), round(1 / (pid.rate_hz * STEP)))


PARAMETERS = (
    "mass", "inertia", "winched stiffness", "passive stiffness", "damping", "friction", "speed in", "speed out",
    "passive rest length", "cap radius",
)  # fmt: skip
"""What derivatives are taken by: factors, as logarithms."""


def scaled(b: Bench, x: Tensor) -> Parameters:
    """The robot's parameters times e^x, x (B, 10) as in PARAMETERS."""
    theta = b.theta
    mass, inertia, winched, passive, damping, friction, inward, outward, rest, radius = (
        torch.exp(x).unsqueeze(-1).unbind(1)
    )
    which = torch.zeros(b.structure.n_cables, dtype=torch.bool)
    which[list(b.structure.actuated)] = True
    return replace(
        theta, mass=theta.mass * mass, inertia=theta.inertia * inertia[..., None, None],
        stiffness=theta.stiffness * torch.where(which, winched, passive), damping=theta.damping * damping,
        friction=theta.friction * friction[..., None], speed_in=theta.speed_in * inward,
        speed_out=theta.speed_out * outward, rest=theta.rest * rest, cap_radius=theta.cap_radius * radius[..., None],
    )  # fmt: skip


def start_of(b: Bench, x: Tensor) -> Tensor:
    """The start as a flat state, (B, NS), for x (B, 10): the robot is raised with the radius of its caps.

    Else they would stand in the ground or above it, and gap 0 is a kink: the derivatives of both sides differ.
    """
    up = float(b.theta.cap_radius[0, 0, 0]) * (torch.exp(x[:, -1]) - 1)
    p_WB = b.start.p_WB + torch.stack([torch.zeros_like(up), torch.zeros_like(up), up], dim=-1)[:, None]
    flat = pack_state(b.structure, b.start).expand(len(x), -1)
    return torch.cat([p_WB.flatten(1), flat[:, p_WB[0].numel() :]], dim=1)


def directions(b: Bench) -> tuple[Tensor, Tensor]:
    """Derivatives by the ten numbers of the flat parameters, (NP, 10), and of the flat start, (NS, 10)."""
    zero = torch.zeros(1, len(PARAMETERS), dtype=torch.float64)
    jacobian = torch.autograd.functional.jacobian
    dp = jacobian(lambda x: pack_parameters(b.structure, scaled(b, x))[0], zero)[:, 0]
    return dp, jacobian(lambda x: start_of(b, x)[0], zero)[:, 0]


def caps(b: Bench, flat: Tensor) -> Tensor:
    """End caps [m], (B, F, cap, 3), of flat states (B, F, NS)."""
    batch, frames = flat.shape[:2]
    theta = b.theta.map(lambda x: x.expand(batch * frames, *x.shape[1:]))
    return end_caps(theta, unpack_state(b.structure, flat.flatten(0, 1))).unflatten(0, (batch, frames))


def growth(b: Bench, seconds: float, every: float) -> tuple[Tensor, Tensor]:
    """Times [s], (F,), and the largest distance of a cap between machine code and torch [m], (gait, F)."""
    n = len(b.commands)
    s0 = pack_state(b.structure, b.start).expand(n, -1)
    u = b.commands[:, : round(seconds / (STEP * b.hold))]
    p, stride = pack_parameters(b.structure, b.theta), round(every / STEP)
    ours = b.simulator.kernels.forward(s0, u, p, h=STEP, hold=b.hold, every=stride)
    with torch.no_grad():
        reference = b.simulator.kernels.torch_rollout(s0, u, p, h=STEP, hold=b.hold, every=stride)
    apart = torch.linalg.vector_norm(caps(b, ours) - caps(b, reference), dim=-1).amax(-1)
    return every * torch.arange(apart.shape[1], dtype=torch.float64), apart


@dataclass(frozen=True)
class Derivatives:
    """Of rod positions at TIMES. by_parameter: [m] per logarithm, (gait, time, rod x 3, 10); by_start: [m/m] by the
    positions at the start, (gait, time, rod x 3, rod x 3)."""

    by_parameter: Tensor
    by_start: Tensor


def derivatives(b: Bench, times: Sequence[float] = TIMES) -> Derivatives:
    """Forward sensitivities of the replayed gaits, everything in one pass a gait."""
    slots = b.structure.n_rods * 3
    dp, d_start = directions(b)
    d_state = torch.cat([d_start, torch.eye(len(d_start), slots, dtype=torch.float64)], dim=1)
    dp = torch.cat([dp, dp.new_zeros(len(dp), slots)], dim=1)
    stride = round(times[0] / STEP)
    u = b.commands[:, : round(times[-1] / (STEP * b.hold))]
    _, tangents = b.simulator.jvp(
        b.theta, b.start, u, d_parameters=dp, d_state=d_state, step=STEP, hold=b.hold, every=stride
    )
    frames = [round(t / (stride * STEP)) for t in times]
    whole = tangents[:, frames, :slots]
    return Derivatives(whole[..., : len(PARAMETERS)], whole[..., len(PARAMETERS) :])


def backward_derivatives(b: Bench, seconds: float) -> Tensor:
    """Derivatives of positions by the parameters, by the backward kernel, (gait, rod x 3, 10): one pass a position."""
    n, slots = len(b.commands), b.structure.n_rods * 3
    s0 = pack_state(b.structure, b.start).expand(n, -1)
    u = b.commands[:, : round(seconds / (STEP * b.hold))]
    dp, d_start = directions(b)
    p = pack_parameters(b.structure, b.theta).expand(n, -1)
    rows = []
    for k in range(slots):
        seeds = torch.zeros(n, 2, s0.shape[1], dtype=torch.float64)
        seeds[:, 1, k] = 1.0
        gs, _, gp = b.simulator.kernels.vjp(s0, u, p, seeds, h=STEP, hold=b.hold, every=u.shape[1] * b.hold)
        rows.append(gs @ d_start + gp @ dp)
    return torch.stack(rows, dim=1)


def secants(b: Bench, seconds: float, size: float) -> Tensor:
    """Derivatives of positions by the parameters, by central differences of machine code, (gait, rod x 3, 10)."""
    slots = b.structure.n_rods * 3
    u = b.commands[:, : round(seconds / (STEP * b.hold))]
    moves = size * torch.eye(len(PARAMETERS), dtype=torch.float64)
    x = torch.cat([moves, -moves])
    s0, p = start_of(b, x), pack_parameters(b.structure, scaled(b, x))
    found = []
    for gait in u:
        wide = gait.expand(len(p), -1, -1)
        every = gait.shape[0] * b.hold
        end = b.simulator.kernels.forward(s0, wide, p, h=STEP, hold=b.hold, every=every)[:, -1]
        found.append(((end[: len(moves), :slots] - end[len(moves) :, :slots]) / (2 * size)).T)
    return torch.stack(found)


def one_step(b: Bench, *, every: float = 0.1, seed: int = 0) -> Iterator[tuple[str, Tensor]]:
    """Relative differences of machine code and torch over one step, from states all along the gaits, (state,): of the
    next state, of a random vector-Jacobian and of a random Jacobian-vector product.

    Numbers count in units of 0.1 m, 1, 0.1 m/s, 1 rad/s, 0.1 m and 0.05 m/s (State), relative to the largest one.
    """
    kernels, n = b.simulator.kernels, len(b.commands)
    s0, p = pack_state(b.structure, b.start).expand(n, -1), pack_parameters(b.structure, b.theta)
    s = kernels.forward(s0, b.commands, p, h=STEP, hold=b.hold, every=round(every / STEP))[:, :-1].flatten(0, 1)
    generator = torch.Generator().manual_seed(seed)
    # A standing cap's gap is 0 to rounding, a kink of the step (docs/concepts/engine-accuracy.md): a little off it.
    lift = 2e-6 + 6e-6 * torch.rand(len(s), 1, generator=generator, dtype=torch.float64)
    s[:, 2 : 3 * b.structure.n_rods : 3] += lift * torch.where(torch.rand(len(s), 1, generator=generator) < 0.5, 1, -1)
    u = 2 * torch.rand(len(s), 1, b.structure.n_actuated, generator=generator, dtype=torch.float64) - 1
    rods, winches = b.structure.n_rods, b.structure.n_actuated
    sizes = [(0.1, 3 * rods), (1.0, 4 * rods), (0.1, 3 * rods), (1.0, 3 * rods), (0.1, winches), (0.05, winches)]
    unit = torch.cat([torch.full((k,), x, dtype=torch.float64) for x, k in sizes])

    def noise(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    ours = kernels.forward(s, u, p, h=STEP)[:, 1]
    h = s.new_full((len(s), 1), STEP)
    leaves = [x.detach().clone().requires_grad_() for x in (s, u[:, 0], p.expand(len(s), -1))]
    out = kernels.fn(*leaves, h)
    yield "state", _apart(ours / unit, out.detach() / unit)
    seeds = torch.zeros(len(s), 2, s.shape[1], dtype=torch.float64)
    seeds[:, 1] = noise(*s.shape) / unit
    scale = (unit, torch.ones(winches, dtype=torch.float64), p[0])
    theirs = torch.autograd.grad(out, leaves, seeds[:, 1], retain_graph=True)
    mine = kernels.vjp(s, u, p.expand(len(s), -1), seeds, h=STEP)
    yield "VJP", _apart(_joined(mine, scale), _joined(theirs, scale))
    moves = [noise(*x.shape) * k for x, k in zip(leaves, scale, strict=True)]
    ds, du, dp = (x[..., None] for x in moves)
    pushed = kernels.jvp(s, u, p, ds0=ds, du=du[:, None], dp=dp, h=STEP)[1][:, 1, :, 0]
    # Forward mode by two reverse ones: the adjoint of v -> J^T v, applied to the direction.
    v = torch.zeros_like(out, requires_grad=True)
    again = torch.autograd.grad(out, leaves, v, create_graph=True)
    (reference,) = torch.autograd.grad(again, v, moves)
    yield "JVP", _apart(pushed / unit, reference / unit)


def _joined(parts: Sequence[Tensor], scale: Sequence[Tensor]) -> Tensor:
    return torch.cat([x.flatten(1) * k for x, k in zip(parts, scale, strict=True)], dim=1)


def _apart(one: Tensor, other: Tensor) -> Tensor:
    size = torch.clamp(other.abs().amax(1), min=1.0)
    return (one - other).abs().amax(1) / size
