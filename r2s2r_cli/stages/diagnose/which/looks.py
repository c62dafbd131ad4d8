"""What camera and length sensors make of simulated states, each hypothesis with its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.begins import TINY, acting, rows_of
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

    def of(self, rows: np.ndarray | Sequence[int]) -> Seen:
        """Some of the hypotheses."""
        return Seen(self.caps[rows], self.length[rows], self.begin[rows], self.end[rows])


def joined(parts: Sequence[Seen]) -> Seen:
    """Of one stretch, all hypotheses."""
    if len(parts) == 1:
        return parts[0]
    return Seen(*(np.concatenate([getattr(one, name) for one in parts]) for name in ("caps", "length", "begin", "end")))


def looked(
    structure: Structure, theta: Parameters, flat: Tensor, rows: Tensor, many: Sequence[Stretch], behind: np.ndarray,
    lag: np.ndarray, *, every: float, p_BE: Tensor, cable_caps: Sequence[tuple[int, int]], up: float,
) -> list[tuple[np.ndarray, np.ndarray]]:  # fmt: skip
    """Caps and lengths, as `Seen`, of each stretch, from the states (row, stored, NS), which are `every` seconds apart;
    rows (k stretch,): of each hypothesis and stretch.

    theta: batch k, without the camera's delay; behind (k,) [s]: that delay; lag (k,) [s]: of the sensors, which read
    before the first state as if what moves there had moved on before. p_BE (1, rod, 2, 3) [m]: caps on the rods,
    which no effect moves. cable_caps: end caps of each cable, between which the sensors measure; up: height of the
    ground in the world [m].
    """
    import torch

    k, stored = len(behind), flat.shape[1]
    caps = caps_of(structure, p_BE, flat)
    since = np.tile(_since(many), (k, 1))
    first = rows.numpy()[:, None] * stored
    low, share = _places(since / every, stored)
    shown = _mixed(caps.take(first + low, axis=0), caps.take(first + low + 1, axis=0), share)
    shown = shown.reshape(*low.shape, -1, 3)
    shown[..., 2] += up
    low, share = _places((since + np.repeat(behind - lag, len(many))[:, None]) / every, stored, before=True)
    begin = torch.as_tensor([one.window.start for one in many])
    stamps = (begin[:, None] + every * torch.arange(stored)).repeat(k, 1).numpy()
    ends = np.asarray(cable_caps)
    acts = acting(structure, theta, "sensing").repeat_interleave(len(many)).nonzero()[:, 0]
    around = []
    for place in (low, low + 1):
        own = caps.take(first + place, axis=0).reshape(*place.shape, -1, 3)
        length = torch.linalg.vector_norm(torch.as_tensor(own[..., ends[:, 0], :] - own[..., ends[:, 1], :]), dim=-1)
        t = torch.as_tensor(np.take_along_axis(stamps, place, axis=1))
        around.append(_read(structure, theta, acts, len(many), length, t).numpy())
    lengths = _mixed(around[0], around[1], share)
    cameras = torch.as_tensor(shown)
    special = acting(structure, theta, "observation").expand(k).nonzero()[:, 0]
    theirs = rows_of(theta, special) if len(special) else theta
    found = []
    for i, one in enumerate(many):
        F = len(one.t)
        if len(special):
            _observe(structure, theirs, special, torch.as_tensor(one.t), cameras[i :: len(many), :F])
        found.append((shown[i :: len(many), :F], lengths[i :: len(many), :F][..., list(one.sensors)]))
    return found


def caps_of(structure: Structure, p_BE: Tensor, flat: Tensor) -> np.ndarray:
    """End caps of flat states (row, stored, NS), one after the other, (row stored, 3 cap) [m]. p_BE: as of `looked`.

    Where caps lie on the axes of their rods, only the axes are turned: the same numbers as `end_caps`, in a sixth of
    its time.
    """
    from r2s2r_cli.engine.flat import state_slots

    slots = state_slots(structure)
    states = flat.numpy().reshape(-1, flat.shape[-1])
    p, q = (
        np.ascontiguousarray(states[:, slots[name].start : slots[name].start + slots[name].size].T)
        .reshape(*slots[name].shape, -1) for name in ("p_WB", "q_WR")
    )  # fmt: skip
    if not structure.axial:
        return _turned(p, q, p_BE)
    x, y, z, w = np.moveaxis(q, 1, 0)
    axis = np.stack([2 * (x * z + y * w), 2 * (y * z - x * w), -(x * x) - y * y + z * z + w * w], axis=1)
    caps = p[:, None] + axis[:, None] * p_BE.numpy()[0, :, :, 2, None, None]
    return np.ascontiguousarray(caps.reshape(-1, len(states)).T)


def _turned(p: np.ndarray, q: np.ndarray, p_BE: Tensor) -> np.ndarray:
    """Caps anywhere on rods, (state, 3 cap), from places (rod, 3, state) and turns (rod, 4, state): whole rotations."""
    import roma
    import torch

    R = roma.unitquat_to_rotmat(torch.as_tensor(np.moveaxis(q, -1, 0))).numpy()
    caps = p.transpose(2, 0, 1)[:, :, None] + np.einsum("brij,rej->brei", R, p_BE[0].numpy())
    return np.asarray(caps.reshape(p.shape[-1], -1))


def _since(many: Sequence[Stretch]) -> np.ndarray:
    """Times of the frames of each stretch from its begin [s], (stretch, F); the last one again and again at the end."""
    own = [one.t - one.window.start for one in many]
    found = np.empty((len(own), max(map(len, own))))
    for row, t in zip(found, own, strict=True):
        row[: len(t)], row[len(t) :] = t, t[-1]
    return found


def _places(place: np.ndarray, stored: int, *, before: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Of places (row, F) among stored states the ones before, and shares of the next ones, as `begins.between`.
    before: places before the first state go on along the first straight line."""
    low = np.clip(np.floor(place + TINY).astype(int), 0, stored - 2)
    return low, np.clip(place - low, -np.inf if before else 0.0, 1.0)


def _mixed(low: np.ndarray, high: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Between values (row, F, n) before and after, at shares (row, F) of the way."""
    return np.asarray(low * (1 - share[..., None]) + high * share[..., None])


def _read(
    structure: Structure, theta: Parameters, acts: Tensor, stretches: int, length: Tensor, t: Tensor
) -> Tensor:  # fmt: skip
    """Lengths (row, F, cable) as the sensors read them at times t (row, F) [s] of the run: only those rows (acts) are
    gone through whose sensors are not as they should be."""
    from r2s2r_cli.engine import sense

    if len(acts):
        frames = length.shape[1]
        own = rows_of(theta, (acts // stretches).repeat_interleave(frames))
        read = sense(structure, own, length[acts].flatten(0, 1), t[acts].reshape(-1, 1))
        length[acts] = read.unflatten(0, (len(acts), frames))
    return length


def _observe(structure: Structure, theta: Parameters, special: Tensor, t: Tensor, shown: Tensor) -> None:
    """Puts what cameras that are not as they should be (special: whose) see of a stretch at times t (F,) in place of
    what is shown (k, F, cap, 3). theta: of those."""
    from r2s2r_cli.engine import observe

    shown[special] = observe(structure, theta, t, shown[special])
