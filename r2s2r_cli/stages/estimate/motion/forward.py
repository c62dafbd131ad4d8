"""The causal filter: where the caps are in the next image, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.estimate.motion.body import Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings
from r2s2r_cli.stages.estimate.motion.doubt import Doubt
from r2s2r_cli.stages.estimate.motion.heard import Heard
from r2s2r_cli.stages.estimate.motion.labels import Labelling, label
from r2s2r_cli.stages.estimate.motion.measurements import (
    Stack,
    floor_rows,
    rod_rows,
    sensor_rows,
    sighting_rows,
    standing_rows,
)
from r2s2r_cli.stages.estimate.motion.states import ITERATIONS, States
from schemas.robot import Robot

GATE = 30.0
"""Squared distance over variance beyond which a sighting is refused (3 parts: 1e-6)."""
BURST = 10.0
"""[m^2/s^3] Density of the acceleration where sightings leave the prediction: 0.6 m/s within 1/30 s."""
TWIN_M = 0.04
"""[m] Two caps of a rod whose distance is farther off than this are not both caps of it."""
BENT_M, FAR_OFF_M, FAR_OFF = 0.005, 0.04, 2
"""Rods farther off than the first [m], or so many sensors farther off than the second [m], contradict the states."""
UNKNOWN_DELAY_S = 0.06
"""Clock offset and lag of the sensors, not known yet: a changing length is that much out of date."""
START_SD_M = 0.005


class Forward:
    """Extended Kalman filter of all caps, cable sensors' offsets included. Times may also run backwards.

    Order of calls: `start`, then for every image `sense` with the newest lengths (any number of times), `predict`,
    `update`. Positions in W [m].
    """

    def __init__(self, robot: Robot, settings: MotionSettings | None = None, cable: np.ndarray | None = None) -> None:
        """cable: of each sensor, default those of robot.toml."""
        self.robot = robot
        self.settings = settings or MotionSettings()
        self.body = Body.of(robot, cable)
        self._cable = np.array([s.cable for s in robot.sensors], dtype=int) if cable is None else np.asarray(cable)
        self.states = States(self.body, self.settings)
        self.doubt = Doubt(self.body.caps)
        self._heard = Heard(len(self.body.sensor))
        self._agreed = np.zeros(len(self.body.sensor), dtype=bool)

    @property
    def t(self) -> float:
        """Time of the states [s]; NaN before `start`."""
        return self.states.t

    @property
    def p_WE(self) -> np.ndarray:
        """Caps now [m], (cap, 3)."""
        return self.states.p_WE

    @property
    def v_WE(self) -> np.ndarray:
        """Their velocities [m/s], (cap, 3)."""
        return self.states.v_WE

    @property
    def cov_p(self) -> np.ndarray:
        """Their covariances [m^2], (cap, 3, 3)."""
        return self.states.cov_p

    def start(self, t: float, p_WE: np.ndarray, cov: np.ndarray | None = None) -> None:
        """Begin (again) at labelled caps at rest or in slow motion, (cap, 3); cov (cap, 3, 3) [m^2], default 5 mm an
        axis. Time may go either way from there. Offsets of sensors that are known already are kept."""
        body = self.body
        spread = np.tile(START_SD_M**2 * np.eye(3), (body.caps, 1, 1)) if cov is None else cov
        self.states.place(t, p_WE, spread)
        self._believe()
        self.states.correct(lambda stack, x: rod_rows(stack, x, body, self.settings))

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
        used = seen & (self.states.squares(p_WE, cov) <= GATE)
        if np.any(seen & ~used) and self.states.elapsed != 0:
            # Motors that switch and caps that touch down change velocities at once: likelier than a wrong sighting.
            calm = self.states.cov
            self.states.shake(BURST)
            sudden = seen & (self.states.squares(p_WE, cov) <= GATE)
            if np.sum(sudden) > np.sum(used):
                used = sudden
            else:
                self.states.cov = calm
        self.states.elapsed = 0.0
        self.doubt.look(seen, used)

        def rows(stack: Stack, x: np.ndarray) -> None:
            sighting_rows(stack, x, body, np.where(used[:, None], p_WE, np.nan), cov)
            rod_rows(stack, x, body, self.settings)
            floor_rows(stack, x, body, self.settings, self.states.height_sd)
            if not np.any(used):
                standing_rows(stack, x, body)

        self.states.correct(rows)
        self.doubt.judge(consistent=self._consistent(), used=used)
        return np.asarray(used)

    def _without_twins(self, p_WE: np.ndarray) -> np.ndarray:
        """Sightings without those of rods whose caps are not a rod length apart: the farther one from where it was
        expected has found something else, often the other cap."""
        out = p_WE.copy()
        for (a, b), length in zip(self.body.rod, self.body.rod_length, strict=True):
            if abs(np.linalg.norm(p_WE[b] - p_WE[a]) - length) > TWIN_M:  # False where one is NaN
                off = [np.linalg.norm(p_WE[cap] - self.states.x[self.body.p(int(cap))]) for cap in (a, b)]
                out[b if off[1] > off[0] else a] = np.nan
        return out

    def sense(self, t: float, length: np.ndarray) -> None:
        """Sensor lengths at time t [m], shape (sensor,), NaN where there is none. They are taken in, as means, with the
        next `predict`, or `update`."""
        if not np.isnan(self.t) and np.any(np.isfinite(length)):
            self._heard.take(t, length)

    def _listen(self) -> None:
        """Take in what `sense` gathered."""
        means = self._heard.means(self.t, self.settings.sensor_noise_sd_m)
        if means is None:
            return

        def rows(stack: Stack, x: np.ndarray) -> None:
            sensor_rows(stack, x, self.body, *means, UNKNOWN_DELAY_S)
            rod_rows(stack, x, self.body, self.settings)

        self.states.correct(rows)

    @property
    def lost(self) -> bool:
        """Some cap is less certain than `MotionSettings.lost_sd_m`, or the robot as a whole is in doubt (`Doubt`): look
        everywhere (`reacquire`)."""
        if np.isnan(self.t):
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
        length[self._cable] = self._heard.shown - self.states.x[self.body.bias]
        kept = self.doubt.in_sight
        self.doubt.searched()
        found = label(candidates, self.robot, length, predicted=(self.p_WE, self.cov_p), partly=True, kept=kept)
        if found is None or not (found.sure or self._told(candidates, length, found)):
            return False
        if not (self.lost or self._elsewhere(found.p_WE)):
            return False
        body = self.body
        self.states.place(self.t, _carried(self.p_WE, found.p_WE))
        covs = np.broadcast_to(cov, (body.caps, 3, 3))
        now = np.zeros(len(body.sensor))
        noise = np.full(len(now), self.settings.sensor_noise_sd_m)

        def rows(stack: Stack, x: np.ndarray) -> None:
            sighting_rows(stack, x, body, found.p_WE, covs)
            sensor_rows(stack, x, body, self._heard.shown, now, noise, UNKNOWN_DELAY_S)
            rod_rows(stack, x, body, self.settings)
            floor_rows(stack, x, body, self.settings, self.states.height_sd)

        self.states.correct(rows, iterations=4 * ITERATIONS)
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
        p = self.body.positions(self.states.x)
        rods = np.linalg.norm(p[self.body.rod[:, 1]] - p[self.body.rod[:, 0]], axis=-1) - self.body.rod_length
        seen = np.linalg.norm(p[self.body.sensor[:, 1]] - p[self.body.sensor[:, 0]], axis=-1)
        off = np.abs(self._heard.shown - self.states.x[self.body.bias] - seen)
        in_sight = np.all(self.doubt.in_sight[self.body.sensor], axis=1)
        self._agreed = in_sight & (self._agreed | (off <= FAR_OFF_M))
        return bool(np.all(np.abs(rods) < BENT_M) and np.sum((off > FAR_OFF_M) & ~self._agreed) < FAR_OFF)

    def _go(self, t: float) -> None:
        dt = self.states.go(t, self.doubt.in_sight)
        if dt:
            self.doubt.wait(abs(dt))
            self._heard.forget(self.t)


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
