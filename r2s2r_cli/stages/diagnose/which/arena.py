"""Where hypotheses meet the data: residuals of all streams together, white under noise, floor and unknown starts.

Every stretch starts in a state that is not quite known. Its offsets are normal numbers of their own, so they are not
fitted: they are part of the covariance, the same for every hypothesis. So is the floor, a simulator's own error, which
grows along a stretch like a random walk.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.replay import Replayer, Seen
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identify.offsets import StartSpread

CAMERA = (("camera_height", "m", 2e-3), ("camera_tilt_x", "rad", 5e-3), ("camera_tilt_y", "rad", 5e-3))
"""What is left of the rigid alignment of the camera after levelling: name, unit, prior sd. Over the plane it is part of
where a stretch starts."""
SENSOR_SD = 3e-3
"""[m] What a length sensor is off by, the same all the time, before anything is called an effect."""
SENSOR_LAG_SD = 0.04
"""[s] By how much all length readings are late, before anything is called an effect: filters, converters and half a
control tick are in no log, and a lag of 40 ms is 2 to 3 mm on every ramp."""
SECANT = 0.3
"""Of a nuisance's prior sd, to both sides: over what its derivative is taken."""
TRIMMED = 0.85
"""Share of the stretches that the size of the floor is learned from."""
ABSENT = 1e3
"""[m] Sd of a reading that is not there."""
REST_SD = 5e-3
"""[m] What the rest length of a winched cable is off by throughout a run: nobody sees it, and the filter hardly."""
START = StartSpread(position=3e-3, tilt=0.015, roll=0.08, rest=3e-3)
"""Of the offsets that are free (`Replayer.moved`)."""


@dataclass(frozen=True)
class White:
    """How residuals of one stretch become white. roots (channel, F, F): inverse Cholesky factors of noise and floor;
    U (channel F, offset), shrink (offset,): what is taken off along the offsets of the start. rows: its place among all
    residuals; size: how many of them are data; logdet: of the covariance."""

    roots: np.ndarray
    U: np.ndarray
    shrink: np.ndarray
    rows: slice
    size: int
    logdet: float = 0.0


class Arena:
    """Stretches, the engine, and the covariance at one nominal point. Unknowns z of the nuisances (p + q,): those of
    the engine, then camera and sensor biases, which are simple shifts of what is seen."""

    def __init__(
        self, replayer: Replayer, many: Sequence[Stretch], *, floor_m: float, noise: float = 1.0,
        prior: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:  # fmt: skip
        """floor_m: of the simulator alone, cap RMSE at the end of a stretch. noise: factor on the stated noise. prior:
        mean and precision matrix of the nuisances, of healthy runs; None: nominal."""
        self.replayer, self.model, self.many = replayer, replayer.model, tuple(many)
        self.floor_m, self.noise = floor_m, noise
        self.sensors = next((one.sensors for one in many if one.length is not None), ())
        self.engine = list(self.model.nuisances)
        self.runs = tuple(dict.fromkeys(one.run for one in many))
        winched = self.model.robot.actuated
        shared = (
            *(self.model.names[k] for k in self.engine), *(name for name, _, _ in CAMERA),
            *(f"sensor_bias_{k}" for k in self.sensors), *(("sensor_lag",) if self.sensors else ()),
        )  # fmt: skip
        self.shared = len(shared)
        """How many nuisances are the same in every run; the others are the rest lengths that runs began with."""
        self.names = (*shared, *(f"rest_{run}_{cable}" for run in self.runs for cable in winched))
        own = [self.model.numbers[k] for k in self.engine]
        sd = np.array([n.sd for n in own] + [sd for _, _, sd in CAMERA] + [SENSOR_SD] * len(self.sensors)
                      + [SENSOR_LAG_SD] * bool(self.sensors) + [REST_SD] * (len(self.runs) * len(winched)))  # fmt: skip
        low, high = np.array([n.within for n in own]).T
        self.lower = np.concatenate([low, np.full(len(sd) - len(own), -np.inf)])
        self.upper = np.concatenate([high, np.full(len(sd) - len(own), np.inf)])
        own_mean = np.concatenate([self.model.values0[self.engine], np.zeros(len(sd) - len(own))])
        self.mean, self.precision = own_mean, np.diag(sd**-2.0)
        if prior is not None:
            n = self.shared
            self.mean[:n], self.precision[:n, :n] = prior
        self.gaits = tuple(dict.fromkeys(one.gait for one in many))
        self.gait = np.array([self.gaits.index(one.gait) for one in many])
        self.white: list[White] = []
        self.by_nuisance = np.zeros((0, 0))
        self._constant = [self._shift_columns(one) for one in many]
        self._shifts = self._with_rest(None)

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (k, n) of the model at nuisances z (k, p + q), effects off."""
        found = np.repeat(self.model.values0[None], len(z), axis=0)
        found[:, self.engine] = z[:, : len(self.engine)]
        return found

    def prepare(self, z: np.ndarray, *, floor_m: float | None = None, noise: float | None = None) -> None:
        """Derivatives at nuisances z (p + q,), and with them what makes residuals white: exact ones by the starts, and
        secants by the nuisances, over a share of their prior: contacts make a derivative say little of a step."""
        seen = self.replayer.derivatives(self.many, self.values(z[None])[0])
        assert seen.by_offset is not None  # noqa: S101 - it was asked for
        self._by_offset = [seen.by_offset[seen.window == k] for k in range(len(self.many))]
        self._ends = [seen.p_WE[seen.window == k] for k in range(len(self.many))]
        self._shifts = self._with_rest(self._by_offset)
        p = len(self.engine)
        by = SECANT * np.array([self.model.numbers[k].sd for k in self.engine])
        low, high = np.maximum(z[:p] - by, self.lower[:p]), np.minimum(z[:p] + by, self.upper[:p])
        points = np.repeat(z[None], 2 * p, axis=0)
        points[np.arange(p), np.arange(p)], points[p + np.arange(p), np.arange(p)] = low, high
        raw = self.raw(self.values(points), points)
        width = (high - low)[:, None, None]
        self._by_engine = [np.nan_to_num((one[p:] - one[:p]) / width, posinf=0.0, neginf=0.0) for one in raw]
        self.whiten(floor_m=floor_m, noise=noise)

    def whiten(self, *, floor_m: float | None = None, noise: float | None = None) -> None:
        """Covariances anew, with another floor [m] or factor on the noise, at the same derivatives."""
        self.floor_m = self.floor_m if floor_m is None else floor_m
        self.noise = self.noise if noise is None else noise
        sd = START.sd(self.replayer.structure)[self.replayer.moved]
        self.white, columns, begin = [], [], 0
        for k, one in enumerate(self.many):
            roots, size = self._roots(one)
            by_offset = self._channels(k, self._by_offset[k])
            white = White(
                roots, np.zeros((0, 0)), np.zeros(0), slice(begin, begin + roots.shape[0] * roots.shape[1]), size
            )
            offsets = _rooted(white, by_offset) * sd[:, None]
            U, s, _ = np.linalg.svd(offsets.T, full_matrices=False)
            logdet = float(np.log1p(s**2).sum() - 2.0 * np.log(np.diagonal(roots, axis1=1, axis2=2)).sum())
            white = White(roots, U, 1.0 - 1.0 / np.sqrt(1.0 + s**2), white.rows, size, logdet)
            self.white.append(white)
            own = np.concatenate([self._by_engine[k], self._shifts[k]], axis=0)
            columns.append(_whitened(white, own))
            begin = white.rows.stop
        self.by_nuisance = np.concatenate(columns, axis=1).T  # (M, p + q)

    @property
    def sizes(self) -> np.ndarray:
        """Data of every stretch, (stretch,)."""
        return np.array([white.size for white in self.white], dtype=float)

    def residuals(self, values: np.ndarray, z: np.ndarray) -> np.ndarray:
        """White residuals (k, M), simulated minus observed, at values (k, n) of the model, with the shifts of z."""
        return self.whitened(self.raw(values, z))

    def raw(self, values: np.ndarray, z: np.ndarray) -> list[np.ndarray]:
        """Residuals as they are, of every stretch (k, channel, F) [m]: caps by axis, then sensors."""
        seen = self.replayer.seen(self.many, values)
        return [self._residual(k, seen[k], z) for k in range(len(self.many))]

    def whitened(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        """Residuals of `raw`, white, (k, M)."""
        return np.concatenate([_whitened(w, r) for w, r in zip(self.white, raw, strict=True)], axis=1)

    def look(self, values: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """White residuals as `residuals` has them, and those of the caps at the last frame of every stretch as they
        are, (k, stretch, cap, 3) [m]."""
        raw = self.raw(values, z)
        return self.whitened(raw), self._last(raw)

    def ends(self, values: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Simulated minus observed caps at the last frame of every stretch, (k, stretch, cap, 3) [m]."""
        return self._last(self.raw(values, z))

    def log_density(self, raw: Sequence[np.ndarray]) -> float:
        """Of one hypothesis's residuals under the covariance as it is, nothing left out [nats].

        Normal, since Student's t over a stretch does not care how large all of it is; without the worst stretches,
        since one tip-over must not set the floor of all.
        """
        squares = self.squares(self.whitened(raw))[0]
        excess = squares / self.sizes
        kept = excess <= np.quantile(excess, TRIMMED)
        logdet = np.array([white.logdet for white in self.white])
        return float(-0.5 * np.sum((squares + logdet)[kept]))

    def _last(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        caps = self.many[0].caps.shape[1]
        return np.stack([r[:, : 3 * caps, -1].reshape(len(r), caps, 3) for r in raw], axis=1)

    def squares(self, residual: np.ndarray) -> np.ndarray:
        """Sums of squares of every stretch (k, stretch) of white residuals (k, M)."""
        return np.stack([np.sum(residual[:, white.rows] ** 2, axis=1) for white in self.white], axis=1)

    def _residual(self, k: int, seen: Seen, z: np.ndarray) -> np.ndarray:
        """(hypothesis, channel, F): caps, then sensors; 0 where there is no reading."""
        one = self.many[k]
        caps = (seen.caps - one.caps[None]).reshape(len(seen.caps), len(one.t), -1).transpose(0, 2, 1)
        parts = [caps]
        if self.sensors:
            if one.length is None:
                parts.append(np.zeros((len(caps), len(self.sensors), len(one.t))))
            else:
                gap = seen.length - one.length[None]
                parts.append(np.where(np.isfinite(one.length)[None], gap, 0.0).transpose(0, 2, 1))
        found = np.concatenate(parts, axis=1)
        shift = z[:, len(self.engine) :]
        return found + np.einsum("kq,qcf->kcf", shift, self._shifts[k])

    def _channels(self, k: int, d: np.ndarray) -> np.ndarray:
        """Derivatives of the caps (F, cap, 3, D) as those of all channels, (D, channel, F)."""
        one = self.many[k]
        caps = d.reshape(len(one.t), -1, d.shape[-1]).transpose(2, 1, 0)
        if not self.sensors:
            return caps
        ends = np.array([self.replayer.cable_caps[cable] for cable in self.sensors])
        way = self._ends[k][:, ends[:, 0]] - self._ends[k][:, ends[:, 1]]
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        length = np.einsum("fsi,fsid->dsf", way, d[:, ends[:, 0]] - d[:, ends[:, 1]])
        if one.length is None:
            length = np.zeros_like(length)
        return np.concatenate([caps, length], axis=1)

    def _with_rest(self, by_offset: Sequence[np.ndarray] | None) -> list[np.ndarray]:
        """What is added to the residuals per unit of all nuisances that are simple shifts, (q, channel, F) of every
        stretch. What a run's rest lengths at its begin are off by is still so in its later stretches; a reading that is
        late shows a length that was, as fast as the simulated one changes."""
        found = []
        winches = len(self.model.robot.actuated)
        for k, one in enumerate(self.many):
            constant = self._constant[k]
            rest = np.zeros((len(self.runs) * winches, *constant.shape[1:]))
            if by_offset is not None:
                begin = self.runs.index(one.run) * winches
                rest[begin : begin + winches] = self._channels(k, by_offset[k][..., -winches:])
            late = np.zeros((1 if self.sensors else 0, *constant.shape[1:]))
            if by_offset is not None and self.sensors and len(one.t) > 1:
                late[0, -len(self.sensors) :] = -np.gradient(self._lengths(k), one.t, axis=0).T
            found.append(np.concatenate([constant, late, rest]))
        return found

    def _lengths(self, k: int) -> np.ndarray:
        """Simulated lengths of the sensed cables of a stretch where derivatives were taken, (F, sensor) [m]."""
        ends = np.array([self.replayer.cable_caps[cable] for cable in self.sensors])
        return np.asarray(np.linalg.norm(self._ends[k][:, ends[:, 0]] - self._ends[k][:, ends[:, 1]], axis=-1))

    def _shift_columns(self, one: Stretch) -> np.ndarray:
        """What camera and sensor biases add, per unit, (q, channel, F)."""
        F, caps = len(one.t), one.caps.shape[1]
        found = np.zeros((3 + len(self.sensors), 3 * caps + len(self.sensors), F))
        for c in range(caps):
            x, y = one.caps[:, c, 0], one.caps[:, c, 1]
            found[0, 3 * c + 2], found[1, 3 * c + 2], found[2, 3 * c + 2] = 1.0, y, -x
        for s in range(len(self.sensors)):
            found[3 + s, 3 * caps + s] = 1.0
        return found

    def _roots(self, one: Stretch) -> tuple[np.ndarray, int]:
        """Inverse Cholesky factors of every channel, and how many numbers are data."""
        since = one.t - one.window.start
        share = since / since[-1]
        walk = np.minimum(share[:, None], share[None, :]) * (self.floor_m**2 / 3.0)
        caps = one.noise.reshape(len(since), -1).T * self.noise
        sd, size = caps, caps.size
        if self.sensors:
            absent = np.full((len(self.sensors), len(since)), ABSENT)
            if one.length is not None and one.length_sd is not None:
                there = np.isfinite(one.length).T
                absent = np.where(there, one.length_sd.T, ABSENT)
                size += int(there.sum())
            sd = np.concatenate([caps, absent])
        covariance = walk[None] + np.eye(len(since))[None] * sd[:, :, None] ** 2
        return np.linalg.inv(np.linalg.cholesky(covariance)), size


def _rooted(white: White, residual: np.ndarray) -> np.ndarray:
    """(k, channel, F) -> (k, channel F), white but for the start."""
    found: np.ndarray = np.einsum("cfg,kcg->kcf", white.roots, residual, optimize=True)
    return found.reshape(len(residual), -1)


def _whitened(white: White, residual: np.ndarray) -> np.ndarray:
    """(k, channel, F) -> (k, channel F), white."""
    found = _rooted(white, residual)
    return found - ((found @ white.U) * white.shrink) @ white.U.T
