"""Initial states from observed end caps: rigid rods, roll, tensions, and gravity that brings the lowest caps to the
ground (paper, section "System Identification": both cable lengths and end caps at t = 0, then gravity).

Two cases. `settled`: the robot rests; the simulation relaxes until it does. `window_state`: the robot moves; roll and
winches are carried over from the window before, tensions are made consistent with the observed pose, nothing relaxes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine.balance import balance
from r2s2r_cli.engine.cable import rest_lengths
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.flat import pack_parameters, pack_state, unpack_state
from r2s2r_cli.engine.hooks import effective
from r2s2r_cli.engine.nonfinite import require_finite
from r2s2r_cli.engine.parameters import Parameters
from r2s2r_cli.engine.reading import cap_lengths, read
from r2s2r_cli.engine.roll import along, resting, roll_relaxed
from r2s2r_cli.engine.rollout import Simulator
from r2s2r_cli.engine.state import State, cap_velocities, end_caps, pose_state
from r2s2r_cli.engine.structure import Structure

SPELL = 0.005
"""[s] of simulation between two looks at the kinetic energy."""
CALM = 30.0
"""[1/s] times what the cables lack: the winches turn at an energy peak below this speed. A winch that follows a moving
robot pumps energy into it: turned at every look, 8 of 8 noisy starts never came to rest."""
LOOSE = 1e-2
"""[m] A cable whose rest length exceeds the observed distance by more than this, which is more than noise, hangs loose,
whatever tension would balance the pose."""
TURNED = 1e-6
"""[m] winches that would turn by less have the observed lengths."""


@dataclass(frozen=True)
class Settled:
    """A resting state. p_WE: observed caps [m], (B, cap, 3); shift: of each cap from there [m], (B, cap);
    tension: (B, cable) [N]; speed: of the fastest cap at the end, then cleared [m/s], (B,); spells: how long it
    took, in SPELL seconds."""

    state: State
    shift: Tensor
    tension: Tensor
    speed: Tensor
    spells: int


@torch.no_grad()
def settled(
    simulator: Simulator,
    theta: Parameters,
    p_WE: Tensor,
    R_WR: Tensor,
    cable_caps: tuple[tuple[int, int], ...],
    *,
    lengths: Tensor | None = None,
    step: float = 1e-3,
    spells: int = 1600,
    still: float = 1e-5,
) -> Settled:
    """The state at rest nearest to observed caps p_WE (B, cap, 3) [m], frame G, with the observed cable lengths.

    R_WR: frames of the rods (B, rod, 3, 3); their roll is a first guess (the attachment heuristic), which tensions
    then correct. cable_caps: end caps of each cable. lengths: cap distances of all cables [m], (B, cable); None: those
    of p_WE. The winches are turned until the winched ones have these lengths; velocities are cleared whenever the
    kinetic energy has passed a peak. The result is shifted and turned about the vertical back on to the observation; it
    is an observation too, and has no derivative. Raises EngineInputError, NonFiniteError.
    """
    structure = simulator.structure
    _check("p_WE", p_WE, (2 * structure.n_rods, 3))
    wanted = cap_lengths(cable_caps, p_WE) if lengths is None else lengths
    _check("lengths", wanted, (structure.n_cables,))
    batch = _batch(p_WE=p_WE, R_WR=R_WR, lengths=wanted, mass=theta.mass)
    p_WE, wanted = p_WE.expand(batch, -1, -1), wanted.expand(batch, -1)
    seen = effective(structure, theta)  # as effects make the robot; the step is handed what it was before
    state = pose_state(structure, seen, p_WE, along(p_WE, R_WR), rest=p_WE.new_zeros(len(p_WE), structure.n_actuated))
    state = consistent(structure, theta, roll_relaxed(simulator, theta, lowered(seen, state)))
    winched = list(structure.actuated)
    p, h = pack_parameters(structure, theta), step / simulator.substeps(theta, state, step)
    count = max(1, round(SPELL / h))
    idle = p_WE.new_zeros(len(p_WE), 1, structure.n_actuated)
    before = p_WE.new_zeros(len(p_WE))
    speed, used = before, 0
    while used < spells:
        used += 1
        frames = simulator.advance(pack_state(structure, state), idle, p, h=h, hold=count, every=count)
        require_finite(structure, simulator.kernels.fn, frames, idle, p, h=h, hold=count, every=count)
        state = unpack_state(structure, frames[:, -1])
        speed = torch.linalg.vector_norm(cap_velocities(seen, state), dim=-1).max(dim=1).values
        missing = wanted[:, winched] - cap_lengths(cable_caps, end_caps(seen, state))[:, winched]
        turned = torch.minimum(torch.maximum(state.rest + missing, seen.rest_min), seen.rest_max)
        wrong = (turned - state.rest).abs().amax(dim=1) if winched else torch.zeros_like(speed)
        if bool((speed < still).all()) and bool((wrong < TURNED).all()):
            break
        kinetic = (state.v_WB**2).sum((1, 2)) + 0.01 * (state.w_R**2).sum((1, 2))
        peak = kinetic < before
        slow = peak & (torch.sqrt(before) < CALM * wrong)
        still_now = peak[:, None, None]
        state = replace(
            state, v_WB=torch.where(still_now, 0.0, state.v_WB), w_R=torch.where(still_now, 0.0, state.w_R),
            rest=torch.where(slow[:, None], turned, state.rest),
        )  # fmt: skip
        before = torch.where(peak, torch.zeros_like(kinetic), kinetic)
    state = _back(seen, resting(state), p_WE)
    shift = torch.linalg.vector_norm(end_caps(seen, state) - p_WE, dim=-1)
    return Settled(state, shift, read(structure, theta, state, h).tension, speed, used)


def _check(name: str, observed: Tensor, shape: tuple[int, ...]) -> None:
    """Raises EngineInputError for observations of a wrong shape, or that are no numbers."""
    if observed.shape[1:] != shape or observed.ndim != len(shape) + 1:
        raise EngineInputError(
            name, "wrong shape", expected="(B, " + ", ".join(map(str, shape)) + ")", received=str(tuple(observed.shape))
        )
    if not bool(torch.isfinite(observed).all()):
        index = tuple(torch.nonzero(~torch.isfinite(observed))[0].tolist())
        raise EngineInputError(
            f"{name}.{'.'.join(map(str, index[1:]))}", "not a finite number", expected="finite numbers",
            received=f"{float(observed[index])} in environment {index[0]}",
        )  # fmt: skip


def _batch(**tensors: Tensor) -> int:
    """The one batch of observations, parameters and states, those of batch 1 being shared. Raises EngineInputError,
    naming the first that is of another one, or of none."""
    batch = max(map(len, tensors.values()))
    for name, tensor in tensors.items():
        if len(tensor) not in (1, batch) or batch == 0:
            raise EngineInputError(
                name, "another batch", expected=f"{batch} or 1" if batch > 1 else "at least 1",
                received=str(len(tensor)),
            )  # fmt: skip
    return batch


def window_state(
    simulator: Simulator,
    theta: Parameters,
    p_WE: Tensor,
    carried: State,
    *,
    v_WE: Tensor | None = None,
    relax_roll: bool = False,
    loose: float = LOOSE,
) -> State:
    """The state at the start of a window from observed caps (B, cap, 3) [m] and a simulated state at that time.

    carried: gives roll (turned by the smallest rotation on to the observed axes), the rest lengths of slack winched
    cables, effect states, and velocities where v_WE (B, cap, 3) [m/s] is None. Tensions balance the observed pose, but
    cables longer than seen by more than `loose` [m] hang. Raises EngineInputError.
    """
    structure = simulator.structure
    _check("p_WE", p_WE, (2 * structure.n_rods, 3))
    if v_WE is not None:
        _check("v_WE", v_WE, (2 * structure.n_rods, 3))
    given = {} if v_WE is None else {"v_WE": v_WE}
    batch = _batch(p_WE=p_WE, **given, mass=theta.mass, carried=carried.p_WB)
    p_WE = p_WE.expand(batch, -1, -1)
    R_WR = along(p_WE, roma.unitquat_to_rotmat(carried.q_WR).expand(len(p_WE), -1, -1, -1))
    rest = carried.rest.expand(len(p_WE), -1)
    seen = effective(structure, theta)
    state = pose_state(structure, seen, p_WE, R_WR, rest=rest)
    state = lowered(seen, state, only_up=True)
    if relax_roll:
        state = roll_relaxed(simulator, theta, state)
    state = consistent(structure, theta, state, slack=rest, margin=loose)
    v, w = (carried.v_WB, carried.w_R) if v_WE is None else _velocities(seen, state, v_WE)
    memory = {name: x.expand(len(p_WE), *x.shape[1:]) for name, x in carried.extra.items()}
    return replace(
        state, v_WB=v.expand_as(state.v_WB), w_R=w.expand_as(state.w_R),
        winding=carried.winding.expand_as(state.rest), extra=memory,
    )  # fmt: skip


def lowered(theta: Parameters, state: State, *, only_up: bool = False) -> State:
    """Moved along the vertical until the lowest cap touches the ground; only_up: only where it is below it."""
    lowest = (end_caps(theta, state)[..., 2] - theta.cap_radius.flatten(1)).min(dim=1).values
    by = torch.clamp(lowest, max=0.0) if only_up else lowest
    down = torch.stack([torch.zeros_like(by), torch.zeros_like(by), by], dim=-1)
    return replace(state, p_WB=state.p_WB - down[:, None])


def consistent(
    structure: Structure, theta: Parameters, state: State, slack: Tensor | None = None, margin: float = LOOSE
) -> State:
    """The state with rest lengths under which the winched cables have the balancing tensions.

    slack: rest lengths of before. A cable that they leave loose by more than margin [m] stays so, and pulls at nothing;
    one that turns out to have no tension keeps them where they are long enough (a winch that paid out).
    """
    winched = list(structure.actuated)
    reading = read(structure, theta, resting(state))
    seen = effective(structure, theta)
    # What effects add to the rest length comes off what the winches have to give.
    added = rest_lengths(structure, seen, state.rest)[:, winched] - state.rest
    length = reading.length[:, winched] - added
    loose = None if slack is None else slack > length + margin
    tension = balance(structure, theta, state, loose=loose).tension[:, winched]
    stretched = length - tension / seen.stiffness[:, winched]
    if slack is not None and loose is not None:
        stretched = torch.where((tension > 0) & ~loose, stretched, torch.maximum(slack, length))
    return replace(state, rest=torch.minimum(torch.maximum(stretched, seen.rest_min), seen.rest_max))


def _velocities(theta: Parameters, state: State, v_WE: Tensor) -> tuple[Tensor, Tensor]:
    """Velocities of rods from those of their caps; the spin about a rod's own axis is not observable and taken as 0."""
    ends = v_WE.unflatten(1, (-1, 2))
    R_WR = roma.unitquat_to_rotmat(state.q_WR)
    axis = R_WR[..., 2]
    length = (theta.p_BE[..., 1, 2] - theta.p_BE[..., 0, 2])[..., None]
    w_W = torch.linalg.cross(axis, (ends[:, :, 1] - ends[:, :, 0]) / length)
    p_middle = theta.p_BE.mean(2).expand_as(w_W)
    v = ends.mean(2) - torch.linalg.cross(w_W, torch.einsum("brij,brj->bri", R_WR, p_middle))
    return v, torch.einsum("brij,bri->brj", R_WR, w_W)


def _back(theta: Parameters, state: State, p_WE: Tensor) -> State:
    """Shifted over the ground and turned about the vertical to the least squared distance from the observed caps."""
    here = end_caps(theta, state)
    a, b = here[..., :2] - here[..., :2].mean(1, keepdim=True), p_WE[..., :2] - p_WE[..., :2].mean(1, keepdim=True)
    angle = torch.atan2((a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]).sum(1), (a * b).sum((1, 2)))
    zero = torch.zeros_like(angle)
    turn = roma.rotvec_to_rotmat(torch.stack([zero, zero, angle], dim=-1))
    centre, goal = here.mean(1, keepdim=True), p_WE.mean(1, keepdim=True)
    goal = torch.cat([goal[..., :2], centre[..., 2:]], dim=-1)
    quaternion = roma.rotmat_to_unitquat(turn)[:, None].expand_as(state.q_WR)
    return replace(
        state, p_WB=torch.einsum("bij,brj->bri", turn, state.p_WB - centre) + goal,
        q_WR=roma.quat_product(quaternion, state.q_WR),
    )  # fmt: skip
