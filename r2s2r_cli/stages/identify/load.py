"""A recorded and estimated run as what a fit knows of it, or why nothing can be learned from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.smooth import MISSING, OUTLIER
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.segments import Intervals, Segments

GUESSED_M = 0.005
"""Standard deviation of a hidden cap, along its worst axis, from which on it counts as not observed at all."""
STILL = 3.0
"""A run whose caps, averaged, move less than this many standard deviations of the noise (all axes) shows no motion."""
AVERAGED_S = 0.5

LEAST_M = 1e-5
"""Noise of a log that has none: its numbers are rounded somewhere."""


def run_data(
    recording: ArtifactData | None, estimate: ArtifactData, run: str, *, name: str = "", still: bool = False
) -> RunData:
    """The run of both artifacts; `name`: what it is called in the fit (default: as there). still: one in which nothing
    moves is a run as well: nothing can be identified from it, but a motor that does not start is a finding.

    observed: the recording's end caps at the frames that the estimate kept, moved on to its ground. Of camera images,
    what the tracker knew at each frame from it and those before.

    Raises InputError where there are no kept frames, target intervals or motor commands, where the recording is another
    one, for numbers that are not finite, and, unless `still`, where no cap moves.
    """
    frames, tracks, commands = (_group(estimate, run, stream) for stream in ("frames", "tracks", "commands"))
    if not len(frames["t"]):
        raise InputError(
            f"run {run} has no frame left", where=f"runs/{run}/frames/t", expected="kept frames", received="none",
            hint="r2s2r inspect 10-record.h5   # drop_reason: why rows were left out",
        )  # fmt: skip
    intervals = Intervals.from_group(_group(estimate, run, "intervals"))
    if not len(intervals):
        raise InputError(
            f"run {run} has no target intervals", where=f"runs/{run}/intervals", expected="targets in its log",
            received="no interval", hint="r2s2r import run.csv   # with columns target0, target1, ...",
        )  # fmt: skip
    caps = None if recording is None else recording.group(run, "caps")
    bias, delay = _sensors(estimate.group(run, "sensor_fit"))
    heard = None if recording is None else recording.group(run, "sensors")
    found = RunData(
        name=name or run,
        t=frames["t"],
        observed=_as_known(frames, tracks)
        if caps is None
        else _observed(caps, frames, _group(estimate, run, "ground"), run),
        noise=tracks["noise_sd"],
        observed_sd=tracks["observed_sd"] if caps is None and "observed_sd" in tracks else None,
        p_WE=frames["p_WE"],
        sd_p=np.sqrt(np.diagonal(frames["cov_p_WE"], axis1=-2, axis2=-1)),
        v_WE=frames["v_WE"],
        sd_v=frames["sd_v_WE"],
        quality=frames["quality"] if caps is not None else _quality(frames, tracks, estimate.group(run, "camera")),
        t_command=commands["t"],
        control=_control(commands, run),
        target=commands["target"],
        intervals=intervals,
        segments=Segments.from_group(_group(estimate, run, "segments")),
        sampled=caps is not None and bool(np.isin(commands["t"], caps["t"]).all()),
        nature=str(estimate.groups[f"runs/{run}"].attributes.get("nature", "")),
        sensor_bias=bias,
        sensor_delay=delay,
        sensor_cable=None if heard is None or "cable" not in heard else heard["cable"],
    )
    _require_finite(found, run)
    _require_rows(found, run)
    if not still:
        _require_motion(found, run)
    return found


def require_two_intervals(runs: Sequence[RunData]) -> None:
    """Raises InputError where all runs together have fewer than two complete intervals: no test beside a training."""
    complete = sum(int(run.intervals.complete.sum()) for run in runs)
    if complete >= 2:
        return
    names = ", ".join(run.name for run in runs) or "none"
    targets = np.concatenate([run.target[np.isfinite(run.target).all(axis=1)] for run in runs]) if runs else np.zeros(0)
    if len(targets) and len(np.unique(targets, axis=0)) == 1:
        what, received = "the targets never change", f"one target vector in all of {names}"
    else:
        what, received = "one target interval is not enough", f"{complete} complete in {names}"
    raise InputError(
        what, where="intervals/target", received=received,
        expected="at least two complete target intervals, one to train on and one to test",
        hint="r2s2r record --random 15 --port /dev/ttyUSB0   # or: import a log with several targets",
    )  # fmt: skip


def _group(data: ArtifactData, run: str, stream: str) -> Group:
    group = data.group(run, stream)
    if group is None:
        raise InputError(
            f"run {run} has no {stream}", where=f"runs/{run}/{stream}", expected=f"{stream} in the {data.kind}",
            received=", ".join(name for name, _ in data.streams(run) if name) or "nothing",
            hint="r2s2r import run.csv   # a log with end caps, targets and controls",
        )  # fmt: skip
    return group


def _sensors(fit: Group | None) -> tuple[np.ndarray | None, float | None]:
    """Errors of the sensors, mean over the run [m], (sensor,), and how late they read [s]."""
    if fit is None or not len(fit["bias"]):
        return None, None
    bias = np.where(fit["dead"], np.nan, fit["bias"].mean(axis=0))
    return bias, float(fit.attributes["delay"]) if fit.attributes["delay_known"] else None


def _as_known(frames: Group, tracks: Group) -> np.ndarray:
    """End caps of a run of camera images; smoothed ones know later frames, and no test segment may start from them."""
    return tracks["observed"] if "observed" in tracks else frames["p_WE"]


def _quality(frames: Group, tracks: Group, camera: Group | None) -> np.ndarray:
    """Codes of a run of camera images, (frame, cap): OUTLIER where what was known of a cap is a guess.

    That is where it was hidden for so long that it is GUESSED_M uncertain, and before the frame in which the tracker
    told the caps apart: what it knew there it had from later frames.
    """
    quality = frames["quality"].copy()
    if "observed_sd" in tracks:
        guessed = tracks["observed_sd"].max(axis=2) > GUESSED_M
        quality[(quality == MISSING) & guessed] = OUTLIER
    if camera is not None:
        quality[: int(camera.attributes.get("begun", 0))] = OUTLIER
    return quality


def _observed(caps: Group, frames: Group, ground: Group, run: str) -> np.ndarray:
    """End caps of the recording at the kept frames, with the ground at z = 0."""
    rows = frames["source_frame"]
    if int(rows.max()) >= len(caps["p_WE"]) or not np.array_equal(caps["t"][rows], frames["t"]):
        raise InputError(
            "the estimate was made of another recording", where=f"runs/{run}/frames/source_frame",
            expected=f"rows 0 to {len(caps['p_WE']) - 1} of the recording, with its stamps",
            received=f"rows up to {int(rows.max())}", hint="r2s2r estimate",
        )  # fmt: skip
    return caps["p_WE"][rows] + np.array([0.0, 0.0, float(ground.attributes["shift"])])


def _control(commands: Group, run: str) -> np.ndarray:
    """Motor commands with what was not logged as 0, as `simulate --replay` takes it."""
    if "control" not in commands or not np.isfinite(commands["control"]).any():
        raise InputError(
            f"run {run} has no motor commands to replay", where=f"runs/{run}/commands/control",
            expected="control, +1 reels in", received="nothing logged",
            hint="r2s2r import run.csv   # with columns control0, control1, ...",
        )  # fmt: skip
    control: np.ndarray = np.nan_to_num(commands["control"])
    if not control.any():
        raise InputError(
            f"no motor is commanded in run {run}, and the targets change", where=f"runs/{run}/commands/control",
            expected="control, +1 reels in, where the robot moves", received="0 everywhere",
            hint="r2s2r import run.csv   # with the commands in control0, control1, ...",
        )  # fmt: skip
    return control


def _require_finite(data: RunData, run: str) -> None:
    for name in ("t", "observed", "noise", "observed_sd", "p_WE", "sd_p", "v_WE", "sd_v", "t_command"):
        value = getattr(data, name)
        if value is None:
            continue
        bad = ~np.isfinite(value)
        if bad.any():
            place = np.argwhere(bad)[0].tolist()
            raise InputError(
                f"run {run} has numbers that are not finite", where=f"runs/{run}: {name}{place}",
                expected="finite numbers", received=f"{int(bad.sum())} that are not", hint="r2s2r validate",
            )  # fmt: skip


def _require_rows(data: RunData, run: str) -> None:
    last = int(data.intervals.last.max())
    if last >= len(data.t):
        raise InputError(
            f"the target intervals of run {run} count more frames than were kept", where=f"runs/{run}/intervals/last",
            expected=f"at most {len(data.t) - 1}", received=str(last), hint="r2s2r estimate --force",
        )  # fmt: skip


def _require_motion(data: RunData, run: str) -> None:
    # Of means over AVERAGED_S: noise whose errors last is stated as the white noise that is as bad, frame by frame.
    count = min(len(data.t), max(1, int(np.searchsorted(data.t, data.t[0] + AVERAGED_S))))
    means = np.diff(np.cumsum(np.pad(data.p_WE, ((1, 0), (0, 0), (0, 0))), axis=0)[::count], axis=0) / count
    moved = np.linalg.norm(means - means[0], axis=-1).max(axis=0)
    noise = np.maximum(np.linalg.norm(data.noise, axis=-1) / np.sqrt(count), LEAST_M)
    if (moved < STILL * noise).all():
        cap = int(np.argmax(moved / noise))
        raise InputError(
            f"nothing moves in run {run}", where=f"runs/{run}/frames/p_WE",
            expected=f"an end cap that moves more than {STILL:g} times its noise ({1e3 * STILL * noise[cap]:.1f} mm)",
            received=f"at most {1e3 * moved[cap]:.1f} mm, cap {cap}",
            hint="r2s2r inspect 20-estimate.h5   # frames/p_WE",
        )  # fmt: skip
