"""From sightings to a first guess: frames where images are missing, weights, states to start from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.motion.body import ACROSS, Body
from r2s2r_cli.stages.estimate.motion.data import MotionSettings, Sighted
from r2s2r_cli.stages.estimate.motion.evidence import Evidence

HOLE = 1.6
"""A gap longer than this many median gaps gets frames of its own, so that sensors are heard in it."""
MOST_KNOTS = 300
"""Frames put into one hole."""
MIN_FRAMES = 5
SIGHTING_BEND = 4.0
"""At first, sightings far off still pull: where a cap hits the floor, motion has to give way before they do."""
TWIN_SD, TWIN_SHARE = 6.0, 0.05
"""Two caps of a rod are not both its caps where their distance is off by so many standard deviations and by this share
of the length, which robot.toml may have wrong."""


@dataclass(frozen=True)
class Prepared:
    """Sightings on the frames and the knots in the holes between them."""

    t: np.ndarray
    seen: np.ndarray
    """(frame, cap, 3), 0 where there is none."""
    cov: np.ndarray
    sighted: np.ndarray
    """(frame, cap)."""
    given: np.ndarray
    """Rows of the run's own frames, (given,)."""
    gap_of: np.ndarray
    """Gap of the run's frames that each gap is part of, (frame - 1,)."""


def prepare(sighted: Sighted, body: Body) -> Prepared:
    """Check the sightings and fill holes. Raises InputError where there is nothing to smooth."""
    t = np.asarray(sighted.t, dtype=float)
    p = np.asarray(sighted.p_WE, dtype=float)
    if p.shape != (len(t), body.caps, 3) or sighted.cov.shape != (*p.shape, 3):
        raise InputError(
            "the sightings do not fit the robot", where="sightings", expected=f"shape ({len(t)}, {body.caps}, 3)",
            received=str(p.shape), hint="estimate with the robot.toml of the robot that was recorded",
        )  # fmt: skip
    if len(t) < MIN_FRAMES or not np.all(np.isfinite(t)) or np.any(np.diff(t) <= 0):
        raise InputError(
            "the frames allow no estimate", where="camera/t", expected=f"at least {MIN_FRAMES} frames, rising stamps",
            received=f"{len(t)} frames, {int(np.sum(~(np.diff(t) > 0)))} stamps not after the one before",
            hint="r2s2r inspect 10-record.h5   # shows the stamps",
        )  # fmt: skip
    seen = np.all(np.isfinite(p), axis=2) & np.all(np.isfinite(sighted.cov), axis=(2, 3))
    seen &= ~_twins(p, sighted.cov, seen, body)
    if np.any(never := ~np.any(seen, axis=0)):
        raise InputError(
            f"end cap {int(np.argmax(never))} is never sighted", where="sightings", expected="every cap at least once",
            received="none in any frame", hint="r2s2r doctor camera   # shows which colours are found",
        )  # fmt: skip
    usual = float(np.median(np.diff(t)))
    times, gap_of = [t[:1]], []
    for k, gap in enumerate(np.diff(t)):
        parts = min(max(round(gap / usual), 1), MOST_KNOTS) if gap > HOLE * usual else 1
        times.append(np.linspace(t[k], t[k + 1], parts + 1)[1:])
        gap_of += [k] * parts
    all_t = np.concatenate(times)
    given = np.concatenate([[0], np.flatnonzero(np.diff(np.array([*gap_of, len(t) - 1]))) + 1])
    full = np.zeros((len(all_t), body.caps, 3))
    cov = np.broadcast_to(np.eye(3), (*full.shape, 3)).copy()
    marks = np.zeros(full.shape[:2], dtype=bool)
    full[given], cov[given], marks[given] = np.where(seen[..., None], p, 0.0), sighted.cov, seen
    cov[~marks] = np.eye(3)
    return Prepared(all_t, full, cov, marks, given, np.array(gap_of, dtype=int))


def _twins(p: np.ndarray, cov: np.ndarray, seen: np.ndarray, body: Body) -> np.ndarray:
    """Sightings of rods whose caps are not a rod length apart: one of the two is something else; (frame, cap)."""
    bad = np.zeros_like(seen)
    for (a, b), length in zip(body.rod, body.rod_length, strict=True):
        both = seen[:, a] & seen[:, b]
        bar = np.where(both[:, None], p[:, b] - p[:, a], 1.0)
        now = np.linalg.norm(bar, axis=1)
        u = bar / now[:, None]
        shared = np.where(both[:, None, None], cov[:, a] + cov[:, b], 0.0)
        sd = np.sqrt(np.einsum("ki,kij,kj->k", u, shared, u))
        off = both & (np.abs(now - length) > TWIN_SD * sd + TWIN_SHARE * length)
        bad[off, a] = bad[off, b] = True
    return bad


def first_states(prepared: Prepared, body: Body) -> np.ndarray:
    """States with caps on straight lines between their sightings, (frame, dim)."""
    t = prepared.t
    x = np.zeros((len(t), body.dim))
    for cap in range(body.caps):
        rows = np.flatnonzero(prepared.sighted[:, cap])
        for axis in range(3):
            values = prepared.seen[rows, cap, axis]
            line = np.interp(t, t[rows], values)
            x[:, body.p(cap)[axis]] = line
            smooth = np.convolve(np.pad(line, 2, mode="edge"), np.full(5, 0.2), mode="valid")
            x[:, body.v(cap)[axis]] = np.gradient(smooth, t)
    return x


def first_evidence(prepared: Prepared, body: Body, settings: MotionSettings, switches: np.ndarray | None) -> Evidence:
    """Sightings alone, with the noise that they state; motion as the settings have it."""
    gaps, sensors = len(prepared.t) - 1, len(body.sensor)
    kick = np.zeros(gaps)
    if switches is not None and len(switches):
        inside = np.isin(prepared.gap_of, switches)
        parts = np.bincount(prepared.gap_of, minlength=int(prepared.gap_of.max()) + 1)
        kick[inside] = settings.kick_m_per_s**2 / parts[prepared.gap_of[inside]]
    none = np.zeros((len(prepared.t), sensors))
    return Evidence(
        t=prepared.t, seen=prepared.seen, information=information(prepared, np.ones(2)),
        across=np.zeros((len(prepared.t), body.caps, 3, ACROSS)),
        density=np.full((gaps, body.caps), settings.acceleration), kick=kick,
        shown=none, later=none, samples=none, sensor_weight=none,
        sensor_drift=np.broadcast_to(settings.sensor_walk_m**2 * np.diff(prepared.t)[:, None], (gaps, sensors)),
        sighting_bend=SIGHTING_BEND, sensor_bend=None, touching=np.zeros((len(prepared.t), body.caps)),
    )  # fmt: skip


def principal(cov: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variances (..., 3), ascending, and unit vectors as rows (..., 3, 3) of covariances; last: the line of sight."""
    values, vectors = np.linalg.eigh(cov)
    return np.maximum(values, 1e-12), np.swapaxes(vectors, -1, -2)


def information(prepared: Prepared, factor: np.ndarray) -> np.ndarray:
    """Inverse covariances with variances times `factor` (across, along), shape (2,); 0 where nothing was sighted."""
    values, axes = principal(prepared.cov)
    weight = prepared.sighted[..., None] / (values * np.array([factor[0], factor[0], factor[1]]))
    return np.einsum("kci,kcia,kcib->kcab", weight, axes, axes)
