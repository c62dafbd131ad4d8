"""Rollouts by the forward kernel."""

from __future__ import annotations

from torch import Tensor

from r2s2r_cli.engine.native.build import Builder, Kernel
from r2s2r_cli.engine.native.lanes import places
from r2s2r_cli.engine.native.schedule import Schedule, given_arrays, lanes_for
from r2s2r_cli.engine.native.threads import spread


def run_forward(builder: Builder, s0: Tensor, u: Tensor, p: Tensor, plan: Schedule) -> Tensor:
    """Frames by block (block, F, NS, lane) of s0 (B, NS), u (B, K, NU), p (B, NP). Raises TracingError."""
    batch, rows = u.shape[:2]
    lanes = lanes_for(batch, s0.dtype)
    kernel = builder.kernel(Kernel("forward", s0.dtype, lanes))
    state, inputs, parameters, step = given_arrays(s0, u, p, plan, lanes)
    frames = state.new_empty((state.shape[0], plan.frames(rows), *state.shape[1:]))
    frames[:, 0] = state
    n = plan.steps(rows)

    (s_0, s_b), (f_0, f_b), (u_0, u_b), (p_0, p_b) = map(places, (state, frames, inputs, parameters))
    h = step.data_ptr()

    def run(block: int, _alive: tuple[Tensor, ...] = (state, frames, inputs, parameters, step)) -> None:
        # Arrays that the threads write to must live as long as they run, also when the caller has been interrupted.
        at = (s_0 + s_b * block, f_0 + f_b * block, u_0 + u_b * block, p_0 + p_b * block)
        kernel(*at, h, 0, n, plan.hold, plan.every)

    if n:
        spread(run, range(len(state)), plan.threads)
    return frames
