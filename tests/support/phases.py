"""States in every phase of motion, for tests of one step: in flight, at rest, in impact, sliding, in the middle of a
gait, two rods touching. None lies on a switch to rounding (see `off_the_switch`)."""

from __future__ import annotations

from dataclasses import fields, replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, Simulator, State, pack_parameters, pack_state, unpack_state
from tests.support import engine
from tests.support.engine import lowest_gap, pointing, random_gait
from tests.support.variants import Variant

STEP = 1e-3
"""[s] of every step in these tests."""
MEMORY = {"soft_ground.sunk": 1e-6}
"""By how much memories are stirred, where 0.01 would lift the ground from below the caps."""


def phases(variant: Variant, simulator: Simulator, n: int, *, seed: int = 0) -> tuple[dict[str, slice], State]:
    """n states of each phase in one batch, and where each phase is. simulator: of the variant's structure."""
    structure, theta, start = variant.structure, variant.theta, variant.start
    generator = torch.Generator().manual_seed(seed)
    flying = shaken(start, n, seed=seed, position=0.01, angle=0.2, speed=0.5, spin=5.0)
    flying = raised(flying, 0.3 - lowest_gap(theta, flying))
    falling = shaken(start, n, seed=seed + 1, position=0.001, angle=0.02, speed=0.2, spin=2.0)
    falling = replace(falling, v_WB=falling.v_WB - falling.v_WB.new_tensor([0.0, 0.0, 1.8]))
    share = 0.1 + 0.6 * torch.rand(n, generator=generator, dtype=torch.float64)
    falling = raised(falling, share * STEP - lowest_gap(theta, falling))
    sliding = shaken(start, n, seed=seed + 2, position=3e-4, angle=0.01, speed=0.0, spin=0.3)
    pushed = 0.4 * torch.randn(n, 1, 3, generator=generator, dtype=torch.float64)
    pushed[..., 2] = -0.3
    sliding = replace(sliding, v_WB=sliding.v_WB + pushed)
    sliding = raised(sliding, -2e-5 * (0.1 + share) - lowest_gap(theta, sliding))
    gait = gait_states(variant, simulator, n, seed=seed)
    rest = resting_states(variant, simulator, n)
    parts = {"flight": flying, "impact": falling, "sliding": sliding, "gait": gait, "rest": rest}
    if structure.rod_pairs:
        parts["touching"] = touching(theta, flying, generator)
        down = raised(parts["touching"], -5e-6 - lowest_gap(theta, parts["touching"]))
        parts["touching, on the ground"] = down
    where, begin = {}, 0
    for name, part in parts.items():
        where[name] = slice(begin, begin + len(part.p_WB))
        begin = where[name].stop
    return where, stirred(joined(list(parts.values())), generator)


def shaken(start: State, n: int, *, seed: int, **noise: float) -> State:
    """Random neighbours of a state of batch 1; memories of effects stay."""
    bare = engine.shaken(start, n, seed=seed, **noise)
    return replace(bare, extra=expanded(start, n).extra)


def gait_states(variant: Variant, simulator: Simulator, n: int, *, seed: int) -> State:
    """States from random gaits of 1.2 s, dropped from 2 cm."""
    structure, theta = variant.structure, variant.theta
    start = raised(variant.start, 0.02 - lowest_gap(theta, variant.start))
    gaits = random_gait(12, structure.n_actuated, batch=n, seed=seed)
    return off_the_switch(_later(variant, simulator, expanded(start, n), gaits, hold=100), seed)


def resting_states(variant: Variant, simulator: Simulator, n: int) -> State:
    """The robot 2 s after a drop from 1 mm without a command, at rest or nearly so."""
    theta = variant.theta
    start = raised(variant.start, 1e-3 - lowest_gap(theta, variant.start))
    idle = start.p_WB.new_zeros(1, 1, variant.structure.n_actuated)
    return off_the_switch(expanded(_later(variant, simulator, start, idle, hold=2000), n), 1)


def _later(variant: Variant, simulator: Simulator, start: State, commands: Tensor, *, hold: int) -> State:
    """The state after all commands, each held for `hold` steps."""
    s, p = pack_state(variant.structure, start), pack_parameters(variant.structure, variant.theta)
    count = commands.shape[1] * hold
    return unpack_state(variant.structure, simulator.advance(s, commands, p, h=STEP, hold=hold, every=count)[:, -1])


def off_the_switch(state: State, seed: int) -> State:
    """The state 2 to 8 micrometres higher or lower.

    A cap that stands on the ground has the gap 0 to rounding, and there the step has a kink: above, the next gap is 0
    whatever this one is (the cap lands); below, a share of the penetration stays (it is pushed out). The values agree,
    the derivatives do not, and torch and machine code round to different sides. Within a step it falls 10 micrometres:
    it stays in contact.
    """
    generator = torch.Generator().manual_seed(seed)
    n = len(state.p_WB)
    size = 2e-6 + 6e-6 * torch.rand(n, generator=generator, dtype=torch.float64)
    sign = torch.where(torch.rand(n, generator=generator) < 0.5, -1.0, 1.0)
    return raised(state, size * sign)


def touching(theta: Parameters, state: State, generator: torch.Generator) -> State:
    """The state with rod 1 put beside rod 0 so that their surfaces are about to meet: shaft on shaft, cap on shaft and
    cap on cap in turn, 0.2 mm apart to 0.05 mm in each other, approaching at 1.7 m/s. Winched cables are slack, or they
    would part them."""
    n = len(state.p_WB)

    def noise(*shape: int) -> Tensor:
        return torch.randn(n, *shape, generator=generator, dtype=torch.float64)

    axis_a, axis_b = noise(3), noise(3)
    axis_a[:, 2] *= 0.3
    axis_a, axis_b = (x / torch.linalg.vector_norm(x, dim=-1, keepdim=True) for x in (axis_a, axis_b))
    normal = torch.linalg.cross(axis_a, axis_b)
    normal = normal / torch.linalg.vector_norm(normal, dim=-1, keepdim=True)
    half = 0.5 * torch.linalg.vector_norm(theta.p_BE[0, :, 1] - theta.p_BE[0, :, 0], dim=-1)
    shaft, cap = theta.rod_radius[0], theta.cap_radius[0, :, 0]
    kind = torch.arange(n) % 3
    # Places along both axes of the points that meet, and the distance of the axes there.
    along_a = torch.where(kind == 2, half[0], 0.4 * half[0] * (2 * torch.rand(n, generator=generator) - 1))
    along_b = torch.where(kind >= 1, half[1], 0.4 * half[1] * (2 * torch.rand(n, generator=generator) - 1))
    radii = torch.where(kind == 2, cap[0], shaft[0]) + torch.where(kind >= 1, cap[1], shaft[1])
    gap = 2e-4 - 2.5e-4 * torch.rand(n, generator=generator, dtype=torch.float64)
    p_a = state.p_WB[:, 0]
    p_b = p_a + axis_a * along_a[:, None] + normal * (radii + gap)[:, None] - axis_b * along_b[:, None]
    p, q, v = state.p_WB.clone(), state.q_WR.clone(), state.v_WB.clone()
    p[:, 1], q[:, 0], q[:, 1] = p_b, pointing(axis_a), pointing(axis_b)
    v[:, 1] = v[:, 0] - (1.5 + 0.5 * torch.rand(n, 1, generator=generator, dtype=torch.float64)) * normal
    spin = state.w_R * 0.1
    return replace(state, p_WB=p, q_WR=q, v_WB=v, w_R=spin, rest=torch.ones_like(state.rest))


def raised(state: State, by: Tensor) -> State:
    """The state moved up by (B,) [m]."""
    up = torch.stack([torch.zeros_like(by), torch.zeros_like(by), by], dim=-1)
    return replace(state, p_WB=state.p_WB + up[:, None])


def stirred(state: State, generator: torch.Generator) -> State:
    """Rest lengths, winding rates and memories of effects off their round values, orientations exactly of unit norm."""

    def noise(x: Tensor, size: float) -> Tensor:
        return size * torch.randn(x.shape, generator=generator, dtype=x.dtype)

    return replace(
        state, q_WR=roma.quat_normalize(state.q_WR), rest=state.rest + noise(state.rest, 1e-3),
        winding=state.winding + noise(state.winding, 0.02),
        extra={name: x + noise(x, MEMORY.get(name, 0.01)) for name, x in state.extra.items()},
    )  # fmt: skip


def expanded(state: State, n: int) -> State:
    """n copies of a state of batch 1."""
    return state.select(torch.zeros(n, dtype=torch.long))


def joined(states: list[State]) -> State:
    """One batch of several."""
    named = {f.name: torch.cat([getattr(s, f.name) for s in states]) for f in fields(State) if f.name != "extra"}
    return State(**named, extra={name: torch.cat([s.extra[name] for s in states]) for name in states[0].extra})
