"""What one board has measured at one instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BoardSample:
    """board: its number. t: instant in the rig's time [s], which the board does not know. t_board: its own clock [s].

    pF: capacitances [pF], (sensor,), and encoder: counts, positive for a positive duty, (motor,); both NaN where this
    board does not measure. a_B: specific force [m/s^2], w_WB: angular velocity [rad/s], (3,), in the axes R of its rod.
    q_WB: attitude by its own reckoning, xyzw, (4,). battery [V]. status: a text that it sends instead of a sample.
    """

    board: int
    t: float
    t_board: float
    pF: np.ndarray
    encoder: np.ndarray
    a_B: np.ndarray
    w_WB: np.ndarray
    q_WB: np.ndarray | None
    battery: float
    status: str | None = None
