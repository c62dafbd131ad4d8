"""A step function at native speed: rollouts, their vector-Jacobian and their Jacobian-vector products."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from torch import Tensor

from r2s2r_cli.engine.native import eager, machine
from r2s2r_cli.engine.native.build import Build, Builder, Kernel
from r2s2r_cli.engine.native.lanes import address, from_lanes, places, to_lanes
from r2s2r_cli.engine.native.packs import Twins
from r2s2r_cli.engine.native.program import Active
from r2s2r_cli.engine.native.shapes import Sizes, checked
from r2s2r_cli.engine.native.symbolic import StepFn

CHUNK = 256
"""Steps between checkpoints of a backward pass that would need more than STATES bytes for all its states."""

STATES = 32 * 2**20
"""Bytes of states that a backward pass may keep per thread and block of lanes."""

RECORD = 256 * 2**20
"""Bytes of states that `recorded` may keep for a later backward pass, all together."""


@dataclass(frozen=True)
class Schedule:
    """Times of a rollout. h: step [s]. hold: steps that a row of inputs is held. every: steps from frame to frame.
    threads: blocks of lanes that run side by side."""

    h: float
    hold: int
    every: int
    threads: int = 1

    def steps(self, rows: int) -> int:
        """Number of steps for so many rows of inputs."""
        return rows * self.hold

    def frames(self, rows: int) -> int:
        """Number of frames, the initial state counted."""
        return self.steps(rows) // self.every + 1


class NativeStep:
    """Kernels of one step function `(s (B, NS), u (B, NU), p (B, NP), h (B, 1)) -> s' (B, NS)`.

    Kernels are traced and compiled when first used, or read from `cache_dir`; `key` must tell step functions apart, and
    change when what they compute does. Shapes below: B environments, K rows of inputs, F = K hold // every + 1 frames,
    the first being the initial state; D directions. float64 and float32, as `s0`. Tensors that are not on the CPU, and
    machines without llvmlite, take the torch path, with one warning. twins: groups of inputs that are the same quantity
    of equal parts, see `packs`; they change speed and nothing else.

    Raises EngineInputError for wrong shapes, TracingError where the function cannot be compiled.
    """

    def __init__(
        self,
        fn: StepFn,
        n_state: int,
        n_input: int,
        n_param: int,
        *,
        key: str,
        cache_dir: Path | None = None,
        twins: Twins = (),
    ) -> None:
        self.fn = fn
        self.sizes = Sizes(n_state, n_input, n_param)
        self._builder = Builder(fn, (n_state, n_input, n_param), key, cache_dir, twins)

    @property
    def build_log(self) -> list[Build]:
        """What it took to make the kernels so far, in order."""
        return self._builder.log

    def native(self, s0: Tensor) -> bool:
        """Whether rollouts of this state run in kernels; if not, the reason is warned of once."""
        return eager.runs_native(s0)

    def forward(
        self, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int = 1, every: int = 1, threads: int = 1
    ) -> Tensor:
        """Frames (B, F, NS) of rollouts from s0 (B, NS) with inputs u (B or 1, K, NU), parameters p (B or 1, NP)."""
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        if not self.native(s0):
            with torch.no_grad():
                return eager.rollout(self.fn, s0, u, p, h=h, hold=hold, every=every)
        frames = self._forward(s0, u, p, Schedule(h, hold, every, threads))
        return from_lanes(frames, len(s0))

    def recorded(
        self, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int = 1, every: int = 1, threads: int = 1
    ) -> tuple[Tensor, Tensor | None]:
        """The frames, and for `vjp` the states of all steps as kernels hold them; None if they are too many to keep.

        Kernels only: `native(s0)` must hold.
        """
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        n = u.shape[1] * hold
        if s0.numel() * s0.element_size() * (n + 1) > RECORD:
            return self.forward(s0, u, p, h=h, hold=hold, every=every, threads=threads), None
        states = self._forward(s0, u, p, Schedule(h, hold, 1, threads))
        return from_lanes(states[:, ::every], len(s0)), states

    def _forward(self, s0: Tensor, u: Tensor, p: Tensor, plan: Schedule) -> Tensor:
        """Frames by block."""
        batch, rows = u.shape[:2]
        lanes = self._lanes(batch, s0.dtype)
        kernel = self._builder.kernel(Kernel("forward", s0.dtype, lanes))
        state, inputs, parameters, step = self._arrays(s0, u, p, plan, lanes)
        frames = state.new_empty((state.shape[0], plan.frames(rows), *state.shape[1:]))
        frames[:, 0] = state
        n = plan.steps(rows)

        (s_0, s_b), (f_0, f_b), (u_0, u_b), (p_0, p_b) = map(places, (state, frames, inputs, parameters))
        h = step.data_ptr()

        def run(block: int) -> None:
            at = (s_0 + s_b * block, f_0 + f_b * block, u_0 + u_b * block, p_0 + p_b * block)
            kernel(*at, h, 0, n, plan.hold, plan.every)

        if n:
            _spread(run, range(len(state)), plan.threads)
        return frames

    def vjp(
        self,
        s0: Tensor,
        u: Tensor,
        p: Tensor,
        g_frames: Tensor,
        *,
        h: float,
        hold: int = 1,
        every: int = 1,
        threads: int = 1,
        states: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Adjoints of s0, u and p, each of its own shape, for adjoints g_frames (B, F, NS) of the frames.

        states: of the same rollout, by `recorded`. Without them it runs again, and memory stays bounded: long rollouts
        are stored at checkpoints, and the stretches between run once more.
        """
        given = (u.shape, p.shape)
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        if not self.native(s0):
            grads = eager.vjp(self.fn, s0, u, p, g_frames, h=h, hold=hold, every=every)
        else:
            grads = self._vjp(s0, u, p, g_frames.to(s0.dtype), Schedule(h, hold, every, threads), states)
        return grads[0], grads[1].sum_to_size(given[0]), grads[2].sum_to_size(given[1])

    def _vjp(
        self, s0: Tensor, u: Tensor, p: Tensor, g_frames: Tensor, plan: Schedule, record: Tensor | None
    ) -> tuple[Tensor, Tensor, Tensor]:
        batch, rows = u.shape[:2]
        lanes = self._lanes(batch, s0.dtype)
        backward = self._builder.kernel(Kernel("backward", s0.dtype, lanes))
        state, inputs, parameters, step = self._arrays(s0, u, p, plan, lanes)
        seeds = to_lanes(g_frames, lanes)
        adjoint = torch.zeros_like(state)
        g_inputs, g_parameters = torch.zeros_like(inputs), torch.zeros_like(parameters)
        n = plan.steps(rows)

        def back(block: int, states: Tensor, start: int, end: int) -> None:
            """Adjoints through steps start to end, whose states are given."""
            arrays = (inputs, parameters), (adjoint, seeds, g_inputs, g_parameters)
            (u0, p0), rest = ([address(x, block) for x in group] for group in arrays)
            backward(states.data_ptr(), u0, p0, step.data_ptr(), *rest, start, end, plan.hold, plan.every)

        def run(block: int) -> None:
            if record is not None and n:
                back(block, record[block], 0, n)
            else:
                given = (address(inputs, block), address(parameters, block), step.data_ptr())
                for states, start, end in self._stretches(state[block], given, n, plan.hold):
                    back(block, states, start, end)
            adjoint[block] += seeds[block, 0]

        _spread(run, range(len(state)), plan.threads)
        return from_lanes(adjoint, batch), from_lanes(g_inputs, batch), from_lanes(g_parameters, batch)

    def _stretches(
        self, state: Tensor, given: tuple[int, int, int], n: int, hold: int
    ) -> Iterator[tuple[Tensor, int, int]]:
        """The states of all steps of one block, in stretches from the last to the first: (states, start, end)."""
        forward = self._builder.kernel(Kernel("forward", state.dtype, state.shape[-1]))
        size = state.numel() * state.element_size()
        chunk = n if n * size <= STATES else CHUNK
        starts = list(range(0, n, max(chunk, 1)))
        marks = state.new_empty((len(starts), *state.shape))
        now = state.clone()
        for k, start in enumerate(starts):
            marks[k] = now
            if k + 1 < len(starts):
                # `every` beyond the rollout: no frame is written.
                forward(now.data_ptr(), 0, *given, start, start + chunk, hold, n + 1)
        states = state.new_empty((min(chunk, n) + 1, *state.shape))
        for k, start in reversed(list(enumerate(starts))):
            end = min(start + chunk, n)
            states[0] = marks[k]
            now.copy_(marks[k])
            if end - start > 1:
                # The state after step t is frame t + 1, and belongs in place t + 1 - start.
                forward(now.data_ptr(), states.data_ptr() - start * size, *given, start, end - 1, hold, 1)
            yield states, start, end

    def jvp(
        self,
        s0: Tensor,
        u: Tensor,
        p: Tensor,
        *,
        ds0: Tensor | None = None,
        du: Tensor | None = None,
        dp: Tensor | None = None,
        active: tuple[int, ...] | None = None,
        h: float,
        hold: int = 1,
        every: int = 1,
        threads: int = 1,
    ) -> tuple[Tensor, Tensor]:
        """Frames (B, F, NS) and their tangents (B, F, NS, D), for tangents ds0 (B, NS, D), du (B, K, NU, D) and
        dp (B, NP, D); None is zero, and costs nothing. Batches of 1 are repeated.

        active: places of the parameter vector that may carry a tangent, all by default; dp is read there only.
        """
        if not self.native(s0):
            return self.torch_jvp(s0, u, p, ds0=ds0, du=du, dp=dp, active=active, h=h, hold=hold, every=every)
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        tangents = self.sizes.tangents(s0, u, ds0, du, dp)
        places = () if dp is None else tuple(range(self.sizes.n_param)) if active is None else active
        if dp is not None:
            tangents = (*tangents[:2], tangents[2][:, list(places)])
        kinds = Active(ds0 is not None, du is not None, places)
        return self._jvp(s0, u, p, tangents, kinds, Schedule(h, hold, every, threads))

    def torch_jvp(
        self,
        s0: Tensor,
        u: Tensor,
        p: Tensor,
        *,
        ds0: Tensor | None = None,
        du: Tensor | None = None,
        dp: Tensor | None = None,
        active: tuple[int, ...] | None = None,
        h: float,
        hold: int = 1,
        every: int = 1,
    ) -> tuple[Tensor, Tensor]:
        """The same as `jvp` in plain torch, on any device."""
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        tangents = self.sizes.tangents(s0, u, ds0, du, dp)
        return eager.jvp(self.fn, s0, u, p, tangents, active, h=h, hold=hold, every=every)

    def _jvp(
        self, s0: Tensor, u: Tensor, p: Tensor, tangents: tuple[Tensor, Tensor, Tensor], kinds: Active, plan: Schedule
    ) -> tuple[Tensor, Tensor]:
        (batch, rows), directions = u.shape[:2], tangents[0].shape[-1]
        base = machine.vector_bytes() // s0.element_size()
        lanes = base if directions <= base else 2 * base
        kernel = self._builder.kernel(Kernel("tangent", s0.dtype, lanes, kinds))
        state, inputs, parameters, step = self._arrays(s0, u, p, plan, 1)
        passes = -(-directions // lanes)
        ds, du, dp = (torch.nn.functional.pad(x, (0, passes * lanes - directions)) for x in tangents)
        frames = s0.new_empty((batch, plan.frames(rows), s0.shape[1]))
        frames[:, 0] = s0
        d_frames = s0.new_empty((*frames.shape, passes * lanes))
        n = plan.steps(rows)

        def run(task: int) -> None:
            k, part = divmod(task, passes)
            chosen = slice(part * lanes, (part + 1) * lanes)
            d_state, d_inputs, d_parameters = (
                x[k, ..., chosen].clone(memory_format=torch.contiguous_format) for x in (ds, du, dp)
            )
            now = state[k].clone()
            tangent_frames = d_frames.new_empty((*frames.shape[1:], lanes))
            tangent_frames[0] = d_state
            if n:
                arrays = (
                    now,
                    d_state,
                    frames[k],
                    tangent_frames,
                    inputs[k],
                    d_inputs,
                    parameters[k],
                    d_parameters,
                    step,
                )
                kernel(*(x.data_ptr() for x in arrays), 0, n, plan.hold, plan.every)
            d_frames[k, ..., chosen] = tangent_frames

        _spread(run, range(batch * passes), plan.threads)
        return frames, d_frames[..., :directions]

    def torch_rollout(self, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int = 1, every: int = 1) -> Tensor:
        """`forward` in plain torch: any device, differentiable by autograd."""
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        return eager.rollout(self.fn, s0, u, p, h=h, hold=hold, every=every)

    def _lanes(self, batch: int, dtype: torch.dtype) -> int:
        return 1 if batch == 1 else machine.vector_bytes() // dtype.itemsize

    def _arrays(
        self, s0: Tensor, u: Tensor, p: Tensor, plan: Schedule, lanes: int
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """State, inputs and parameters by block, and the step."""
        step = s0.new_full((lanes,), plan.h)
        return to_lanes(s0, lanes), to_lanes(u, lanes), to_lanes(p, lanes), step


def _spread(run: Callable[[int], None], tasks: Iterable[int], threads: int) -> None:
    """Run all tasks, in so many threads: kernels let go of Python's lock."""
    waiting = list(tasks)
    helpers = min(threads, len(waiting)) - 1
    left = iter(waiting)  # one for all: whoever is free takes the next

    def work() -> None:
        for task in left:
            run(task)

    if helpers < 1:
        work()
        return
    pool = _pool(threads - 1, os.getpid())
    helped = [pool.submit(work) for _ in range(helpers)]
    try:
        work()
    finally:
        wait(helped)
    for one in helped:
        one.result()


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads that stay: a rollout of a few steps takes less time than to start them. process: a forked one has none of
    its parent's threads."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"kernels-{process}")
