"""How fast winches turn where a stretch begins, by each hypothesis's own account.

No cap shows it. A winch that follows its command with a lag turns as the commands before the stretch left it: begun at
the speed of the command itself it would have no start to be late at, and only run on at the end, the opposite of a lag.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, Structure

STEP_S = 0.01
LASTS = 6.0
"""Time constants after which a command is forgotten."""
LEAST_S = 1e-9
"""A winch that is this quick has no memory."""

Past = Callable[[int], np.ndarray]
"""So many commands of STEP_S up to the begin of every stretch, (k, stretch, row, actuated)."""


def turning(structure: Structure, theta: Parameters, past: Past) -> Tensor | None:
    """Winding rates (k or 1, stretch, actuated) [m/s] under parameters of batch k or 1; None where no winch lags."""
    import torch

    from r2s2r_cli.engine.hooks import effective

    if not structure.lag:
        return None
    own = effective(structure, theta)
    lag = own.lag.clamp(min=LEAST_S)
    rows = math.ceil(LASTS * float(lag.max()) / STEP_S)
    u = torch.as_tensor(past(rows)).clamp(-1.0, 1.0)
    rate = torch.where(u > 0, own.speed_in[:, None, None], own.speed_out[:, None, None]) * u
    ago = STEP_S * torch.arange(rows, dtype=lag.dtype).flip(0)[:, None]  # from the end of each command to the begin
    kept = torch.exp(-ago / lag[:, None, None]) - torch.exp(-(ago + STEP_S) / lag[:, None, None])
    return (rate * kept).sum(dim=2)
