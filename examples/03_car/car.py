"""A car that drives from A to B, back to A and to B again, at an unknown speed v; with derivatives by v.

Positions [m], A = 0, B = 100 m, one step dt; the true car has v = 1 m/s and turns at t = 100 and 200 s. Derivatives are
carried along (forward mode), exactly as automatic differentiation of the same steps would give them. The losses take
speeds v (start,) and the positions seen of the true car (step + 1, start) or (step + 1, 1), and return mean squared
defects [m^2] and their derivatives by v, each (start,).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
AB, GAITS = 100.0, 3
"""Distance of A and B [m]; number of drives between them."""
TOUCH = 1e-9
"""A car this near to B (A) is there [m]: it comes back to where it started, and rounding shall not decide."""


class Turn(StrEnum):
    """When the simulated car turns, and what its derivative knows of it."""

    EVENT = "event"
    """At the first step at or past B (A). The direction is a switch, so the derivative does not see that a faster car
    turns earlier: dx/dv = sum of s dt. What automatic differentiation makes of the obvious program."""
    REFLECTED = "reflected"
    """Exactly at B (A), within the step; the derivative is the true one: -s t after an odd number of turns."""
    COMMANDED = "commanded"
    """At t = 100 and 200 s, wherever it is: the open loop."""


class Restart(StrEnum):
    """What a window of multiple shooting starts from."""

    FULL = "full"
    """Position and direction of the true car."""
    POSITION = "position"
    """Position of the true car; the simulated car drives on in its own direction."""
    NONE = "none"
    """Nothing: one simulation, cut into windows."""


@dataclass(frozen=True)
class Reading:
    """One way to read the paper's words. all_steps: a window has a defect at every step, else at its end."""

    turn: Turn = Turn.EVENT
    restart: Restart = Restart.FULL
    all_steps: bool = False

    def __str__(self) -> str:
        defects = "defects of all steps" if self.all_steps else "defect at the end"
        return f"turn {self.turn}, restart {self.restart}, {defects}"


def steps_of_a_gait(dt: float) -> int:
    """Steps that the true car takes from A to B."""
    return round(AB / dt)


def true_car(dt: float) -> tuple[Array, Array]:
    """Position [m], (step + 1,), and direction of the next step, (step,), of the true car."""
    n = steps_of_a_gait(dt)
    direction = np.repeat([1.0, -1.0, 1.0], n)
    leg = np.arange(n + 1) * dt
    return np.concatenate([leg, AB - leg[1:], leg[1:]]), direction


def windows_loss(v: Array, windows: int, reading: Reading, dt: float, seen: Array) -> tuple[Array, Array]:
    """Naive (one window, all steps) and multiple shooting, over the 300 s of the demonstration."""
    _, true_direction = true_car(dt)
    steps = len(true_direction)
    bounds = {round(k * steps / windows) for k in range(windows + 1)}
    x, dx, s = np.zeros_like(v), np.zeros_like(v), np.ones_like(v)
    loss, slope, count = np.zeros_like(v), np.zeros_like(v), 0
    for n in range(steps):
        if n in bounds and n > 0 and reading.restart is not Restart.NONE:
            x, dx = np.broadcast_to(seen[n], v.shape), np.zeros_like(v)
            s = np.full_like(v, true_direction[n]) if reading.restart is Restart.FULL else s
        if reading.turn is Turn.COMMANDED:
            s = np.full_like(v, true_direction[n])
        x, dx = x + s * v * dt, dx + s * dt
        if reading.turn is not Turn.COMMANDED:
            past_B, past_A = (s > 0) & (x >= AB - TOUCH), (s < 0) & (x <= TOUCH)
            s = np.where(past_B | past_A, -s, s)
            if reading.turn is Turn.REFLECTED:
                x = np.where(past_B, 2 * AB - x, np.where(past_A, -x, x))
                dx = np.where(past_B | past_A, -dx, dx)
        if reading.all_steps or n + 1 in bounds:
            defect = x - seen[n + 1]
            loss, slope, count = loss + defect**2, slope + 2 * defect * dx, count + 1
    return loss / count, slope / count


def gaits_loss(v: Array, dt: float, seen: Array, *, detach: bool = True, last_only: bool = True) -> tuple[Array, Array]:
    """Key Frame Loss: gaits end where the car reaches B (A), are laid over the true ones from their starts, and are
    compared at the last step that both have.

    detach: the state is detached between gaits (without it: the paper's Last Step). last_only False: all steps that
    both have (All Step). The simulation is not cut at 300 s; a car with v <= 0 never arrives, its next gait starts at
    the end of this one. The paper's mask, which leaves out gaits whose time contradicts that of the whole trajectory,
    has nothing to do here: a car of one speed is too slow in every gait or in none.
    """
    n_true = steps_of_a_gait(dt)
    start, d_start = np.zeros_like(v), np.zeros_like(v)
    parts = []
    for gait in range(GAITS):
        s = 1.0 if gait % 2 == 0 else -1.0
        goal = AB if s > 0 else 0.0
        own = np.where(v > 0, np.ceil((s * (goal - start) - TOUCH) / (np.maximum(v, 1e-12) * dt)), np.inf)
        last = np.minimum(own, n_true)
        steps = last[None] if last_only else np.minimum(np.arange(1.0, n_true + 1)[:, None], last)
        counts = np.ones_like(steps) if last_only else np.arange(1, n_true + 1)[:, None] <= last
        true = np.take_along_axis(np.broadcast_to(seen, (len(seen), len(v))), gait * n_true + steps.astype(int), axis=0)
        defect = start + s * v * steps * dt - true
        slope = d_start + s * steps * dt
        parts.append([(counts * each).sum(0) / counts.sum(0) for each in (defect**2, 2 * defect * slope)])
        arrives = np.isfinite(own)
        reached = np.where(arrives, own, 0.0)
        start = np.where(arrives, start + s * v * reached * dt, goal)
        d_start = np.zeros_like(v) if detach else np.where(arrives, d_start + s * reached * dt, 0.0)
    loss, slope = (np.stack(part).mean(0) for part in zip(*parts, strict=True))
    return loss, slope
