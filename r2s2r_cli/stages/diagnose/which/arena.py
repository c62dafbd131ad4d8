"""Where hypotheses meet the data: residuals of all streams together, white under noise, floor and unknown starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.bent import bent
from r2s2r_cli.stages.diagnose.which.likely import better_of, likely_start
from r2s2r_cli.stages.diagnose.which.looks import Seen
from r2s2r_cli.stages.diagnose.which.mixture import FACTORS, density
from r2s2r_cli.stages.diagnose.which.replay import Replayer
from r2s2r_cli.stages.diagnose.which.shifts import CAMERA, Shifts, camera_columns
from r2s2r_cli.stages.diagnose.which.starting import Starting, clipped
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.diagnose.which.white import Alone, White, whitened, whitened_of, whites

SECANT = 0.3
"""Of a nuisance's prior sd, to both sides: over what its derivative is taken."""


class Arena:
    """Stretches, the engine, and the covariance at one nominal point. Unknowns z of the nuisances (p + q,): those of
    the engine, then camera and sensor biases, which are simple shifts of what is seen."""

    def __init__(
        self, replayer: Replayer, many: Sequence[Stretch], *, floor_m: float, noise: float = 1.0,
        lasts: float = 0.0, prior: tuple[np.ndarray, np.ndarray] | None = None, whole: Sequence[Stretch] = (),
    ) -> None:  # fmt: skip
        """many: what is fitted; whole: the target intervals, whose ends are the key frames; empty: those of `many`.
        floor_m: of the simulator alone, cap RMSE after FLOOR_S. noise: factor on the stated noise; lasts [s]: how long
        errors of the caps last. prior: mean and precision matrix of the nuisances, of healthy runs; None: nominal."""
        self.replayer, self.model, self.many = replayer, replayer.model, tuple(many)
        self.whole = tuple(whole) or self.many
        self.floor_m, self.noise, self.lasts = floor_m, noise, lasts
        self.sensors = next((one.sensors for one in many if one.length is not None), ())
        self.engine = list(self.model.nuisances)
        self.runs = tuple(dict.fromkeys(one.run for one in many))
        self.shifts = Shifts(self.sensors, self.runs)
        engine = tuple(self.model.names[k] for k in self.engine)
        self.names = (*engine, *self.shifts.names)
        self.shared = len(engine) + len(self.shifts.shared)
        """How many nuisances are the same in every run; the others are the heights of the runs' floors."""
        own = [self.model.numbers[k] for k in self.engine]
        sd = np.array([n.sd for n in own] + self.shifts.sd)
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
        self.starting = Starting(replayer.structure, self.many)
        self.away = np.zeros((len(self.many), self.starting.offsets))
        """Where hypotheses begin that do not say, in sd from the starts, (stretch, offset)."""
        self._shifts = [self.shifts.columns(one) for one in self.many]

    def values(self, z: np.ndarray) -> np.ndarray:
        """Values (k, n) of the model at nuisances z (k, p + q), effects off."""
        found = np.repeat(self.model.values0[None], len(z), axis=0)
        found[:, self.engine] = z[:, : len(self.engine)]
        return found

    def prepare(self, z: np.ndarray) -> None:
        """Derivatives at nuisances z (p + q,), and with them what makes residuals white: differences over
        the sd of the starts, secants over a share of the nuisances' prior: contacts make a derivative say little of a
        step."""
        each = self.starting.tried()
        seen = self.replayer.around(self.many, np.repeat(self.values(z[None]), len(each[0]), axis=0), each)
        self.starting.learn(seen)
        self._by_offset = self.starting.by_start
        p = len(self.engine)
        by = SECANT * np.array([self.model.numbers[k].sd for k in self.engine])
        low, high = np.maximum(z[:p] - by, self.lower[:p]), np.minimum(z[:p] + by, self.upper[:p])
        points = np.repeat(z[None], 2 * p, axis=0)
        points[np.arange(p), np.arange(p)], points[p + np.arange(p), np.arange(p)] = low, high
        raw = self.raw(self.values(points), points)
        width = (high - low)[:, None]
        self.by_engine = [np.nan_to_num((one[p:] - one[:p]) / width, posinf=0.0, neginf=0.0) for one in raw]
        self.whiten()
        self._by_offset = bent(self, z, seen)
        self.whiten()

    def move_starts(self, away: np.ndarray) -> None:
        """Lets all stretches begin so far (stretch, offset) [sd] away from where they did. What is known of the starts
        stays what it was. Derivatives are to be taken anew (`prepare`)."""
        self.many = self.starting.moved(self.many, away)
        self.away = np.zeros_like(away)

    def whiten(
        self, *, floor_m: float | None = None, noise: float | None = None, lasts: float | None = None,
        trial: bool = False,
    ) -> None:  # fmt: skip
        """Covariances anew, with another floor [m], factor on the noise or time that it lasts [s], at the same
        derivatives. trial: only to see how likely residuals are; derivatives by the nuisances are not made white."""
        self.floor_m = self.floor_m if floor_m is None else floor_m
        self.noise = self.noise if noise is None else noise
        self.lasts = self.lasts if lasts is None else lasts
        self.white = whites(
            self.many, self._by_offset, self.starting.ways, sensors=len(self.sensors), floor_m=self.floor_m,
            noise=self.noise, lasts=self.lasts,
        )  # fmt: skip
        if not trial:
            own = [np.concatenate([e, _flat(s, e.shape[1])]) for e, s in zip(self.by_engine, self._shifts, strict=True)]
            self.by_nuisance = whitened(self.white, own).T  # (M, p + q)

    @property
    def sizes(self) -> np.ndarray:
        """Data of every stretch, (stretch,)."""
        return np.array([white.size for white in self.white], dtype=float)

    def residuals(
        self, values: np.ndarray, z: np.ndarray, only: Sequence[int] | None = None, away: np.ndarray | None = None
    ) -> np.ndarray:  # fmt: skip
        """Residuals (k, M), simulated minus observed, white under each kind of error, at values (k, n) of the model,
        with the shifts of z. only: places of the stretches that are simulated, whole intervals; the others' are 0.
        away: as `raw`."""
        if only is None:
            return whitened(self.white, self.raw(values, z, None, away))
        raw = self._with_before(values, z, only, away)
        found = np.zeros((len(values), self.by_nuisance.shape[0]))
        for k in only:
            for kind, one in zip(self.white[k].kinds, whitened_of(self.white, raw, k), strict=True):
                found[:, kind.rows] = one
        return found

    def _with_before(
        self, values: np.ndarray, z: np.ndarray, only: Sequence[int], away: np.ndarray | None
    ) -> dict[int, np.ndarray]:  # fmt: skip
        """Raw residuals of the stretches `only` and of those that end where they begin."""
        wide = sorted({*only, *(j for k in only if (j := self.starting.before[k]) is not None)})
        return dict(zip(wide, self.raw(values, z, wide, away), strict=True))

    def raw(
        self, values: np.ndarray, z: np.ndarray, only: Sequence[int] | None = None, away: np.ndarray | None = None
    ) -> list[np.ndarray]:  # fmt: skip
        """Residuals as they are, of every stretch (k, n): those of the channels [m], caps by axis, then sensors, frame
        by frame, at most LOST_M; then where the stretch before ends (`Starting.ahead`), 0 where there is none. only:
        places of those that are asked for. away (k, stretch, offset): where each hypothesis begins, in sd from the
        starts; None: `self.away` for all. Residuals are those of what is known of the starts, along straight lines from
        where they begin."""
        only = range(len(self.many)) if only is None else only
        if away is None and self.away.any():
            away = np.repeat(self.away[None], len(values), axis=0)
        far = None if away is None else [away[:, k] * self.many[k].start_sd for k in only]
        seen = self.replayer.seen([self.many[k] for k in only], values, far)
        there = dict(zip(only, seen, strict=True))
        before, ways = self.starting.before, self.starting.ways
        linked = {k: j for k in only if (j := before[k]) is not None and j in there and ways[k] is not None}
        ends = dict(zip(linked, self.starting.apart([(there[k], there[j]) for k, j in linked.items()]), strict=True))
        found = []
        for k, one in there.items():
            own = self.residual(k, one, z)
            if away is not None:
                own = own - np.einsum("ko,ocf->kcf", away[:, k], self.starting.by_start[k])
            ahead = np.zeros((len(values), self.starting.offsets))
            if k in ends:
                by = (None, None) if away is None else (away[:, k], away[:, linked[k]])
                ahead = self.starting.led(k, ends[k], *by)
            found.append(np.concatenate([clipped(own).reshape(len(values), -1), ahead], axis=1))
        return found

    def settled(self, values: np.ndarray, z: np.ndarray, only: Sequence[int], away: np.ndarray) -> np.ndarray:
        """As `residuals`, of every stretch and row the better of two: from `away`, and from where it then most likely
        began."""
        wanted = away.copy()
        white = []
        for at in (away, wanted):
            raw = self._with_before(values, z, only, at)
            alone: Alone = {}
            white.append([whitened_of(self.white, raw, k, alone) for k in only])
            if at is away:
                for k in only:
                    wanted[:, k] = self._likely_start(k, raw, alone)
        found = np.zeros((len(values), self.by_nuisance.shape[0]))
        for k, first, second in zip(only, *white, strict=True):
            own = self.white[k]
            for kind, one in zip(own.kinds, better_of(own, first, second), strict=True):
                found[:, kind.rows] = one
        return found

    def likely_starts(self, raw: Sequence[np.ndarray]) -> np.ndarray:
        """Where stretches most likely begin that leave raw residuals (k, n) each: in sd from the starts, (k, stretch,
        offset)."""
        alone: Alone = {}
        return np.stack([self._likely_start(k, raw, alone) for k in range(len(self.many))], axis=1)

    def _likely_start(self, k: int, raw: Sequence[np.ndarray] | Mapping[int, np.ndarray], alone: Alone) -> np.ndarray:
        return likely_start(self.white, raw, k, self.starting.offsets, alone) - self.starting.settled[k]

    def keys(self, values: np.ndarray, z: np.ndarray, only: Sequence[int] | None = None) -> np.ndarray:
        """Simulated minus observed caps [m] at the ends of whole target intervals, the key frames, (k, interval, cap,
        3). only: places of the intervals in `whole`."""
        whole = self.whole if only is None else [self.whole[k] for k in only]
        seen = self.replayer.seen(whole, values)
        caps = np.stack([s.caps[:, -1] - one.caps[-1] for s, one in zip(seen, whole, strict=True)], axis=1)
        columns = np.array([camera_columns(one.caps[-1]) for one in whole])
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
        # The kinds of a stretch have as many rows each, and those of the first kind of all stretches come first.
        square = (residual**2).reshape(len(residual), len(FACTORS), -1)
        found = [square[:, :, white.rows].sum(axis=2).T for white in self.white]
        return np.array(found).transpose(2, 0, 1)

    def residual(self, k: int, seen: Seen, z: np.ndarray) -> np.ndarray:
        """What is seen of a stretch less what was, (hypothesis, channel, F) [m]: caps, then sensors, 0 where there is
        no reading."""
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
        return found + np.einsum("kq,qcf->kcf", shift, self._shifts[k]) - self.starting.by_settled[k]


def _flat(shifts: np.ndarray, size: int) -> np.ndarray:
    """Shifts (q, channel, F) as raw residuals (q, size): they move no end."""
    found = np.zeros((len(shifts), size))
    found[:, : shifts[0].size] = shifts.reshape(len(shifts), -1)
    return found
