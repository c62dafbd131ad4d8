"""A long recording on the rig, watched from outside: `python examples/12_long_recordings/run.py --out DIR`.

In a new project below DIR one run of random targets is recorded while the memory of the recorder and of the rig is
looked at: 30 minutes of the rig's time in lock-step (`r2s2r rig --fast`); with --camera 3 minutes in real time, with
pictures. Prints what both held at 10 % of the run and at its end, how far the clock of the recording and the boards'
went from the rig's, and what was lost. What it shows: docs/guides/record.md. Reads /proc: Linux only.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

COMMAND = [sys.executable, "-m", "r2s2r_cli"]
TARGET_S = 3.0
"""What a random target takes on the 3-bar robot, about."""
LOOK_S = 0.1
BEGIN = 0.1
"""Share of the run after which everything is loaded and every buffer has its size."""
WINDOW_S = 20.0
"""Of the run's beginning and end, in which the rig's time of a sample is looked for."""
FINE_S = 0.001


@dataclass(frozen=True)
class Watched:
    """t: the rig's time (look,) [s]; recorder, rig: memory of each, its children's included (look,) [MB]."""

    t: np.ndarray
    recorder: np.ndarray
    rig: np.ndarray


def main(out: Path, say: Callable[[str], None] = print, *, seconds: float, camera: bool) -> dict[str, float]:
    """Record, watch, compare. say: where the lines go. Memory [MB] and clocks [s] by name; lost frames and samples."""
    out.mkdir(parents=True, exist_ok=True)
    folder, truth = out / "robot", out / "truth.csv"
    for arguments, where in (
        (("init", "robot", "--robot", "threebar"), out),
        (("rig", "--points", "points.csv"), folder),
        (("calibrate", "--points", "points.csv", "--no-draw"), folder),
    ):
        subprocess.run([*COMMAND, *arguments, "--quiet"], cwd=where, check=True, stdout=subprocess.DEVNULL)
    way = ("--camera-port", "0") if camera else ("--fast",)
    command = [*COMMAND, "rig", "--link", "tcp", "--truth", str(truth), "--json", *way]
    begin = time.monotonic()
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as rig:
        try:
            device = document(rig.stdout)
            ask = ["--port", device["device"], *(["--camera", device["camera"]] if camera else [])]
            ask += ["--random", str(round(seconds / TARGET_S)), "--no-draw", "--json"]
            with (out / "said.json").open("w") as said:
                recorder = subprocess.Popen([*COMMAND, "record", *ask], cwd=folder, stdout=said)
            watched = watch(recorder, rig, truth)
        finally:
            rig.terminate()
    if recorder.returncode:
        raise SystemExit(recorder.returncode)
    wall = time.monotonic() - begin
    (run,) = json.loads((out / "said.json").read_text())["report"]["runs"]
    found = {"duration_s": run["duration_s"], "wall_s": wall, "lost_samples": float(run["lost"]), **memory(watched)}
    say(f"{run['duration_s'] / 60:.1f} minutes of the robot in {wall:.0f} s")
    say(f"{run['samples']} samples, {run['lost']} lost, {run['repeated']} repeated, {run['corrupt']} corrupt")
    say(f"control {run['rate_hz']:.2f} Hz, {run['late']} of {run['ticks']} ticks late, held in {run['held']}")
    for who in ("recorder", "rig"):
        first, last, most = (found[f"{who}_{when}_mb"] for when in ("begin", "end", "most"))
        say(f"{who}: {first:.1f} MB at 10 % of the run, {last:.1f} MB at its end, {most:.1f} MB at most")
    clocks = drifts(folder / "iterations" / "001" / "10-record.h5", truth)
    for name, drift in clocks.items():
        rate = 1e6 * drift / run["duration_s"]
        say(f"clock of the {name}: {1e3 * drift:+.1f} ms against the rig's, {rate:+.1f} ppm")
    if camera:
        frames, lost = run["camera"]["frames"], run["camera"]["lost"]
        found["lost_frames"], found["frames"] = float(lost), float(frames)
        say(f"{frames} frames, {run['camera']['rate_hz']:.2f} a second, {lost} lost")
    return found | {f"drift_{name}_s": drift for name, drift in clocks.items()}


def document(stream: IO[str]) -> dict[str, Any]:
    """The JSON document that the rig prints before it serves."""
    text = ""
    while not text.endswith("}\n"):
        text += stream.readline()
    found: dict[str, Any] = json.loads(text)
    return found


def watch(recorder: subprocess.Popen[Any], rig: subprocess.Popen[Any], truth: Path) -> Watched:
    """Until the recorder has ended; looks before the robot moves and after it stopped for good are left out."""
    rows = []
    while recorder.poll() is None:
        rows.append((rig_time(truth), resident(recorder.pid), resident(rig.pid)))
        time.sleep(LOOK_S)
    t, ours, theirs = np.array(rows).T
    moving = (t > 0) & (t < t[-1])  # in lock-step it stands still while the recording is sealed
    return Watched(t[moving], ours[moving], theirs[moving])


def rig_time(truth: Path) -> float:
    """Time of the last whole row of the rig's log [s]; 0 before the first."""
    if not truth.exists():
        return 0.0
    with truth.open("rb") as file:
        file.seek(max(0, truth.stat().st_size - 4096))
        rows = file.read().split(b"\n")
    return float(rows[-2].split(b",")[0]) if len(rows) > 3 else 0.0


def resident(pid: int) -> float:
    """Memory of a process and its children [MB], 0 once it is gone."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return 0.0
    own = next((float(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")), 0.0)
    return own / 1024 + sum(resident(int(child)) for child in children)


def memory(watched: Watched) -> dict[str, float]:
    """Of both: median of the tenth of the looks after 10 % of the run and of the last tenth, and the most [MB].
    Tenths of the looks, not of the time: a fast machine is through a short run in few looks."""
    looks = len(watched.t)
    loaded = int(np.searchsorted(watched.t, watched.t[0] + BEGIN * np.ptp(watched.t)))
    tenth = max(1, round(BEGIN * looks))
    found = {}
    for who, held in (("recorder", watched.recorder), ("rig", watched.rig)):
        found[f"{who}_begin_mb"] = float(np.median(held[min(loaded, looks - 1) :][:tenth]))
        found[f"{who}_end_mb"] = float(np.median(held[-tenth:]))
        found[f"{who}_most_mb"] = float(held.max())
    return found


def drifts(artifact: Path, truth: Path) -> dict[str, float]:
    """By how much a clock gained on the rig's from the beginning of the run to its end [s]: the recording's, that the
    lengths were stamped with, and each board's."""
    table = np.genfromtxt(truth, delimiter=",", names=True)
    names = [name for name in table.dtype.names if name.startswith("length")]
    true = np.column_stack([table[name] for name in names])
    with h5py.File(artifact) as file:
        sensors = next(iter(file["runs"].values()))["sensors"]
        t, board, t_board, length = (sensors[name][:] for name in ("t", "board", "t_board", "length"))
    window = min(WINDOW_S, (t[-1] - t[0]) / 3)
    rough = np.arange(0.0, max(table["t_s"][-1] - t[-1], 0.0) + 0.5, 0.02)
    first, last = t < t[0] + window, t > t[-1] - window
    begin = placed(t[first], length[first], table["t_s"], true, rough)
    end = placed(t[last], length[last], table["t_s"], true, begin + np.arange(-0.5, 0.5, 0.02))
    found = {"recording": begin - end}
    for number in np.unique(board):
        ahead = t_board - t  # in lock-step up to a tick off, which the mean over a window takes out
        gained = ahead[last & (board == number)].mean() - ahead[first & (board == number)].mean()
        found[f"board {number}"] = float(gained) + found["recording"]
    return found


def placed(
    t: np.ndarray, length: np.ndarray, t_true: np.ndarray, true: np.ndarray, shifts: np.ndarray
) -> float:  # fmt: skip
    """The shift t + shift = rig's time at which recorded lengths (sample, cable) fit the true ones best [s]."""

    def spread(shift: float) -> float:
        seen = np.column_stack([np.interp(t + shift, t_true, column) for column in true.T])
        return float(np.nanmean(np.nanvar(length - seen, axis=0)))

    best = min(shifts, key=spread)
    return float(min(best + np.arange(-0.02, 0.02 + FINE_S, FINE_S), key=spread))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    parser.add_argument("--camera", action="store_true")
    parser.add_argument("--minutes", type=float, help="30 without, 3 with a camera")
    given = parser.parse_args()
    minutes = given.minutes or (3.0 if given.camera else 30.0)
    main(given.out, seconds=60 * minutes, camera=given.camera)
