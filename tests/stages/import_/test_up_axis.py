"""Which axis is said to point up where z does not."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_.checks import check_up_axis

RADIUS = 0.02
FRAMES = 50


def walked(*, start: float, rocks: float, rolls: float) -> np.ndarray:
    """Six caps (frame, cap, 3) [m] of a robot that stands on the plane y = 0 and walks along z. Its lowest three along
    x lie side by side, `start` away from 0; rocks: sd of the height of the lowest, rolls: of the others [m]."""
    rng = np.random.default_rng(0)
    x = start + np.array([0.0, 0.001, 0.002, 0.2, 0.25, 0.3])
    y = RADIUS + np.array([0.0, 0.0, 0.0, 0.2, 0.2, 0.2])
    z = np.array([0.0, 0.1, 0.3, 0.05, 0.2, 0.35])
    caps = np.broadcast_to(np.stack([x, y, z], axis=-1), (FRAMES, 6, 3)).copy()
    caps[:, :, 2] += np.linspace(0.0, 0.8, FRAMES)[:, None]
    caps[:, :3, 1] += np.abs(rocks * rng.standard_normal((FRAMES, 1)))
    caps[:, 3:, 1] += rolls * rng.standard_normal((FRAMES, 1))
    return caps


def said(caps: np.ndarray) -> str:
    """The axis that is named."""
    with pytest.raises(InputError) as caught:
        check_up_axis(caps, np.full(6, RADIUS), "log.csv")
    return caught.value.what.rpartition("(")[2].removesuffix(" is up)")


def test_the_plane_near_zero_counts_before_a_steadier_one_that_is_far_from_it() -> None:
    """The robot does not go sideways, so that x is steadier than y, along which it rocks; but nobody stands 1 m above
    the ground."""
    assert said(walked(start=1.0, rocks=0.02, rolls=0.0)) == "y"


def test_of_two_planes_near_zero_the_steadier_one_is_up() -> None:
    """By however little, and though z is as steady: it lies far from 0."""
    caps = walked(start=0.03, rocks=0.0, rolls=0.01)
    caps[..., 2] = 1.0 + np.array([0.0, 0.0, 0.0, 0.2, 0.25, 0.3])
    assert said(caps) == "y"


def test_a_robot_that_stands_on_z_is_taken_as_it_is() -> None:
    """Steadier planes far from 0 are walls."""
    caps = walked(start=1.0, rocks=0.02, rolls=0.0)[..., [2, 0, 1]]
    assert check_up_axis(caps, np.full(6, RADIUS), "log.csv") == []
