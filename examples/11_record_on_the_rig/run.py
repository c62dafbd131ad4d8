"""A robot on the desk, calibrated, driven and recorded: `python examples/11_record_on_the_rig/run.py --out DIR`.

In a new project below DIR: the rig's sensors are measured on the bench and calibrated, the rig runs in lock-step, and a
random policy is recorded in each protocol. Prints how far the recorded lengths are from what the rig knows to be true,
and draws `rig-lengths.png`. What it shows: docs/guides/rig.md.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

COMMAND = [sys.executable, "-m", "r2s2r_cli"]
PROTOCOLS = ("checked", "boards", "legacy")
STEP_S = 0.002
"""How finely the start of the run is looked for in the log of the truth."""


def r2s2r(*arguments: str, folder: Path) -> None:
    """A command that must succeed."""
    subprocess.run([*COMMAND, *arguments, "--quiet"], cwd=folder, check=True, stdout=subprocess.DEVNULL)


def recorded(folder: Path, protocol: str, targets: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A random policy on the rig, recorded: t (sample,) [s], measured and true lengths (sample, cable) [m]."""
    truth, artifact = folder / f"{protocol}.csv", folder / "iterations" / "001" / "10-record.h5"
    command = [*COMMAND, "rig", "--fast", "--link", "tcp", "--protocol", protocol, "--truth", str(truth), "--quiet"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as rig:
        try:
            device = rig.stdout.readline().strip()  # the one line it prints there
            options = ("--port", device, "--protocol", protocol, "--no-draw", "--force")
            r2s2r("record", "--random", str(targets), "--seed", "1", *options, folder=folder)
        finally:
            rig.terminate()
    with h5py.File(artifact) as file:
        sensors = next(iter(file["runs"].values()))["sensors"]
        t, length = sensors["t"][:], sensors["length"][:]
    return t, length, aligned(t, length, truth)


def aligned(t: np.ndarray, length: np.ndarray, truth: Path) -> np.ndarray:
    """The true lengths at the times of the samples. The run began at an unknown time of the rig: it is looked for."""
    table = np.genfromtxt(truth, delimiter=",", names=True)
    columns = [table[name] for name in table.dtype.names if name.startswith("length")]

    def true(shift: float) -> np.ndarray:
        return np.column_stack([np.interp(t + shift, table["t_s"], column) for column in columns])

    shifts = np.arange(0.0, table["t_s"][-1] - t[-1] + STEP_S, STEP_S)
    return true(min(shifts, key=lambda shift: float(np.nanmean(np.nanvar(length - true(shift), axis=0)))))


def main(
    out: Path, say: Callable[[str], None] = print, *, targets: int = 4, protocols: tuple[str, ...] = PROTOCOLS
) -> None:
    """Everything, into `out`. say: where the lines go."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    out.mkdir(parents=True, exist_ok=True)
    folder = out / "robot"
    r2s2r("init", "robot", "--robot", "threebar", folder=out)
    r2s2r("rig", "--points", "points.csv", folder=folder)
    r2s2r("calibrate", "--points", "points.csv", "--no-draw", folder=folder)
    say(f"{'protocol':10}{'samples':>9}{'bias of a sensor, rms':>24}{'about that bias, rms':>22}{'largest':>10}")
    figure, axes = plt.subplots(3, 3, figsize=(11, 6), sharex=True, sharey="row")
    for protocol in protocols:
        t, length, true = recorded(folder, protocol, targets)
        error = 1e3 * (length - true)
        bias = np.nanmean(error, axis=0)
        about = np.sqrt(np.nanmean((error - bias) ** 2))
        largest = np.nanmax(np.abs(error))
        say(f"{protocol:10}{len(t):9d}{np.sqrt((bias**2).mean()):21.1f} mm{about:19.1f} mm{largest:7.1f} mm")
        if protocol == protocols[0]:
            for cable, ax in enumerate(axes.flat):
                seen = np.isfinite(length[:, cable])
                ax.plot(t[seen], 1e3 * true[seen, cable], color="0.6", lw=2, label="true")
                ax.plot(t[seen], 1e3 * length[seen, cable], "C0", lw=0.8, label="recorded")
                ax.set_title(f"cable {cable}", fontsize=9)
    for ax in axes[:, 0]:
        ax.set_ylabel("length [mm]")
    for ax in axes[-1]:
        ax.set_xlabel("t [s]")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(out / "rig-lengths.png", dpi=110)
    plt.close(figure)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    main(parser.parse_args().out)
