"""Whitened responses of every target interval to every probe, as products of columns: all that a fit needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.where.probes import KINDS, WINCHED_N, ProbeModel
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.mixture import weight
from r2s2r_cli.stages.identify.predict import Predictor

if TYPE_CHECKING:
    from r2s2r_cli.stages.identified import Identified

TIMING = {"command_delay": 0.015}
"""Further nuisances and prior sd [s]: half a control tick is in no log."""
TILTED_RAD = 0.1
FARTHEST = 10.0
"""A probe of its prior's size moves what is seen by at most so many standard deviations, root mean square."""
CAMERA_ONLY = 2
"""The last columns of `_observed` move what is seen, and no cable."""
LATER_S = 0.03
"""[s] by which commands are shifted for the secant of the command probe."""


@dataclass(frozen=True)
class Column:
    """One number of a probe. scale: sd of its prior, in `unit`. varies: from interval to interval; else it is the same
    in all of them."""

    probe: str
    channel: str
    element: Element
    unit: str
    scale: float
    varies: bool = True


@dataclass(frozen=True)
class Design:
    """Products of whitened columns of every stretch. gram: (stretch, kind, q + P + 1, q + P + 1), white under each kind
    of error: q nuisances, P probes over their scales, then the innovations themselves (observed less simulated).
    logdet: of the covariance, (stretch, kind). columns: of the probes. size: data of each stretch; gait: number of its
    gait; known: how well the refit knows the nuisances, their precision (q, q). caps: simulated, of every stretch
    (F, cap, 3) [m]; innovation: cap residuals, white as the floor says, (F, cap, 3).
    """

    gram: np.ndarray
    logdet: np.ndarray
    columns: tuple[Column, ...]
    size: np.ndarray
    gait: np.ndarray
    known: np.ndarray
    caps: tuple[np.ndarray, ...]
    innovation: tuple[np.ndarray, ...]

    @property
    def q(self) -> int:
        """How many nuisances."""
        return len(self.known)

    def of(self, channel: str) -> np.ndarray:
        """Places among the probes of a channel's columns."""
        return np.array([k for k, one in enumerate(self.columns) if one.channel == channel], dtype=int)


def design(
    nominal: Identified, arena: Arena, z: np.ndarray, *, cache_dir: Path | None = None, threads: int = 2
) -> Design:
    """At the nuisances z of an arena that was prepared there. Raises NumericalError where nothing can be simulated."""
    replayer = arena.replayer
    values = arena.values(z[None])[0]
    model = ProbeModel(nominal, arena.model, values)
    predictor = Predictor(model, step=replayer.step, cache_dir=cache_dir, threads=threads)  # type: ignore[arg-type]
    windows = [one.window for one in arena.many]
    seen = predictor.predict(windows, np.zeros(len(model.names)), jacobian=True)
    assert seen.by_value is not None  # noqa: S101 - it was asked for
    later = _later(predictor, model, arena)
    residual = arena.residuals(values[None], z[None])[0]
    columns = _columns(model, arena)
    scale = np.array([one.scale for one in columns])
    spread = 1.0 / np.sqrt(np.diag(arena.precision))
    grams: list[list[np.ndarray]] = []
    caps, innovations = [], []
    for k, one in enumerate(arena.many):
        rows = seen.window == k
        own = seen.p_WE[rows]
        caps.append(own)
        by = np.concatenate([seen.by_value[rows], later[rows][..., None], _observed(own, one.t)], axis=-1)
        whole = np.concatenate([_channels(arena, own, by), _sensing(arena, len(own))], axis=0)
        white = arena.white[k]
        probes, timing = whole * scale[:, None, None], _timing(arena, own, later[rows])
        reach = _reach(white.white(probes), white.size)
        probes = np.where((reach > 0)[:, None, None], probes, 0.0) * reach[:, None, None]
        held = _reach(arena.by_nuisance[white.rows].T * spread[:, None], white.size)
        grams.append([])
        for kind in white.kinds:
            nuisances = np.nan_to_num(arena.by_nuisance[kind.rows].T) * held[:, None]
            joined = np.concatenate(
                [nuisances, kind.white(timing), kind.white(probes), -residual[None, kind.rows]], axis=0
            )
            grams[-1].append(joined @ joined.T)
        count = own.shape[1] * 3
        innovation = -residual[white.rows].reshape(-1, len(own))[:count]
        innovations.append(innovation.reshape(own.shape[1], 3, len(own)).transpose(2, 0, 1))
    gram, q = np.array(grams), len(z) + len(TIMING)
    w = weight(gram[..., -1, -1], arena.logdets, arena.sizes)
    # Not from their prior anew: half of the gaits may leave one of them open, far beyond where derivatives hold.
    known = np.zeros((q, q))
    known[: len(z), : len(z)] = _levelled(arena) + np.einsum("sc,scij->ij", w, gram[..., : len(z), : len(z)])
    known[range(len(z), q), range(len(z), q)] = [sd**-2.0 for sd in TIMING.values()]
    return Design(gram, arena.logdets, tuple(columns), arena.sizes, arena.gait, known, tuple(caps), tuple(innovations))


def _timing(arena: Arena, caps: np.ndarray, later: np.ndarray) -> np.ndarray:
    """Responses to TIMING: commands that act later, (1, channel, F)."""
    return _channels(arena, caps, np.concatenate([later[..., None], np.zeros((*caps.shape, CAMERA_ONLY))], axis=-1))[:1]


def _levelled(arena: Arena) -> np.ndarray:
    """The prior of an arena's nuisances, but for the camera's tilt: a floor that is not level tilts what is seen as
    much as it leans the robot, and only the latter is to be explained here."""
    precision = arena.precision.copy()
    for k, name in enumerate(arena.names):
        if name.startswith("camera_tilt"):
            precision[k], precision[:, k] = 0.0, 0.0
            precision[k, k] = TILTED_RAD**-2.0
    return precision


def _reach(white: np.ndarray, size: int) -> np.ndarray:
    """Factors (P,) on columns (P, row) that make those smaller that move the caps by more than derivatives hold; 0
    where nothing finite came out: a robot about to tip over."""
    finite = np.isfinite(white).all(axis=1)
    length = np.sqrt(np.sum(np.where(finite[:, None], white, 0.0) ** 2, axis=1) / size)
    return np.asarray(np.where(finite, np.minimum(1.0, FARTHEST / np.maximum(length, 1e-12)), 0.0))


def _columns(model: ProbeModel, arena: Arena) -> list[Column]:
    robot = model.robot
    found = []
    for name in (*model.names, "delay.all", "scale.all", "late.all"):
        probe, _, index = name.partition(".")
        kind = KINDS[probe]
        if index == "all":
            found.append(Column(probe, kind.channel, Element(kind.kind), kind.unit, kind.scale, False))
            continue
        k = int(index)
        scale = kind.scale
        if probe == "rate":
            k = robot.actuated[k]
        elif probe == "force" and robot.cables[k].kind == "actuated":
            scale = WINCHED_N
        elif probe == "push":
            k //= 2
        found.append(Column(probe, kind.channel, Element(kind.kind, k), kind.unit, scale))
    bias = KINDS["bias"]
    return found + [
        Column("bias", bias.channel, Element(bias.kind, k), bias.unit, bias.scale, False) for k in arena.sensors
    ]


def _later(predictor: Predictor, model: ProbeModel, arena: Arena) -> np.ndarray:
    """Secant of the caps by a delay of all commands, (F, cap, 3) [m/s]."""
    from dataclasses import replace

    many = [one.window for one in arena.many]
    moved = {id(w.run): replace(w.run, t_command=w.run.t_command + LATER_S) for w in many}
    shifted = [replace(w, run=moved[id(w.run)]) for w in many]
    zero = np.zeros(len(model.names))
    both = [predictor.predict(windows, zero).p_WE for windows in (shifted, many)]
    return np.asarray((both[0] - both[1]) / LATER_S)


def _observed(caps: np.ndarray, t: np.ndarray) -> np.ndarray:
    """What scale and delay of the camera do to caps (F, cap, 3), per unit, (F, cap, 3, 2)."""
    away = caps - caps.mean(axis=(0, 1))
    rate = np.gradient(caps, t, axis=0) if len(t) > 1 else np.zeros_like(caps)
    return np.stack([away, -rate], axis=-1)


def _channels(arena: Arena, caps: np.ndarray, by: np.ndarray) -> np.ndarray:
    """Responses of the caps (F, cap, 3, D) as those of all channels of an arena, (D, channel, F)."""
    seen = by.reshape(len(caps), -1, by.shape[-1]).transpose(2, 1, 0)
    if not arena.sensors:
        return seen
    ends = np.array([arena.replayer.cable_caps[cable] for cable in arena.sensors])
    way = caps[:, ends[:, 0]] - caps[:, ends[:, 1]]
    way = way / np.linalg.norm(way, axis=-1, keepdims=True)
    length = np.einsum("fsi,fsid->dsf", way, by[:, ends[:, 0]] - by[:, ends[:, 1]])
    length[-CAMERA_ONLY:] = 0.0
    return np.concatenate([seen, length], axis=1)


def _sensing(arena: Arena, frames: int) -> np.ndarray:
    """Responses to a bias of each sensor, (sensor, channel, F)."""
    count = len(arena.sensors)
    caps = 3 * arena.many[0].caps.shape[1]
    found = np.zeros((count, caps + count, frames))
    for s in range(count):
        found[s, caps + s] = 1.0
    return found
