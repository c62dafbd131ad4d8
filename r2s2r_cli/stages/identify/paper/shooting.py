"""Windows of a loss with their derivatives: what is simulated again, from which state, and what is compared.

The closed loop is simulated once without a derivative; its commands are then replayed with one, window by window. The
replay gives the same states, so a detached window starts where the loop was, at a fraction of what it costs to
differentiate the loop itself (docs/concepts/paper-identification.md). Departure: the derivative of the commands by the
state is left out; they are saturated but for the last moments before a cable is done.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.paper.demonstration import Demonstration
from r2s2r_cli.stages.identify.paper.flight import Flight, World, commands_at
from r2s2r_cli.stages.identify.paper.key_frames import KeyFrames, key_frames, spans
from r2s2r_cli.stages.identify.paper.losses import Loss, LossValue, Norm, Window, loss_value
from r2s2r_cli.stages.identify.paper.mask import Mask, direction_mask

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, State


@dataclass(frozen=True)
class Compared:
    """A loss and how it came about; keys, mask: None for losses that go by the clock."""

    value: LossValue
    keys: KeyFrames | None
    mask: Mask | None


def compare(
    loss: Loss,
    world: World,
    theta: Parameters,
    flight: Flight,
    demo: Demonstration,
    *,
    mask: bool = True,
    windows: int = 4,
    attached: bool | None = None,
    norm: Norm = Norm.SQUARED,
) -> Compared:
    """The loss of a simulation of theta against a demonstration, differentiable in theta.

    mask: of the paper, for `key_frame` only. windows: of multiple shooting. attached: whether derivatives pass from one
    segment to the next; None: as the loss has it. Raises InputError where the two have nothing in common, and the
    errors of the engine.
    """
    if loss is Loss.NAIVE:
        return Compared(loss_value([_by_the_clock(world, theta, flight, demo)], norm=norm), None, None)
    if loss is Loss.MULTIPLE_SHOOTING:
        return Compared(loss_value(_shots(world, theta, flight, demo, windows), norm=norm), None, None)
    keys = paired(flight, demo)
    if not len(keys):
        raise InputError(
            "the simulation has no key frame in common with the run", where=demo.name,
            expected="at least two frames in a segment", received=f"{len(demo.t)} frames in {len(demo.spans)} segments",
            hint="r2s2r inspect 20-estimate.h5",
        )  # fmt: skip
    decided = direction_mask(keys, closed_loop=flight.segments is not None)
    kept = decided.kept if mask and loss is Loss.KEY_FRAME else np.ones(len(keys), dtype=bool)
    joined = loss is not Loss.KEY_FRAME if attached is None else attached
    cut = _segments(world, theta, flight, demo, keys, kept, joined=joined, every=loss is Loss.ALL_STEP)
    return Compared(loss_value(cut, kept, norm), keys, decided)


def paired(flight: Flight, demo: Demonstration) -> KeyFrames:
    """Key frames of a simulation and the run it imitates. In command replay both have the same segments."""
    if flight.segments is None:
        return key_frames(demo.t, demo.spans, demo.spans)
    own = spans(flight.segments, range(1, len(demo.targets) + 1), exact=True)
    return key_frames(demo.t, demo.spans, own, offset=demo.first - 1)


def _segments(
    world: World, theta: Parameters, flight: Flight, demo: Demonstration, keys: KeyFrames, kept: np.ndarray,
    *, joined: bool, every: bool,
) -> list[Window]:  # fmt: skip
    """One window a segment: its key frame, or `every` common frame. joined: one simulation, cut; else each from its
    own detached state, those that do not count without a derivative."""
    period = world.pid.period
    begin = np.floor(keys.start_sim / period + 1e-6).astype(int)
    end = np.ceil((keys.start_sim + keys.tau) / period - 1e-6).astype(int).clip(max=len(flight.t) - 1)
    whole = rolled(world, theta, flight, 0, int(end.max())) if joined else None
    found = []
    for k in range(len(keys)):
        a, b = int(begin[k]), int(end[k])
        frames = np.arange(keys.first[k] if every else keys.frame[k], keys.frame[k] + 1)
        tau = demo.t[frames] - keys.start_real[k]
        at = (keys.start_sim[k] + tau) / period - a
        if whole is not None:
            p_WE = whole[a : b + 1]
        elif kept[k]:
            p_WE = rolled(world, theta, flight, a, b)
        else:
            p_WE = seen(world, theta, flight.states[a : b + 1]).detach()
        found.append(Window(p_WE, at, demo.p_WE[frames]))
    return found


def rolled(world: World, theta: Parameters, flight: Flight, begin: int, end: int) -> Tensor:
    """End caps of the flight's ticks begin..end, simulated again from its detached state at `begin`, (tick, cap, 3)."""
    from r2s2r_cli.engine import unpack_state

    per_tick = world.tick_steps // flight.hold
    state = unpack_state(world.simulator.structure, flight.states[begin][None])
    rows = flight.commands[begin * per_tick : end * per_tick]
    return _caps(world, theta, state, rows, flight.hold, flight.substeps)


def seen(world: World, theta: Parameters, states: Tensor) -> Tensor:
    """End caps of flat states (tick, NS), (tick, cap, 3)."""
    from r2s2r_cli.engine import end_caps, unpack_state

    wide = theta.map(lambda x: x.expand(len(states), *x.shape[1:]))
    return end_caps(wide, unpack_state(world.simulator.structure, states))


def _caps(world: World, theta: Parameters, state: State, rows: Tensor, hold: int, substeps: int) -> Tensor:
    run = world.simulator.rollout(
        theta, state, rows[None], step=world.step, hold=hold, every=world.tick_steps, substeps=substeps
    )
    return run.end_caps()[0]


def _by_the_clock(world: World, theta: Parameters, flight: Flight, demo: Demonstration) -> Window:
    """All frames of the run that the simulation lasts for, each at its own time."""
    at = demo.t / world.pid.period
    use = at <= len(flight.t) - 1 + 1e-6
    last = int(np.ceil(at[use].max() - 1e-6))
    return Window(rolled(world, theta, flight, 0, max(last, 1)), at[use], demo.p_WE[use])


def _shots(world: World, theta: Parameters, flight: Flight, demo: Demonstration, windows: int) -> list[Window]:
    """Windows of equal time, each from the observed caps and velocities, with the recorded commands; the controller's
    memory inside a target is not observed. Roll and slack cables are those of the flight at that time."""
    import torch

    from r2s2r_cli.engine import unpack_state, window_state

    structure, period = world.simulator.structure, world.pid.period
    bounds = np.unique([int(np.argmin(np.abs(demo.t - x))) for x in np.linspace(0, demo.t[-1], windows + 1)])
    found = []
    for i, j in pairwise(bounds):
        tick = min(round(demo.t[i] / period), len(flight.t) - 1)
        carried = unpack_state(structure, flight.states[tick][None])
        if i > 0:
            plain = theta.map(lambda x: x.detach())
            p_WE, v_WE = (torch.as_tensor(x[i])[None] for x in (demo.p_WE, demo.v_WE))
            with torch.no_grad():
                carried = window_state(world.simulator, plain, p_WE, carried, v_WE=v_WE)
        seconds = demo.t[j] - demo.t[i]
        steps = int(np.ceil(seconds / period - 1e-6)) * world.tick_steps
        u = torch.as_tensor(commands_at(demo.t_command, demo.control, demo.t[i] + np.arange(steps) * world.step))
        p_WE = _caps(world, theta, carried, u, 1, flight.substeps)
        found.append(Window(p_WE, np.array([seconds / period]), demo.p_WE[j : j + 1]))
    return found
