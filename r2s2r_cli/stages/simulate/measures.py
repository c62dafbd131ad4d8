"""Figures of a simulated run: how far it came, how it turned, what it did to ground and cables."""

from __future__ import annotations

import numpy as np

UPRIGHT = 0.05
"""A mean rod axis of which less than this share lies in the ground plane has no heading worth the name."""
SLACK_N = 1e-3
"""A cable with less tension counts as slack."""


def com_path(com: np.ndarray) -> float:
    """Length of the way over the ground [m] of centres of mass (frame, 3) [m]."""
    return float(np.linalg.norm(np.diff(com[:, :2], axis=0), axis=-1).sum())


def heading_change(p_WE: np.ndarray) -> float | None:
    """Turn of the mean rod axis about the vertical [rad] over frames (frame, cap, 3) [m], whole turns counted.

    None where it has no direction in the ground plane at some frame.
    """
    heading = headings(p_WE)
    return None if heading is None else float(heading[-1] - heading[0])


def headings(p_WE: np.ndarray) -> np.ndarray | None:
    """Heading of the mean rod axis (frame,) [rad] over frames (frame, cap, 3) [m], whole turns counted.

    The mean of the unit axes, even to odd cap: for the 3-bar prism that is the axis it rolls about, and rolling does
    not change it. None where it has no direction in the ground plane at some frame.
    """
    axis = p_WE[:, 1::2] - p_WE[:, 0::2]
    mean = (axis / np.linalg.norm(axis, axis=-1, keepdims=True)).mean(axis=1)
    if (np.linalg.norm(mean[:, :2], axis=-1) < UPRIGHT).any():
        return None
    return np.asarray(np.unwrap(np.arctan2(mean[:, 1], mean[:, 0])))


def penetration(p_WE: np.ndarray, radius: np.ndarray) -> float:
    """Deepest that any cap (frame, cap, 3) [m] of radius (cap,) [m] lies below z = 0 [m], 0 where none does."""
    return max(0.0, float((radius - p_WE[..., 2]).max()))


def slack_share(tension: np.ndarray) -> tuple[float, ...]:
    """Share of the frames in which each cable is slack, of tensions (frame, cable) [N]."""
    return tuple((tension < SLACK_N).mean(axis=0).tolist())
