"""States of the engine as the frames of a simulation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import torch

    from r2s2r_cli.engine import Parameters, State, Structure

PUSH_N = 1e-6
"""A ground force below this is rounding."""


def frame_datasets(
    structure: Structure,
    theta: Parameters,
    states: State,
    rows: np.ndarray,
    cable_caps: tuple[tuple[int, int], ...],
    *,
    h: float,
) -> dict[str, np.ndarray]:
    """The datasets of `schemas/simulation.py` at the frames `rows` of states (1, frame, ...), without their times.

    Tensions and ground forces are those of a step of h [s] from each state.
    """
    from r2s2r_cli.engine import angular_velocities, end_caps, middles
    from r2s2r_cli.engine.reading import cap_lengths, read

    state = _picked(states, rows)
    p_WE = end_caps(theta, state)
    p_WR, v_WR = middles(theta, state)
    reading = read(structure, theta, state, h)
    values = {
        "p_WR": p_WR, "q_WR": state.q_WR, "v_WR": v_WR, "w_WR": angular_velocities(state), "p_WE": p_WE,
        "length": cap_lengths(cable_caps, p_WE), "rest_length": reading.rest, "tension": reading.tension,
        "contact": reading.ground[..., 2] > PUSH_N,
    }  # fmt: skip
    return {name: np.ascontiguousarray(value.numpy()) for name, value in values.items()}


def centre_of_mass(theta: Parameters, states: State, rows: np.ndarray) -> np.ndarray:
    """Of all rods [m], (row, 3), frame W."""
    mass = theta.mass[0]
    return np.asarray((_picked(states, rows).p_WB * (mass / mass.sum())[:, None]).sum(1).numpy())


def stored_rows(ticks: int, stride: int) -> np.ndarray:
    """States that are stored, of those at every tick and the end: every `stride`-th, and the last."""
    rows = np.arange(0, ticks + 1, stride)
    return rows if rows[-1] == ticks else np.append(rows, ticks)


def _picked(states: State, rows: np.ndarray) -> State:
    """Frames of the only environment as a batch."""
    import torch

    index = torch.as_tensor(rows)
    return _each(lambda *x: x[0][0, index], states)


def without_first(states: State) -> State:
    """The same without the first frame."""
    return _each(lambda *x: x[0][:, 1:], states)


def joined(chunks: list[State]) -> State:
    """States of stretches of time that follow each other, (1, frame, ...), as one."""
    import torch

    return _each(lambda *x: torch.cat(x, dim=1), *chunks)


def _each(function: Callable[..., torch.Tensor], *states: State) -> State:
    """A state whose tensors are `function` of those of `states`."""
    from dataclasses import fields

    from r2s2r_cli.engine import State

    named = {f.name: function(*(getattr(s, f.name) for s in states)) for f in fields(State) if f.name != "extra"}
    extra = {key: function(*(s.extra[key] for s in states)) for key in states[0].extra}
    return State(**named, extra=extra)
