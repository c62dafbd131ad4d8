"""The pass over the images: predict every cap, look for it there, go on; what stays is small (sightings).

It begins at the first frame in which all caps are told apart, goes on to the last one, and then from the beginning back
to the first. Where caps turn up at another place than they were taken to be, it goes back from there as far as that
tells anything new. Pictures are decoded once, those that are gone through again twice.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Readings, Sighted
from r2s2r_cli.stages.estimate.motion.forward import Forward
from r2s2r_cli.stages.estimate.motion.labels import label
from r2s2r_cli.stages.estimate.sweep_rows import Look, Rows
from r2s2r_cli.stages.estimate.vision.frames import FrameSource, ImageFrame
from r2s2r_cli.stages.estimate.vision.sight import Sighter
from r2s2r_cli.stages.estimate.vision.sightings import Candidate
from r2s2r_cli.stages.estimate.vision.world import from_world, to_world
from schemas.robot import Robot

MOST = 0.6
"""Of the caps in view, below which a robot is on its way out of the picture."""
AWAY_M = 0.04
"""A cap that is found farther from where it was taken to be was not followed: the frames before may show it as well."""
FRESH_S = 0.06
"""Readings of the sensors up to this old count as those of a frame: three samples of a board."""


@dataclass(frozen=True)
class Swept:
    """What the pass found, one row a frame.

    visible: share of each cap that is seen, (frame, cap). code: as in vision/sightings.py, uint8 (frame, cap).
    shift_px: depth against colour, (frame, 2), NaN where unknown. known: caps from this frame and those before it alone
    [m], (frame, cap, 3), known_sd [m]; of frames before `first` from those after. first: frame in which the caps were
    told apart. searched: frames in which they had to be found again, (frame,) bool.
    """

    sighted: Sighted
    visible: np.ndarray
    code: np.ndarray
    shift_px: np.ndarray
    known: np.ndarray
    known_sd: np.ndarray
    first: int
    searched: np.ndarray

    @property
    def in_view(self) -> int:
        """Frames up to the last one in which most caps were seen: after it the robot did not come back as a whole."""
        seen = np.isfinite(self.sighted.p_WE[..., 0]).mean(axis=1) > MOST
        return int(np.flatnonzero(seen)[-1]) + 1 if seen.any() else 0

    def renamed(self, names: np.ndarray) -> Swept:
        """The same with cap c where cap names[c] was taken to be."""
        sighted = Sighted(self.sighted.t, self.sighted.p_WE[:, names], self.sighted.cov[:, names])
        caps = {name: getattr(self, name)[:, names] for name in ("visible", "code", "known", "known_sd")}
        return replace(self, sighted=sighted, **caps)

    def until(self, frames: int) -> Swept:
        """The first frames alone."""
        sighted = Sighted(self.sighted.t[:frames], self.sighted.p_WE[:frames], self.sighted.cov[:frames])
        rows = {name: getattr(self, name)[:frames] for name in (
            "visible", "code", "shift_px", "known", "known_sd", "searched")}  # fmt: skip
        return Swept(sighted=sighted, first=self.first, **rows)


class Sweep:
    """One pass over one run. advance: called with 1 after every frame."""

    def __init__(
        self, run: str, source: FrameSource, sighter: Sighter, X_WC: np.ndarray, readings: Readings | None,
        robot: Robot, settings: MotionSettings, advance: Callable[[int], None],
    ) -> None:  # fmt: skip
        n, caps = len(source), robot.n_caps
        self._run, self._source, self._sighter, self._X_WC, self._robot = run, source, sighter, X_WC, robot
        self._settings, self._advance = settings, advance
        self._lengths = _at_frames(source.t, readings)
        self._stamps, self._samples = _in_order(readings)
        before = np.searchsorted(self._stamps, source.t, side="right")
        # What was heard long before the first frame is of no use to it.
        self._since = np.concatenate([[np.searchsorted(self._stamps, source.t[0] - FRESH_S)], before])
        self._cable = np.zeros(0, dtype=int) if readings is None else readings.cable
        self._rows = Rows(n, caps)
        self._known, self._known_sd = np.zeros((n, caps, 3)), np.zeros((n, caps, 3))
        self._searched = np.zeros(n, dtype=bool)
        self._seen = np.zeros(len(robot.rods), dtype=int)

    def run(self) -> Swept:
        """Both ways. Raises InputError where no frame tells the caps apart."""
        forward, first, start = None, 0, np.zeros((self._robot.n_caps, 3))
        for frame in self._source:
            if forward is None:
                found = self._begin(frame)
                if found is not None:
                    forward, first, start = self._started(frame.t, found), frame.index, found
            if forward is not None and self._look(forward, frame):
                self._again(forward, frame.index, first)
            self._advance(1)
        if forward is None:
            raise self._not_found()
        if first:
            self._backwards(first, start)
        rows = self._rows
        return Swept(Sighted(self._source.t, rows.p_WE, rows.cov), rows.visible, rows.code, rows.shift_px,
                     self._known, self._known_sd, first, self._searched)  # fmt: skip

    def _backwards(self, first: int, start: np.ndarray) -> None:
        back = self._started(float(self._source.t[first]), start)
        for frame in _between(self._source, first, 0):
            if self._look(back, frame):
                self._again(back, frame.index, first)

    def _again(self, forward: Forward, k: int, begun: int) -> None:
        """From frame k, in which caps were found again, back to frame `begun`: until nothing new is seen."""
        back = copy.deepcopy(forward)
        back.start(float(self._source.t[k]), forward.p_WE, forward.cov_p)
        for frame in _between(self._source, k, begun):
            back.predict(frame.t)
            look = self._see(back, frame)
            if back.doubt.whole or self._rows.agree(frame.index, look):
                break
            if self._rows.better(frame.index, look):
                self._rows.keep(frame.index, look, look.used)

    def _started(self, t: float, p_WE: np.ndarray) -> Forward:
        forward = Forward(self._robot, self._settings, self._cable)
        forward.start(t, p_WE)
        return forward

    def _begin(self, frame: ImageFrame) -> np.ndarray | None:
        """Caps of a frame that shows them all and leaves no doubt which is which, (cap, 3) in W."""
        candidates = self._sighter.detect(frame)
        blobs = self._in_world(candidates)
        self._seen += [len(of_rod) >= 2 for of_rod in blobs]
        if any(len(of_rod) < 2 for of_rod in blobs):
            return None
        found = label(blobs, self._robot, self._of_cables(frame.index))
        return found.p_WE if found is not None and found.sure else None

    def _look(self, forward: Forward, frame: ImageFrame) -> bool:
        """Go on to a frame; whether caps were found in it far from where they were taken to be."""
        k = frame.index
        for row in range(self._since[k], self._since[k + 1]):
            forward.sense(float(self._stamps[row]), self._samples[row])
        before, _ = forward.predict(frame.t)
        lost = forward.lost
        found = (lost or forward.doubt.missing) and self._find(forward, frame)
        away = found and bool(np.max(np.linalg.norm(forward.p_WE - before, axis=1)) > AWAY_M)
        look = self._see(forward, frame)
        # Who is lost may look at the wrong cap: what contradicts the prediction is not even kept.
        self._rows.keep(k, look, look.used | ~np.array(lost and not found))
        p_WE, cov = forward.predict(frame.t)
        self._known[k], self._known_sd[k] = p_WE, np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
        return away

    def _see(self, forward: Forward, frame: ImageFrame) -> Look:
        """Look for every cap where the filter, which is at the time of the frame, expects it, and tell it."""
        seen = self._sighter.sight(frame, *from_world(self._X_WC, forward.p_WE, forward.cov_p))
        p, cov = to_world(self._X_WC, seen.p_C, seen.cov_C)
        used = forward.update(frame.t, p, cov)
        return Look(p, cov, used, seen.visible, seen.code, seen.shift_px)

    def _find(self, forward: Forward, frame: ImageFrame) -> bool:
        if frame.color is None:
            return False
        candidates = self._sighter.detect(frame)
        covs = [c.cov_C for c in candidates]
        R = self._X_WC[:3, :3]
        cov = R @ np.mean(covs, axis=0) @ R.T if covs else np.eye(3) * 1e-4
        found = forward.reacquire(frame.t, self._in_world(candidates), cov)
        self._searched[frame.index] = found
        return found

    def _in_world(self, candidates: Iterable[Candidate]) -> list[np.ndarray]:
        found: list[list[np.ndarray]] = [[] for _ in self._robot.rods]
        for one in candidates:
            found[one.rod].append(to_world(self._X_WC, one.p_C)[0])
        return [np.array(of_rod).reshape(-1, 3) for of_rod in found]

    def _of_cables(self, k: int) -> np.ndarray | None:
        if not len(self._cable):
            return None
        length = np.full(len(self._robot.cables), np.nan)
        length[self._cable] = self._lengths[k]
        return length

    def _not_found(self) -> InputError:
        n = len(self._source)
        seen = ", ".join(f"{rod.name} in {count}" for rod, count in zip(self._robot.rods, self._seen, strict=True))
        return InputError(
            f"in no frame of run {self._run} are all end caps seen and told apart", where=f"runs/{self._run}/camera",
            expected="one frame at least with both caps of every rod, as far apart as the cable sensors say",
            received=f"of {n} frames both caps of a colour: {seen}",
            hint="r2s2r doctor camera   # shows what the colours of robot.toml find",
        )  # fmt: skip


def _between(source: FrameSource, start: int, stop: int) -> Iterable[ImageFrame]:
    """The frames from beside `start` to `stop`, in either direction."""
    step = 1 if stop > start else -1
    for index in range(start + step, stop + step, step):
        yield source.frame(index)


def _in_order(readings: Readings | None) -> tuple[np.ndarray, np.ndarray]:
    """Stamps [s] and lengths [m] in the order of time."""
    if readings is None:
        return np.zeros(0), np.zeros((0, 0))
    order = np.argsort(readings.t, kind="stable")
    return readings.t[order], readings.length[order]


def _at_frames(t: np.ndarray, readings: Readings | None) -> np.ndarray:
    """Median of each sensor's readings in the FRESH_S before each frame [m], (frame, sensor); NaN: none."""
    if readings is None:
        return np.zeros((len(t), 0))
    stamps, length = _in_order(readings)
    first, last = np.searchsorted(stamps, t - FRESH_S, side="right"), np.searchsorted(stamps, t, side="right")
    found = np.full((len(t), length.shape[1]), np.nan)
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        rows = length[a:b]
        some = np.any(np.isfinite(rows), axis=0)
        if some.any():
            found[k, some] = np.nanmedian(rows[:, some], axis=0)
    return found
