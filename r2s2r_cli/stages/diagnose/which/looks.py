"""What camera and length sensors make of simulated states, each hypothesis with its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.begins import acting, between, rows_of
from r2s2r_cli.stages.diagnose.which.stretches import Stretch

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters, Structure


@dataclass(frozen=True)
class Seen:
    """Of one stretch, for k hypotheses: caps (k, F, cap, 3) [m], as the camera sees them, and length (k, F, sensor)
    [m], as the sensors read them; begin, end (k, NS): flat states where it begins and at its last frame. What left the
    finite numbers is nan."""

    caps: np.ndarray
    length: np.ndarray
    begin: np.ndarray
    end: np.ndarray


def looked(
    structure: Structure, theta: Parameters, flat: Tensor, rows: Tensor, many: Sequence[Stretch], behind: np.ndarray, *,
    every: float, cable_caps: Sequence[tuple[int, int]], up: float,
) -> list[tuple[np.ndarray, np.ndarray]]:  # fmt: skip
    """Caps and lengths, as `Seen`, of each stretch, from the states (row, stored, NS), which are `every` seconds apart;
    rows (k stretch,): of each hypothesis and stretch.

    theta: batch k, without the camera's delay; behind (k,) [s]: that delay. cable_caps: end caps of each cable,
    between which the sensors measure; up: height of the ground in the world [m].
    """
    import torch

    from r2s2r_cli.engine import end_caps
    from r2s2r_cli.engine.flat import unpack_state
    from r2s2r_cli.engine.hooks import effective

    k, stored = len(behind), flat.shape[1]
    one_robot = effective(structure, theta.map(lambda x: x[:1]))  # no effect moves the caps on a rod
    caps = end_caps(one_robot, unpack_state(structure, flat.flatten(0, 1))).unflatten(0, flat.shape[:2])
    ends = torch.as_tensor(cable_caps)
    length = torch.linalg.vector_norm(caps[..., ends[:, 0], :] - caps[..., ends[:, 1], :], dim=-1)[rows]
    begin = torch.as_tensor([one.window.start for one in many]).repeat(k)
    whose = torch.arange(k).repeat_interleave(len(many))
    length = _read(structure, theta, whose, length, begin[:, None] + every * torch.arange(stored))
    since = torch.as_tensor(_since(many)).repeat(k, 1)
    late = torch.as_tensor(behind).repeat_interleave(len(many))[:, None]
    shown = between(caps[rows], since / every)
    shown[..., 2] += up
    lengths = between(length, (since + late) / every).numpy()
    special = acting(structure, theta, "observation").expand(k)
    found = []
    for i, one in enumerate(many):
        F = len(one.t)
        camera = shown[i :: len(many), :F]
        _observe(structure, theta, special, torch.as_tensor(one.t), camera)
        found.append((camera.numpy(), lengths[i :: len(many), :F][..., list(one.sensors)]))
    return found


def _since(many: Sequence[Stretch]) -> np.ndarray:
    """Times of the frames of each stretch from its begin [s], (stretch, F); the last one again and again at the end."""
    most = max(len(one.t) for one in many)
    return np.array([np.pad(one.t - one.window.start, (0, most - len(one.t)), mode="edge") for one in many])


def _read(structure: Structure, theta: Parameters, whose: Tensor, length: Tensor, t: Tensor) -> Tensor:
    """Lengths (row, stored, cable) as the sensors of hypotheses whose (row,) they are read them at times t (row,
    stored) [s] of the run: only rows whose sensors are not as they should be are gone through."""
    from r2s2r_cli.engine import sense

    rows = acting(structure, theta, "sensing")[whose].nonzero()[:, 0]
    if len(rows):
        stored = length.shape[1]
        own = rows_of(theta, whose[rows].repeat_interleave(stored))
        length[rows] = sense(structure, own, length[rows].flatten(0, 1), t[rows].reshape(-1, 1)).unflatten(
            0, (len(rows), stored)
        )
    return length


def _observe(structure: Structure, theta: Parameters, special: Tensor, t: Tensor, shown: Tensor) -> None:
    """Puts what cameras that are not as they should be (special: (k,), whose) see of a stretch at times t (F,) in place
    of what is shown (k, F, cap, 3)."""
    from r2s2r_cli.engine import observe

    rows = special.nonzero()[:, 0]
    if len(rows):
        shown[rows] = observe(structure, rows_of(theta, rows), t, shown[rows])
