"""The fitted start states of the training windows, as they are written down."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.identify.found import WindowFound
from r2s2r_cli.stages.identify.rounds import Fit


def start_shifts(fitted: Fit) -> tuple[WindowFound, ...]:
    """Start state of each window: the filter's, moved by its fitted offsets; shift is what the fit moved [m]."""
    import torch

    from r2s2r_cli.engine import cap_velocities, end_caps
    from r2s2r_cli.engine.flat import pack_state, unpack_state
    from r2s2r_cli.stages.identify.offsets import displaced

    problem = fitted.problem
    structure, mapping = problem.predictor.structure, problem.predictor.mapping
    values, offsets = problem.split(fitted.solution.z)
    theta = mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    up = np.array([0.0, 0.0, mapping.observation(values).ground_height])
    found = []
    for k, one in enumerate(problem.windows):
        state = one.state
        if offsets is not None:
            moved = displaced(structure, pack_state(structure, state), torch.as_tensor(offsets[k : k + 1]))
            state = unpack_state(structure, moved)
        before, caps = end_caps(theta, one.state)[0].numpy(), end_caps(theta, state)[0].numpy()
        found.append(
            WindowFound(
                run=one.run.name, interval=one.intervals[0], t_first=one.start, t_last=float(one.run.t[one.frames[-1]]),
                p_WE=caps + up, v_WE=cap_velocities(theta, state)[0].numpy(), shift=caps - before,
            )
        )  # fmt: skip
    return tuple(found)
