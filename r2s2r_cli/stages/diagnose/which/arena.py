"""Where hypotheses meet the data: residuals of all streams together, white under noise, floor and unknown starts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.mixture import density
from r2s2r_cli.stages.diagnose.which.replay import Replayer, Seen
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.diagnose.which.white import White, whitened, whites

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
LOST_M = 0.25
"""A cap that is simulated so far from where it was is lost, and farther off is not worse."""
FLOOR_SD = 1e-3
"""[m] How well the height of the floor is known, run by run: each is levelled by its own lowest caps."""


class Arena:
    """Stretches, the engine, and the covariance at one nominal point. Unknowns z of the nuisances (p + q,): those of
    the engine, then camera and sensor biases, which are simple shifts of what is seen."""

    def __init__(
        self, replayer: Replayer, many: Sequence[Stretch], *, floor_m: float, noise: float = 1.0,
        prior: tuple[np.ndarray, np.ndarray] | None = None, whole: Sequence[Stretch] = (),
    ) -> None:  # fmt: skip
        """many: what is fitted; whole: the target intervals, whose ends are the key frames; empty: those of `many`.
        floor_m: of the simulator alone, cap RMSE after FLOOR_S. noise: factor on the stated noise. prior:
        mean and precision matrix of the nuisances, of healthy runs; None: nominal."""
        self.replayer, self.model, self.many = replayer, replayer.model, tuple(many)
        self.whole = tuple(whole) or self.many
        self.floor_m, self.noise = floor_m, noise
        self.sensors = next((one.sensors for one in many if one.length is not None), ())
        self.engine = list(self.model.nuisances)
        self.runs = tuple(dict.fromkeys(one.run for one in many))
        shared = (
            *(self.model.names[k] for k in self.engine), *(name for name, _, _ in CAMERA),
            *(f"sensor_bias_{k}" for k in self.sensors), *(("sensor_lag",) if self.sensors else ()),
        )  # fmt: skip
        self.shared = len(shared)
        """How many nuisances are the same in every run; the others are the heights of the runs' floors."""
        self.names = (*shared, *(f"floor_{run}" for run in self.runs))
        own = [self.model.numbers[k] for k in self.engine]
        sd = np.array([n.sd for n in own] + [sd for _, _, sd in CAMERA] + [SENSOR_SD] * len(self.sensors)
                      + [SENSOR_LAG_SD] * bool(self.sensors) + [FLOOR_SD] * len(self.runs))  # fmt: skip
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
        self.white: tuple[White, ...] = ()
        self.by_nuisance = np.zeros((0, 0))
        self._length: list[np.ndarray] = []
        self._shifts = [self._shift_columns(k) for k in range(len(self.many))]

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (k, n) of the model at nuisances z (k, p + q), effects off."""
        found = np.repeat(self.model.values0[None], len(z), axis=0)
        found[:, self.engine] = z[:, : len(self.engine)]
        return found

    def prepare(self, z: np.ndarray, *, floor_m: float | None = None, noise: float | None = None) -> None:
        """Derivatives at nuisances z (p + q,), and with them what makes residuals white: differences over
        the sd of the starts, secants over a share of the nuisances' prior: contacts make a derivative say little of a
        step."""
        sd = [one.start_sd for one in self.many if one.start_sd is not None]
        assert len(sd) == len(self.many)  # noqa: S101 - whole intervals are never prepared, only pieces
        seen = self.replayer.around(self.many, self.values(z[None])[0], sd)
        self._by_offset = [self._responses(one) for one in seen]
        self._length = [one.length[0] for one in seen]
        self._shifts = [self._shift_columns(k) for k in range(len(self.many))]
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
        self.white = whites(
            self.many, self._by_offset, sensors=len(self.sensors), floor_m=self.floor_m, noise=self.noise
        )  # fmt: skip
        own = [np.concatenate([e, s], axis=0) for e, s in zip(self._by_engine, self._shifts, strict=True)]
        self.by_nuisance = whitened(self.white, own).T  # (M, p + q)

    @property
    def sizes(self) -> np.ndarray:
        """Data of every stretch, (stretch,)."""
        return np.array([white.size for white in self.white], dtype=float)

    def residuals(self, values: np.ndarray, z: np.ndarray, only: Sequence[int] | None = None) -> np.ndarray:
        """Residuals (k, M), simulated minus observed, white under each kind of error, at values (k, n) of the model,
        with the shifts of z. only: places of the stretches that are simulated, whole intervals; the others' are 0."""
        raw = self.raw(values, z, only)
        if only is None:
            return whitened(self.white, raw)
        found = np.zeros((len(values), self.by_nuisance.shape[0]))
        for k, one in zip(only, raw, strict=True):
            for kind in self.white[k].kinds:
                found[:, kind.rows] = kind.white(one)
        return found

    def raw(self, values: np.ndarray, z: np.ndarray, only: Sequence[int] | None = None) -> list[np.ndarray]:
        """Residuals as they are, of every stretch (k, channel, F) [m]: caps by axis, then sensors; at most LOST_M.
        only: places of those that are asked for."""
        only = range(len(self.many)) if only is None else only
        seen = self.replayer.seen([self.many[k] for k in only], values)
        found = [self._residual(k, one, z) for k, one in zip(only, seen, strict=True)]
        return [np.clip(np.nan_to_num(one, nan=LOST_M), -LOST_M, LOST_M) for one in found]

    def keys(self, values: np.ndarray, z: np.ndarray, only: Sequence[int] | None = None) -> np.ndarray:
        """Simulated minus observed caps [m] at the ends of whole target intervals, the key frames, (k, interval, cap,
        3). only: places of the intervals in `whole`."""
        whole = self.whole if only is None else [self.whole[k] for k in only]
        seen = self.replayer.seen(whole, values)
        caps = np.stack([s.caps[:, -1] - one.caps[-1] for s, one in zip(seen, whole, strict=True)], axis=1)
        columns = np.array([self._camera_columns(one.caps[-1]) for one in whole])
        camera = z[:, len(self.engine) : len(self.engine) + len(CAMERA)]
        return np.asarray(caps + np.einsum("kq,sqci->ksci", camera, columns))

    @property
    def logdets(self) -> np.ndarray:
        """Log determinants of every stretch under each kind of error, (stretch, kind)."""
        return np.array([white.logdet for white in self.white])

    def log_densities(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        """Of one hypothesis's residuals under the covariance as it is, (stretch,) [nats]."""
        return -density(self.squares(whitened(self.white, raw))[0], self.logdets)

    def squares(self, residual: np.ndarray) -> np.ndarray:
        """Sums of squares (k, stretch, kind) of white residuals (k, M)."""
        found = [[np.sum(residual[:, kind.rows] ** 2, axis=1) for kind in white.kinds] for white in self.white]
        return np.array(found).transpose(2, 0, 1)

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

    def _responses(self, seen: Seen) -> np.ndarray:
        """What moving a start by one sd changes in all channels, (offset, channel, F), from what was seen without and
        with each offset."""
        caps = seen.caps.reshape(*seen.caps.shape[:2], -1)
        both = np.concatenate([caps, seen.length], axis=-1).transpose(0, 2, 1)
        by = both[1:] - both[:1]
        return np.clip(np.nan_to_num(by, nan=LOST_M), -LOST_M, LOST_M)

    def _shift_columns(self, k: int) -> np.ndarray:
        """What camera and sensors add per unit, (q, channel, F). A reading that is late shows a length that was, as
        fast as the simulated one changes."""
        one = self.many[k]
        F, caps = len(one.t), one.caps.shape[1]
        found = np.zeros((len(self.names) - len(self.engine), 3 * caps + len(self.sensors), F))
        found[: len(CAMERA), : 3 * caps] = self._camera_columns(one.caps).reshape(len(CAMERA), F, -1).transpose(0, 2, 1)
        for s in range(len(self.sensors)):
            found[len(CAMERA) + s, 3 * caps + s] = 1.0
        found[self.shared - len(self.engine) + self.runs.index(one.run), 2 : 3 * caps : 3] = 1.0
        if self.sensors and self._length and F > 1:
            found[self.shared - len(self.engine) - 1, 3 * caps :] = -np.gradient(self._length[k], one.t, axis=0).T
        return found

    @staticmethod
    def _camera_columns(caps: np.ndarray) -> np.ndarray:
        """What height and tilts of CAMERA add to caps (..., cap, 3), per unit, (3, ..., cap, 3)."""
        found = np.zeros((len(CAMERA), *caps.shape))
        found[0, ..., 2], found[1, ..., 2], found[2, ..., 2] = 1.0, caps[..., 1], -caps[..., 0]
        return found
