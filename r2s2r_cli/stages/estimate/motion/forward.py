"""The causal filter: where the caps are in the next image, and how sure that is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.doubt import Doubt
from r2s2r_cli.stages.estimate.motion.equations import START_SD, start_sd
from r2s2r_cli.stages.estimate.motion.labels import Labelling, label
from r2s2r_cli.stages.estimate.motion.measurements import (
    Stack,
    floor_rows,
    rod_rows,
    sensor_rows,
    sighting_rows,
    standing_rows,
)
from schemas.robot import Robot

GATE = 30.0
"""Squared distance over variance beyond which a sighting is refused (3 parts: 1e-6)."""
BURST = 10.0
"""[m^2/s^3] Density of the acceleration where sightings leave the prediction: 0.6 m/s within 1/30 s."""
STOPS_S = 0.25
"""[s] A cap out of sight goes on with a velocity that fades with this time constant."""
TWIN_M = 0.04
"""[m] Two caps of a rod whose distance is farther off than this are not both caps of it."""
BENT_M, FAR_OFF_M, FAR_OFF = 0.005, 0.04, 2
"""Rods farther off than the first [m], or so many sensors farther off than the second [m], contradict the states."""
OLD_S = 0.2
"""[s] A length that was shown longer ago says nothing any more."""
UNKNOWN_DELAY_S = 0.06
"""Clock offset and lag of the sensors, not known yet: a changing length is that much out of date."""
START_SD_M = 0.005
AGAIN_SD = (0.15, 0.3)
"""Of position [m] and velocity [m/s] of every cap when it is looked for again."""
ITERATIONS = 3
CAPPED_MPS = 3.0
"""No cap of such a robot is faster; keeps a wrong track from running away."""


class Forward:
    """Extended Kalman filter of all caps, cable sensors' offsets included. Times may also run backwards.

    Order of calls: `start`, then for every image `sense` with the newest lengths (any number of times), `predict`,
    `update`. Positions in W [m]. Updates are iterated (Bell and Cathey, IEEE TAC 38 (1993) 294), because rods turn far
    while they are hidden.
    """

    def __init__(self, robot: Robot, settings: MotionSettings | None = None, cable: np.ndarray | None = None) -> None:
        """cable: of each sensor, default those of robot.toml."""
        self.robot = robot
        self.settings = settings or MotionSettings()
        self.body = Body.of(robot, cable)
        self._cable = np.array([s.cable for s in robot.sensors], dtype=int) if cable is None else np.asarray(cable)
        self._x = np.zeros(self.body.dim)
        self._cov = np.eye(self.body.dim)
        self._t = float("nan")
        self._way = 1.0
        self.doubt = Doubt(self.body.caps)
        self._shown, self._heard = np.full((2, len(self.body.sensor)), np.nan)
        self._agreed = np.zeros(len(self.body.sensor), dtype=bool)
        self._count, self._sum, self._late = (np.zeros(len(self.body.sensor)) for _ in range(3))
        self._elapsed = 0.0

    @property
    def t(self) -> float:
        """Time of the states [s]; NaN before `start`."""
        return self._t

    @property
    def p_WE(self) -> np.ndarray:
        """Caps now [m], (cap, 3)."""
        return self.body.positions(self._x).copy()

    @property
    def v_WE(self) -> np.ndarray:
        """Their velocities [m/s], (cap, 3)."""
        return self.body.velocities(self._x).copy()

    @property
    def cov_p(self) -> np.ndarray:
        """Their covariances [m^2], (cap, 3, 3)."""
        return np.stack([self._cov[np.ix_(s := self.body.p(c), s)] for c in range(self.body.caps)])

    def start(self, t: float, p_WE: np.ndarray, cov: np.ndarray | None = None, *, backwards: bool = False) -> None:
        """Begin (again) at labelled caps at rest or in slow motion, (cap, 3); cov (cap, 3, 3) [m^2], default 5 mm an
        axis. backwards: time will run down. Offsets of sensors that are known already are kept."""
        body = self.body
        first = bool(np.isnan(self._t))
        self._t, self._way = float(t), -1.0 if backwards else 1.0
        keep = slice(body.moving, body.dim)
        slow = self._cov[keep, keep].copy()
        sd = start_sd(body, self.settings)
        sd[3 * body.caps : body.moving] = AGAIN_SD[1]
        self._x[: body.moving] = 0.0
        self._x[: 3 * body.caps] = np.asarray(p_WE, dtype=float).ravel()
        self._cov = np.diag(sd**2)
        if not first:
            self._cov[keep, keep] = slow
        for cap in range(body.caps):
            states = body.p(cap)
            self._cov[np.ix_(states, states)] = START_SD_M**2 * np.eye(3) if cov is None else cov[cap]
        self._believe()
        self._correct(lambda stack, x: rod_rows(stack, x, body, self.settings))

    def predict(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Go to time t [s]; caps (cap, 3) and their covariance (cap, 3, 3) there."""
        self._go(t)
        self._listen()
        return self.p_WE, self.cov_p

    def update(self, t: float, p_WE: np.ndarray, cov: np.ndarray) -> np.ndarray:
        """Take in sightings at time t: (cap, 3), NaN where there is none, and (cap, 3, 3). Which were used: (cap,)."""
        self._go(t)
        body = self.body
        p_WE = self._without_twins(p_WE)
        seen = np.all(np.isfinite(p_WE), axis=1)
        used = seen & (self._squares(p_WE, cov) <= GATE)
        if np.any(seen & ~used) and self._elapsed != 0:
            # Motors that switch and caps that touch down change velocities at once: likelier than a wrong sighting.
            calm = self._cov
            self._cov = self._spread_by(self._cov, self._elapsed, BURST)
            sudden = seen & (self._squares(p_WE, cov) <= GATE)
            if np.sum(sudden) > np.sum(used):
                used = sudden
            else:
                self._cov = calm
        self._elapsed = 0.0
        self.doubt.look(seen, used)

        def rows(stack: Stack, x: np.ndarray) -> None:
            sighting_rows(stack, x, body, np.where(used[:, None], p_WE, np.nan), cov)
            rod_rows(stack, x, body, self.settings)
            floor_rows(stack, x, body, self.settings, self._spread())
            if not np.any(used):
                standing_rows(stack, x, body)

        self._correct(rows)
        self.doubt.judge(consistent=self._consistent(), used=used)
        return np.asarray(used)

    def _without_twins(self, p_WE: np.ndarray) -> np.ndarray:
        """Sightings without those of rods whose caps are not a rod length apart: the farther one from where it was
        expected has found something else, often the other cap."""
        out = p_WE.copy()
        for (a, b), length in zip(self.body.rod, self.body.rod_length, strict=True):
            if abs(np.linalg.norm(p_WE[b] - p_WE[a]) - length) > TWIN_M:  # False where one is NaN
                off = [np.linalg.norm(p_WE[cap] - self._x[self.body.p(int(cap))]) for cap in (a, b)]
                out[b if off[1] > off[0] else a] = np.nan
        return out

    def _squares(self, p_WE: np.ndarray, cov: np.ndarray) -> np.ndarray:
        """Squared distance of each sighting from the prediction over its variance, (cap,); NaN: not sighted."""
        out = np.full(self.body.caps, np.nan)
        for cap in np.flatnonzero(np.all(np.isfinite(p_WE), axis=1)):
            states = self.body.p(int(cap))
            off = p_WE[cap] - self._x[states]
            out[cap] = off @ np.linalg.solve(self._cov[np.ix_(states, states)] + cov[cap], off)
        return out

    def sense(self, t: float, length: np.ndarray) -> None:
        """Sensor lengths at time t [m], shape (sensor,), NaN where there is none. They are taken in, as means, with the
        next `predict`, or `update`."""
        good = np.isfinite(length)
        if np.isnan(self._t) or not np.any(good):
            return
        self._shown, self._heard = np.where(good, length, self._shown), np.where(good, t, self._heard)
        self._count += good
        self._sum += np.where(good, length, 0.0)
        self._late += np.where(good, t, 0.0)

    def _listen(self) -> None:
        """Take in what `sense` gathered."""
        heard = self._count > 0
        if not np.any(heard):
            return
        some = np.maximum(self._count, 1)
        length = np.where(heard, self._sum / some, np.nan)
        later = np.where(heard, self._late / some - self._t, 0.0)
        noise = self.settings.sensor_noise_sd_m / np.sqrt(some)
        self._count, self._sum, self._late = (np.zeros(len(some)) for _ in range(3))

        def rows(stack: Stack, x: np.ndarray) -> None:
            sensor_rows(stack, x, self.body, length, later, noise, UNKNOWN_DELAY_S)
            rod_rows(stack, x, self.body, self.settings)

        self._correct(rows)

    @property
    def lost(self) -> bool:
        """Some cap is less certain than `MotionSettings.lost_sd_m`, or the robot as a whole is in doubt (`Doubt`): look
        everywhere (`reacquire`)."""
        if np.isnan(self._t):
            return True
        worst = np.sqrt(np.linalg.eigvalsh(self.cov_p)[:, -1])
        return bool(np.any(worst > self.settings.lost_sd_m) or self.doubt.whole)

    def reacquire(self, t: float, candidates: Sequence[np.ndarray], cov: np.ndarray) -> bool:
        """Find the caps among blobs of each rod's colour, (blob, 3) in W with covariance (3, 3), by the labelling that
        fits prediction and sensors best; whether one did, the filter then goes on from there.

        A rod of which one cap or none is seen stays with the others by cables and rods.
        """
        self._go(t)
        length = np.full(len(self.body.cable), np.nan)
        length[self._cable] = self._shown - self._x[self.body.bias]
        kept = self.doubt.in_sight
        self.doubt.searched()
        found = label(candidates, self.robot, length, predicted=(self.p_WE, self.cov_p), partly=True, kept=kept)
        if found is None or not (found.sure or self._told(candidates, length, found)):
            return False
        if not (self.lost or self._elsewhere(found.p_WE)):
            return False
        body = self.body
        keep = slice(body.moving, body.dim)
        slow = self._cov[keep, keep].copy()
        sd = np.repeat(AGAIN_SD, 3 * body.caps)
        self._cov[:] = 0.0
        self._cov[keep, keep] = slow
        self._cov[np.arange(body.moving), np.arange(body.moving)] = sd**2
        self._x[3 * body.caps : body.moving] = 0.0
        self._x[: 3 * body.caps] = _carried(self.p_WE, found.p_WE).ravel()
        covs = np.broadcast_to(cov, (body.caps, 3, 3))
        now = np.zeros(len(body.sensor))
        noise = np.full(len(now), self.settings.sensor_noise_sd_m)

        def rows(stack: Stack, x: np.ndarray) -> None:
            sighting_rows(stack, x, body, found.p_WE, covs)
            sensor_rows(stack, x, body, self._shown, now, noise, UNKNOWN_DELAY_S)
            rod_rows(stack, x, body, self.settings)
            floor_rows(stack, x, body, self.settings, self._spread())

        self._correct(rows, iterations=4 * ITERATIONS)
        self._believe()
        return True

    def _told(self, candidates: Sequence[np.ndarray], length: np.ndarray, found: Labelling) -> bool:
        """Whether the sensors alone, as at the start, say without doubt the same of all caps. A cap that went astray
        on its own is far from its prediction, and might as well be taken for missing."""
        if np.any(found.pick < 0) or not np.any(np.isfinite(length)):
            return False
        alone = label(candidates, self.robot, length)
        return alone is not None and alone.sure and np.array_equal(alone.pick, found.pick)

    def _elsewhere(self, p_WE: np.ndarray) -> bool:
        """Whether caps that were found (cap, 3), NaN where not, are clearly not where they are expected."""
        off = np.linalg.norm(p_WE - self.p_WE, axis=1)
        return bool(np.any(off > TWIN_M))  # False where one is NaN

    def _believe(self) -> None:
        self.doubt.believe()
        self._agreed[:] = False

    def _consistent(self) -> bool:
        """Whether rods and sensors are as long as they should be. A sensor that agreed with its caps, and leaves them
        while both are in sight, contradicts itself: it has jumped."""
        p = self.body.positions(self._x)
        rods = np.linalg.norm(p[self.body.rod[:, 1]] - p[self.body.rod[:, 0]], axis=-1) - self.body.rod_length
        seen = np.linalg.norm(p[self.body.sensor[:, 1]] - p[self.body.sensor[:, 0]], axis=-1)
        off = np.abs(self._shown - self._x[self.body.bias] - seen)
        in_sight = np.all(self.doubt.in_sight[self.body.sensor], axis=1)
        self._agreed = in_sight & (self._agreed | (off <= FAR_OFF_M))
        return bool(np.all(np.abs(rods) < BENT_M) and np.sum((off > FAR_OFF_M) & ~self._agreed) < FAR_OFF)

    def _spread(self) -> np.ndarray:
        """Standard deviation of each cap's height, (cap,)."""
        return np.asarray(np.sqrt(self._cov.diagonal()[2 : 3 * self.body.caps : 3]))

    def _go(self, t: float) -> None:
        dt = float(t) - self._t
        if dt == 0.0 or not np.isfinite(dt):
            return
        body, size = self.body, abs(dt)
        half = 3 * body.caps
        rows = np.arange(half)
        f = np.eye(body.dim)
        f[rows, half + rows] = dt
        # Robots of cables stop soon: a velocity that was seen long ago says nothing.
        f[half + rows, half + rows] = np.repeat(np.where(self.doubt.in_sight, 1.0, np.exp(-size / STOPS_S)), 3)
        self.doubt.wait(size)
        cov = self._spread_by(f @ self._cov @ f.T, dt, self.settings.acceleration)
        self._elapsed += dt
        bias = np.arange(body.bias.start, body.bias.stop)
        cov[bias, bias] += self.settings.sensor_walk_m**2 * size
        self._x = f @ self._x
        self._x[half : body.moving] = np.clip(self._x[half : body.moving], -CAPPED_MPS, CAPPED_MPS)
        place = np.minimum(cov[rows, rows], START_SD[0] ** 2) / cov[rows, rows]
        if np.any(place < 1.0):  # lost for minutes: wider than any room helps nobody
            shrink = np.ones(body.dim)
            shrink[rows] = np.sqrt(place)
            cov = cov * shrink[:, None] * shrink
        self._cov = cov
        self._t = float(t)
        self._shown[np.abs(self._t - self._heard) > OLD_S] = np.nan

    def _spread_by(self, cov: np.ndarray, dt: float, density: float) -> np.ndarray:
        """Cov after white acceleration of that density over dt [s], either way in time."""
        rows, half, out = np.arange(3 * self.body.caps), 3 * self.body.caps, cov.copy()
        size = abs(dt)
        out[rows, rows] += density * size**3 / 3
        out[rows, half + rows] += density * dt * size / 2
        out[half + rows, rows] += density * dt * size / 2
        out[half + rows, half + rows] += density * size
        return out

    def _correct(self, rows: Callable[[Stack, np.ndarray], None], *, iterations: int = ITERATIONS) -> None:
        prior, x = self._x, self._x
        for _ in range(iterations):
            stack = Stack(self.body.dim)
            rows(stack, x)
            residual, slope, noise = stack.arrays()
            if not len(residual):
                return
            shared = self._cov @ slope.T
            inner = slope @ shared + noise
            gain = np.linalg.solve(inner, shared.T).T
            # residual: measured minus predicted at x; the prior stays that of the start.
            step = prior + gain @ (residual - slope @ (prior - x)) - x
            x = x + step
            if np.max(np.abs(step[: 3 * self.body.caps])) < 1e-4:
                break
        keep = np.eye(self.body.dim) - gain @ slope
        cov = keep @ self._cov @ keep.T + gain @ noise @ gain.T
        self._x, self._cov = x, 0.5 * (cov + cov.T)


def _carried(before: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Caps that were found (cap, 3), and the others, NaN, where they go with these from `before`: as a rigid body by
    least squares (Kabsch, Acta Cryst. A32 (1976) 922) where three or more were found, else by the mean shift."""
    seen = np.all(np.isfinite(found), axis=1)
    a, b = before[seen], found[seen]
    turn = np.eye(3)
    if len(a) >= 3:
        u, _, vt = np.linalg.svd((a - a.mean(axis=0)).T @ (b - b.mean(axis=0)))
        turn = vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    moved = (before - a.mean(axis=0)) @ turn.T + b.mean(axis=0)
    return np.where(seen[:, None], found, moved)
