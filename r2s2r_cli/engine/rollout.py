"""Many steps: the simulator of one structure, in machine code where it can be compiled, in torch elsewhere."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import torch
from torch import Tensor

from r2s2r_cli.engine.batch import common_batch, tensors_of
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.engine.flat import (
    flat_step,
    pack_parameters,
    pack_state,
    parameter_slots,
    size,
    state_slots,
    twins,
    unpack_parameters,
    unpack_state,
)
from r2s2r_cli.engine.ground import Ground
from r2s2r_cli.engine.late import delay_of, shifted
from r2s2r_cli.engine.native import NativeStep, rollout
from r2s2r_cli.engine.nonfinite import require_finite
from r2s2r_cli.engine.parameters import Parameters, check_parameters
from r2s2r_cli.engine.reading import always_stable_step, stable_substeps
from r2s2r_cli.engine.state import State, check_state
from r2s2r_cli.engine.structure import Detach, Structure
from r2s2r_cli.engine.trace_key import trace_key
from r2s2r_cli.engine.trajectory import Trajectory

IMPULSE_WINDOW = 0.5
"""[s] beyond it the tangent with detached impulses has left every bound (contact.md section 5: 22 after 1 s)."""


class Simulator:
    """Rollouts of one structure. Keep it: it holds the compiled kernels.

    cache_dir: where machine code is kept between processes; None: nowhere. native: None, machine code where llvmlite
    and the tensors allow it (else torch, with one warning); False, always torch. threads: for batches.
    """

    def __init__(
        self, structure: Structure, *, cache_dir: Path | None = None, native: bool | None = None, threads: int = 1
    ) -> None:
        self.structure = structure
        self.threads = threads
        self.native = native is not False
        self._checked: tuple[Parameters, int] | None = None
        self._always = 0.0
        self.kernels = NativeStep(
            flat_step(structure), size(state_slots(structure)), structure.n_actuated, size(parameter_slots(structure)),
            key=trace_key(structure), cache_dir=cache_dir, twins=twins(structure),
        )  # fmt: skip

    def rollout(
        self,
        theta: Parameters,
        state0: State,
        commands: Tensor,
        *,
        step: float = 1e-3,
        hold: int = 1,
        every: int = 1,
        ground: Ground | None = None,
        substeps: int | None = None,
    ) -> Trajectory:
        """Command replay: simulate `commands` (B, row, actuated), each row held for `hold` steps of `step` seconds.

        theta, state0: batch B or 1; gravity and state in frame W, which is G without a `ground`. Frames every `every`
        steps, the start included. Differentiable with respect to parameters, state and commands (`Structure.detach`
        says how contacts count). substeps: engine steps a `step`; None: as many as stiff cables need.
        Raises EngineInputError for wrong inputs, NonFiniteError where the simulation leaves the finite numbers.
        """
        batch = self._checked_batch(theta, state0, commands, step, hold, every, substeps)
        if ground is not None:
            theta, state0 = ground.parameters(theta), ground.to_ground(state0)
        n = substeps or self.substeps(theta, state0, step)
        s0 = pack_state(self.structure, state0).expand(batch, -1)
        u, hold, _ = self._arriving(theta, commands.expand(batch, -1, -1), step, hold)
        p = pack_parameters(self.structure, theta)
        frames = self.advance(s0, u, p, h=step / n, hold=hold * n, every=every * n)
        require_finite(self.structure, self.kernels.fn, frames, u, p, h=step / n, hold=hold * n, every=every * n)
        states = unpack_state(self.structure, frames)
        t = torch.arange(frames.shape[1], dtype=frames.dtype, device=frames.device) * (step * every)
        return Trajectory(self.structure, theta, t, ground.to_world(states) if ground else states, step, n)

    def advance(self, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int, every: int) -> Tensor:
        """Frames (B, F, NS) of flat vectors, unchecked: s0 (B, NS), u (B, K, A), p (B or 1, NP), h [s]."""
        if not self.native:
            return self.kernels.torch_rollout(s0, u, p, h=h, hold=hold, every=every)
        return rollout(self.kernels, s0, u, p, h=h, hold=hold, every=every, threads=self.threads)

    def substeps(self, theta: Parameters, state: State, step: float) -> int:
        """Engine steps per `step` that keep explicit stiff cables stable at this state (see `longest_step`)."""
        known = self._checked is not None and self._checked[0] is theta
        if step <= (self._always if known else always_stable_step(self.structure, theta)):
            return 1
        return stable_substeps(self.structure, theta, state, step)

    def jvp(
        self,
        theta: Parameters,
        state0: State,
        commands: Tensor,
        *,
        d_parameters: Tensor | None = None,
        d_state: Tensor | None = None,
        d_commands: Tensor | None = None,
        step: float = 1e-3,
        hold: int = 1,
        every: int = 1,
        substeps: int | None = None,
    ) -> tuple[Trajectory, Tensor]:
        """A rollout and its forward sensitivities along D directions in one pass; frame G.

        d_parameters: (NP, D), the Jacobian of `pack_parameters` with respect to what is differentiated; d_state:
        (NS, D) likewise of `pack_state`; d_commands: (row, actuated, D); each may have a batch axis before. None: zero.
        Returns the trajectory and the tangents of its flat states (B, frame, NS, D). Raises as `rollout`.
        """
        batch = self._checked_batch(theta, state0, commands, step, hold, every, substeps)
        n = substeps or self.substeps(theta, state0, step)
        s0 = pack_state(self.structure, state0).expand(batch, -1).contiguous()
        rows = commands.shape[1]
        repeated = commands.expand(batch, -1, -1).contiguous()
        u, hold, by_delay = self._arriving(theta, repeated, step, hold, tangents=d_parameters is not None)
        p = pack_parameters(self.structure, theta)

        def spread(name: str, x: Tensor | None, *shape: int) -> Tensor | None:
            if x is None:
                return None
            given = tuple(x.shape[:-1])
            if given not in (shape, (1, *shape), (batch, *shape)) or not x.shape[-1]:
                wanted = ", ".join(map(str, shape))
                raise EngineInputError(
                    name, "wrong shape", expected=f"({wanted}, D) or ({batch}, {wanted}, D), D at least 1",
                    received=str(tuple(x.shape)),
                )  # fmt: skip
            return x.to(s0.dtype).expand(batch, *shape, -1)

        d_s0, d_p = spread("d_state", d_state, s0.shape[1]), spread("d_parameters", d_parameters, p.shape[1])
        d_u = spread("d_commands", d_commands, *commands.shape[1:])
        # What no direction changes needs no tangent: less to compile, and less to compute.
        active = None
        if d_parameters is not None:
            size = d_parameters.abs().amax(-1).reshape(-1, d_parameters.shape[-2]).amax(0)
            active = tuple(torch.nonzero(size).flatten().tolist())
        if by_delay is not None:
            d_u = self._late_tangents(theta, d_u, d_p, by_delay, u.shape[1] // rows, step)
        run = partial(self.kernels.jvp, threads=self.threads) if self.native else self.kernels.torch_jvp
        frames, tangents = run(
            s0, u, p, ds0=d_s0, du=d_u, dp=d_p, active=active, h=step / n, hold=hold * n, every=every * n
        )
        require_finite(self.structure, self.kernels.fn, frames, u, p, h=step / n, hold=hold * n, every=every * n)
        t = torch.arange(frames.shape[1], dtype=frames.dtype, device=frames.device) * (step * every)
        return Trajectory(self.structure, theta, t, unpack_state(self.structure, frames), step, n), tangents

    def _arriving(
        self, theta: Parameters, commands: Tensor, step: float, hold: int, *, tangents: bool = False
    ) -> tuple[Tensor, int, Tensor | None]:
        """Commands as they arrive at the winches, for how many steps each row is held, and derivatives by the delay;
        None where no effect delays them. Rows of single steps take time: not where the delay is 0 and stays so."""
        delay = delay_of(self.structure, theta)
        if delay is None or not (tangents or delay.requires_grad or bool((delay != 0).any())):
            return commands, hold, None
        late, by_delay = shifted(commands.repeat_interleave(hold, dim=1), delay, step)
        return late, 1, by_delay

    def _late_tangents(
        self, theta: Parameters, d_u: Tensor | None, d_p: Tensor | None, by_delay: Tensor, hold: int, step: float
    ) -> Tensor | None:
        """Tangents (B, row, actuated, D) of the commands that arrive, from those of commands and parameters."""
        p = pack_parameters(self.structure, theta).detach().expand(len(by_delay), -1).clone().requires_grad_()
        with torch.enable_grad():
            delay = delay_of(self.structure, unpack_parameters(self.structure, p))
            assert delay is not None  # noqa: S101 - `by_delay` is its derivative
            (gradient,) = torch.autograd.grad(delay.sum(), p)
        found = None
        if d_u is not None:
            held = d_u.repeat_interleave(hold, dim=1).unbind(-1)
            found = torch.stack([shifted(one, delay.detach(), step)[0] for one in held], dim=-1)
        if d_p is not None:
            along = (gradient[:, None] @ d_p)[:, 0]
            own = by_delay[..., None] * along[:, None, None]
            found = own if found is None else found + own
        return found

    def _checked_batch(
        self,
        theta: Parameters,
        state0: State,
        commands: Tensor,
        step: float,
        hold: int,
        every: int,
        substeps: int | None,
    ) -> int:
        """The size of the batch, after all inputs were looked at. Raises EngineInputError."""
        if substeps is not None and substeps < 1:
            raise EngineInputError("substeps", "no step", expected="at least 1", received=str(substeps))
        looked_at = (theta, _written(theta))
        if self._checked is None or self._checked[0] is not theta or not 0 <= self._checked[1] == looked_at[1]:
            check_parameters(self.structure, theta)
            self._checked, self._always = looked_at, always_stable_step(self.structure, theta)
        check_state(self.structure, state0)
        if commands.ndim != 3 or commands.shape[2] != self.structure.n_actuated or commands.shape[1] < 1:
            raise EngineInputError(
                "commands", "wrong shape", expected=f"(B, rows, {self.structure.n_actuated})",
                received=str(tuple(commands.shape)),
            )  # fmt: skip
        if not bool(torch.isfinite(commands).all()):
            raise EngineInputError("commands", "not a finite number", expected="finite numbers", received="NaN or inf")
        if not (math.isfinite(step) and step > 0):
            raise EngineInputError("step", "no step", expected="above 0 s", received=f"{step:g}")
        if hold < 1 or every < 1 or (commands.shape[1] * hold) % every:
            raise EngineInputError(
                "every", "frames do not fit", expected="a divisor of all steps, rows x hold",
                received=f"every {every}, rows {commands.shape[1]}, hold {hold}",
            )  # fmt: skip
        duration = commands.shape[1] * hold * step
        if self.structure.detach == Detach.IMPULSE and duration > IMPULSE_WINDOW:
            _warn_of_impulse(duration)
        return common_batch({"commands": commands, **tensors_of(state0), **tensors_of(theta)})


def _written(theta: Parameters) -> int:
    """How often its tensors were written into since they were made; -1 where torch does not count, which is so for
    those of `torch.inference_mode`."""
    tensors = tensors_of(theta).values()
    return -1 if any(x.is_inference() for x in tensors) else sum(x._version for x in tensors)


def _warn_of_impulse(duration: float) -> None:
    import warnings

    warnings.warn(
        f"detach='impulse' over {duration:g} s: without the constraint the tangent grows without bound; use windows "
        f"below {IMPULSE_WINDOW:g} s, detach='geometry' or 'none'",
        RuntimeWarning,
        stacklevel=3,
    )
