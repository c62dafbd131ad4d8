"""A step function at native speed: rollouts, their vector-Jacobian and their Jacobian-vector products."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor

from r2s2r_cli.engine.native import eager
from r2s2r_cli.engine.native.build import Build, Builder
from r2s2r_cli.engine.native.lanes import from_lanes
from r2s2r_cli.engine.native.packs import Twins
from r2s2r_cli.engine.native.program import Active
from r2s2r_cli.engine.native.run_backward import run_backward
from r2s2r_cli.engine.native.run_forward import run_forward
from r2s2r_cli.engine.native.run_tangent import run_tangent
from r2s2r_cli.engine.native.schedule import Schedule
from r2s2r_cli.engine.native.shapes import Sizes, checked
from r2s2r_cli.engine.native.symbolic import StepFn

RECORD = 256 * 2**20
"""Bytes of states that `recorded` may keep for a later backward pass, all together."""


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
        frames = run_forward(self._builder, s0, u, p, Schedule(h, hold, every, threads))
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
        states = run_forward(self._builder, s0, u, p, Schedule(h, hold, 1, threads))
        return from_lanes(states[:, ::every], len(s0)), states

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
        plan = Schedule(h, hold, every, threads)
        g_frames = self.sizes.adjoints(s0, g_frames, plan.frames(u.shape[1]))
        if not self.native(s0):
            grads = eager.vjp(self.fn, s0, u, p, g_frames, h=h, hold=hold, every=every)
        else:
            grads = run_backward(self._builder, s0, u, p, g_frames, plan, states)
        return grads[0], grads[1].sum_to_size(given[0]), grads[2].sum_to_size(given[1])

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
        return run_tangent(self._builder, s0, u, p, tangents, kinds, Schedule(h, hold, every, threads))

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

    def torch_rollout(self, s0: Tensor, u: Tensor, p: Tensor, *, h: float, hold: int = 1, every: int = 1) -> Tensor:
        """`forward` in plain torch: any device, differentiable by autograd."""
        s0, u, p = checked(self.sizes, s0, u, p, h, hold, every)
        return eager.rollout(self.fn, s0, u, p, h=h, hold=hold, every=every)
