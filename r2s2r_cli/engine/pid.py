"""The robot's low-level controller: a PID on cable positions, latched `done`, and event-based steps of a policy.

As the public host of the 3-bar robot computes it once a control tick (docs/guides/simulate.md has the facts):

    position = (length - min_length) / range          length: between the centres of the cable's two end caps
    error    = position - target
    u        = clamp(p error + i (sum of errors) + d (error - error of the tick before), -1, 1)

- The gains count ticks, not seconds: they belong to the rate of the robot, `period`.
- `done` is latched: within the tolerance (or shorter than 0 with target 0) the motor stops, until the next target.
- Every target starts afresh with sum 0 and error before 0, so that the first D term is d x error, as on the robot.
- No anti-windup, as on the robot. It needs none: a cable cannot pass its target unseen (the tolerance band is 24 mm
  wide, a cable moves 1.3 mm a tick), and `done` drops the sum. In a step that never arrives the sum adds to the
  command that is right, and is dropped at the timeout.

Everything is batch first and differentiable where the controller is: `done` and the step of the policy are decisions,
and have no derivative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from r2s2r_cli.engine.errors import EngineInputError


@dataclass(frozen=True)
class PidMemory:
    """What the controller remembers between ticks. total, previous: sum of errors and error before, in positions [1];
    done: latched; each (B, actuated)."""

    total: Tensor
    previous: Tensor
    done: Tensor

    def restarted(self, where: Tensor) -> PidMemory:
        """The memory at a new target in the environments `where` (B,), bool: nothing summed, nothing done."""
        fresh = where[:, None]
        zero = torch.zeros_like(self.total)
        return PidMemory(
            torch.where(fresh, zero, self.total), torch.where(fresh, zero, self.previous), self.done & ~fresh
        )


@dataclass(frozen=True)
class LatchedPid:
    """Gains and geometry of the controller. p, i, d [1 a tick], tolerance [1], min_length and range [m] are numbers, or
    tensors that broadcast to (B, actuated).

    period: of the control ticks [s]. cable_caps: the two end caps of every cable, whose distance its sensor measures.
    actuated: the cables that have a motor, ascending.
    """

    p: Tensor | float
    i: Tensor | float
    d: Tensor | float
    tolerance: Tensor | float
    min_length: Tensor | float
    range: Tensor | float
    period: float
    cable_caps: tuple[tuple[int, int], ...]
    actuated: tuple[int, ...]

    def __post_init__(self) -> None:
        for name in ("range", "tolerance", "period"):
            value = getattr(self, name)
            if not bool(torch.as_tensor(value > 0).all()):
                raise EngineInputError(f"pid.{name}", "out of its range", expected="above 0", received=str(value))
        if any(not 0 <= k < len(self.cable_caps) for k in self.actuated):
            raise EngineInputError(
                "pid.actuated", "a cable that does not exist",
                expected=f"numbers below {len(self.cable_caps)}", received=str(self.actuated),
            )  # fmt: skip

    def start(self, like: Tensor) -> PidMemory:
        """The memory before the first tick, for lengths such as `like` (B, cable)."""
        zero = like.new_zeros(len(like), len(self.actuated))
        return PidMemory(zero, zero.clone(), torch.zeros_like(zero, dtype=torch.bool))

    def position(self, length: Tensor) -> Tensor:
        """Positions [1], 0 short .. 1 long, (B, actuated), of lengths of all cables [m], (B, cable)."""
        return (length[:, list(self.actuated)] - self.min_length) / self.range

    def tick(self, memory: PidMemory, length: Tensor, target: Tensor) -> tuple[Tensor, PidMemory]:
        """One control tick: motor commands in [-1, 1], +1 reels in, (B, actuated), and the memory after it.

        length: of all cables as the sensors give them [m], (B, cable). target: positions [1], (B, actuated).
        """
        position = self.position(length)
        error = position - target
        done = memory.done | (error.abs() < self.tolerance) | ((target == 0) & (position < 0))
        total = torch.where(done, memory.total, memory.total + error)
        u = torch.clamp(self.p * error + self.i * total + self.d * (error - memory.previous), -1.0, 1.0)
        previous = torch.where(done, memory.previous, error)
        return torch.where(done, torch.zeros_like(u), u), PidMemory(total, previous, done)


@dataclass(frozen=True)
class Progress:
    """Where a batch is in a sequence of S targets. index: of the present target, S once all are through; elapsed: ticks
    spent on it; held: ticks since all its cables were done; each (B,), int64."""

    index: Tensor
    elapsed: Tensor
    held: Tensor

    def finished(self, steps: int) -> Tensor:
        """Environments that are through all `steps` targets, (B,), bool."""
        return self.index >= steps

    def target(self, targets: Tensor) -> Tensor:
        """The present target of each environment, (B, actuated), of `targets` (S, actuated); after the end the last."""
        return targets[self.index.clamp(max=len(targets) - 1)]

    def held_back(self, before: Progress, where: Tensor) -> Progress:
        """As it was before in the environments `where` (B,), bool."""
        return Progress(
            torch.where(where, before.index, self.index), torch.where(where, before.elapsed, self.elapsed),
            torch.where(where, before.held, self.held),
        )  # fmt: skip


@dataclass(frozen=True)
class Transition:
    """What one tick did to the steps. changed: the target was left; timed_out: left without being done; each (B,)."""

    changed: Tensor
    timed_out: Tensor

    def held_back(self, where: Tensor) -> Transition:
        """Without those of the environments `where` (B,), bool."""
        return Transition(self.changed & ~where, self.timed_out & ~where)


def start_progress(batch: int, device: torch.device | None = None) -> Progress:
    """Before the first tick of the first target."""
    zero = torch.zeros(batch, dtype=torch.long, device=device)
    return Progress(zero, zero.clone(), zero.clone())


def advance(progress: Progress, done: Tensor, hold_ticks: Tensor, timeout_ticks: Tensor) -> tuple[Progress, Transition]:
    """The event-based transition after a tick: on when all cables are done and the hold has passed, or at the timeout.

    done: of the tick just made, (B, actuated). hold_ticks, timeout_ticks: of every target, (S,), see `ticks`. A hold of
    0 goes on with the tick that finds the last cable done, as the robot does.
    """
    steps = len(hold_ticks)
    running = ~progress.finished(steps)
    at = progress.index.clamp(max=steps - 1)
    elapsed = progress.elapsed + running
    there = done.all(dim=1)
    held = torch.where(there, progress.held + running, progress.held)
    ready = there & (held > hold_ticks[at])
    # A cable that is done stays done: once all are, the timeout has nothing to give up.
    timed_out = running & ~there & (elapsed >= timeout_ticks[at])
    changed = running & (ready | timed_out)
    zero = torch.zeros_like(elapsed)
    after = Progress(progress.index + changed, torch.where(changed, zero, elapsed), torch.where(changed, zero, held))
    return after, Transition(changed, timed_out)


def ticks(seconds: Tensor, period: float) -> Tensor:
    """Times [s], (S,), in whole control ticks, rounded up, int64. Rounding of the quotient itself is forgiven."""
    if bool((seconds < 0).any()) or not bool(torch.isfinite(seconds).all()):
        raise EngineInputError(
            "holds, timeouts", "no time to wait", expected="0 s or more, finite", received=str(seconds)
        )
    return torch.ceil(seconds / period - 1e-9).to(torch.long)


def steps_a_tick(period: float, step: float) -> int:
    """Engine steps in one control tick. Raises EngineInputError where the step [s] does not divide the period [s]."""
    steps = round(period / step) if math.isfinite(step) and step > 0 else 0
    if steps < 1 or not math.isclose(steps * step, period, rel_tol=1e-9):
        raise EngineInputError("step", "the engine step does not divide the control period",
                               expected=f"{period:g} s over a whole number", received=f"{step:g} s")  # fmt: skip
    return steps
