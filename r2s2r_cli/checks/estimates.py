"""What only an estimate has: covariances, confidence, the ground it found."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, REPORT, Found, beyond, check, number, worst
from r2s2r_cli.checks.subjects import Run

SYMMETRY = 1e-9
"""Relative to the largest variance: rounding of a product of matrices."""
NEGATIVE = 1e-9
"""Eigenvalues this far below 0, relative to the largest, are rounding."""
UNIT_TOLERANCE = 1e-6
ALONG_ROD_RAD_PER_S = 1e-6
UNUSED_SHARE = 0.2
"""A cap that was not used in every fifth frame was hardly seen: its track is largely the smoother's guess."""
LOST_SHARE = 0.05
"""Lost for one moment is what a tumble does; for longer, the run is a guess there."""
SIGHTINGS_LEAST = 0.2
"""Least ratio of what sightings scatter to what they state (variances)."""
_LOST = 8
"""Bit of `frames/mode`."""
_USED = (0, 3)
"""Codes of `quality` for observations that were used."""
_KINDS = ("estimate",)
_DRAWN = f"{AGAIN}   # draws the pictures beside it"
_NOISE = "r2s2r status   # once the sidecar of the log states noise_sd_m, if you know it: says what to make again"
"""Of a log nothing is seen that a picture could show."""


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="covariances are symmetric and have no negative variance in any direction",
    why="a fit weighted with them would divide by a negative number or by nothing",
    fix=REPORT,
)
def covariances_are_valid(run: Run) -> Iterator[Found]:
    """Matrices that are no covariance."""
    cov = run.array("frames", "cov_p_WE")
    if cov is None or not cov.size:
        return
    scale = np.maximum(np.abs(cov).max(axis=(-1, -2)), np.finfo(float).tiny)
    skew = np.abs(cov - np.swapaxes(cov, -1, -2)).max(axis=(-1, -2)) / scale
    if (skew > SYMMETRY).any():
        yield Found(run.at("frames", "cov_p_WE"), "a covariance is not symmetric", "equal to its transpose",
                    "off by " + worst(skew, skew * (skew > SYMMETRY), ("frame", "cap")))  # fmt: skip
        return
    smallest = np.linalg.eigvalsh(cov / scale[..., None, None])[..., 0]
    low = beyond(smallest, -NEGATIVE, np.inf)
    if (low > 0).any():
        yield Found(run.at("frames", "cov_p_WE"), "a covariance has a negative variance",
                    "0 or more in every direction",
                    worst(smallest * scale, low, ("frame", "cap"), unit="m^2"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="standard deviations are not negative, and the assumed noise is above 0",
    why="a noise of 0 gives its observation infinite weight",
    fix=REPORT,
)
def deviations_are_positive(run: Run) -> Iterator[Found]:
    """Deviations below 0, noise of 0."""
    for stream, name, axes in (
        ("frames", "sd_v_WE", ("frame", "cap", "axis")),
        ("frames", "length_sd", ("frame", "cable")),
        ("tracks", "noise_sd", ("cap", "axis")),
        ("tracks", "speed_change", ("cap",)),
    ):
        sd = run.array(stream, name)
        if sd is None:
            continue
        strict = name == "noise_sd"
        bad = sd <= 0 if strict else sd < 0
        if bad.any():
            yield Found(run.at(stream, name), "a standard deviation is too small",
                        "above 0" if strict else "0 or more", worst(sd, bad.astype(float), axes))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="probabilities of contact lie between 0 and 1",
    why="they weigh the contacts in every fit that follows",
    fix=REPORT,
)
def probabilities_in_range(run: Run) -> Iterator[Found]:
    """Probabilities that are none."""
    p = run.array("frames", "contact_probability")
    if p is not None and (beyond(p, 0.0, 1.0) > 0).any():
        yield Found(run.at("frames", "contact_probability"), "a probability is out of range", "0 .. 1",
                    worst(p, beyond(p, 0.0, 1.0), ("frame", "cap")))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="the normal of the ground has length 1",
    why="every height above the ground is a product with it",
    fix=REPORT,
)
def ground_normal_is_unit(run: Run) -> Iterator[Found]:
    """A normal that scales heights."""
    normal = run.array("ground", "normal")
    if normal is not None and abs(float(np.linalg.norm(normal)) - 1) > UNIT_TOLERANCE:
        yield Found(run.at("ground", "normal"), "the normal of the ground is not of length 1", "1",
                    number(float(np.linalg.norm(normal))))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="no rod turns about its own axis, unless the roll was observed",
    why="two equal caps do not show the roll: a number there is noise that looks like a measurement",
    fix=REPORT,
)
def roll_is_not_invented(run: Run) -> Iterator[Found]:
    """Angular velocity along a rod whose roll nobody saw."""
    w, p = run.array("frames", "w_WR"), run.array("frames", "p_WE")
    observed = run.streams["frames"].attributes.get("roll_observable") if "frames" in run.streams else True
    if w is None or p is None or observed or p.shape[1] != 2 * w.shape[1]:
        return
    axis = p[:, 1::2] - p[:, 0::2]
    length = np.linalg.norm(axis, axis=-1)
    along = np.abs((w * axis).sum(axis=-1)) / np.where(length > 0, length, np.nan)
    fast = beyond(along, 0.0, ALONG_ROD_RAD_PER_S)
    if (fast > 0).any():
        yield Found(run.at("frames", "w_WR"), "a rod turns about its own axis although nobody saw its roll", "0 rad/s",
                    worst(along, fast, ("frame", "rod"), unit="rad/s"))  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="each cap was observed and used in at least four of five frames",
    why="between observations the track is what the smoother believes, with the uncertainty that it states",
    fix=f"{_DRAWN}: look there at the named cap, its colour, its light, what hides it",
)
def caps_well_observed(run: Run) -> Iterator[Found]:
    """Caps that were mostly guessed."""
    quality = run.array("frames", "quality")
    if quality is None or not len(quality):
        return
    unused = (~np.isin(quality, _USED)).mean(axis=0)
    for cap in np.flatnonzero(unused > UNUSED_SHARE).tolist():
        yield Found(run.at("frames", "quality"), f"cap {cap} was seldom observed",
                    f"used in at least {100 * (1 - UNUSED_SHARE):g} % of the frames",
                    f"{100 * (1 - unused[cap]):.3g} %")  # fmt: skip


@check(
    "advice",
    Run,
    kinds=_KINDS,
    what="what the smoother expects and what it then sees differ by as much as it believes: ratio 0.5 to 2",
    why="below, its uncertainties are too large; above, they are too small, and every interval built on them",
    fix=f"{_DRAWN}: look there whether the caps are where they are believed to be",
)
def noise_as_assumed(run: Run) -> Iterator[Found]:
    """Innovations far larger or smaller than their variance."""
    ratio = run.array("tracks", "innovation_variance")
    # Sightings of camera images state the errors of a place as well, which scatter from frame to frame does not show.
    least = SIGHTINGS_LEAST if "sightings" in run.streams else 0.5
    if ratio is not None:
        off = beyond(ratio, least, 2.0)
        if (off > 0).any():
            yield Found(run.at("tracks", "innovation_variance"), "the noise is not as large as was assumed",
                        f"{least:g} .. 2", worst(ratio, off, ("cap",)),
                        "" if "sightings" in run.streams else _NOISE)  # fmt: skip


@check(
    "warning",
    Run,
    kinds=_KINDS,
    what="the robot is lost in at most one frame of twenty",
    why="where some cap is less certain than 30 mm the state is what cables and rods allow, no observation",
    fix=f"{_DRAWN}: look there at what hides the robot, its light, the view of the camera",
)
def seldom_lost(run: Run) -> Iterator[Found]:
    """Camera runs that were mostly guessed."""
    mode = run.array("frames", "mode")
    if mode is None or not len(mode):
        return
    lost = float(np.mean((mode & _LOST) > 0))
    if lost > LOST_SHARE:
        yield Found(run.at("frames", "mode"), "the robot was lost for a time",
                    f"at most {100 * LOST_SHARE:g} % of the frames", f"{100 * lost:.3g} %")  # fmt: skip


@check(
    "advice",
    Run,
    kinds=_KINDS,
    what="no cable sensor contradicts the camera",
    why="a sensor that is not used does not help where caps are hidden; the robot's controller used it all the same",
    fix="r2s2r calibrate --points points.csv   # a new table of that sensor; or look at its cable and its chip",
)
def sensors_agree_with_camera(run: Run) -> Iterator[Found]:
    """Sensors that the tracker left out."""
    dead, cable = run.array("sensor_fit", "dead"), run.array("frames", "sensor_cable")
    if dead is None or not dead.any():
        return
    named = np.flatnonzero(dead) if cable is None or len(cable) != len(dead) else cable[dead]
    what = "cable sensors were not used: they contradict what was seen, or are silent"
    yield Found(run.at("sensor_fit", "dead"), what, "every sensor used",
                "not that of cable " + ", ".join(map(str, named.tolist())))  # fmt: skip
