"""What really happened, for whoever compares: a CSV that the rig writes and nothing of r2s2r reads by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from r2s2r_cli.rig.closing import Closing
from r2s2r_cli.rig.plant import Truth


class TruthLog(Closing):
    """One row every `period` [s] of the rig's time: t_s, cap{i}_{x,y,z}_m, length{i}_m, duty{i}."""

    def __init__(self, path: Path, *, caps: int, cables: int, motors: int, period: float) -> None:
        self._file = path.open("w", encoding="ascii", buffering=1)
        self._period, self._due = period, 0.0
        names = ["t_s", *(f"cap{i}_{axis}_m" for i in range(caps) for axis in "xyz")]
        names += [*(f"length{i}_m" for i in range(cables)), *(f"duty{i}" for i in range(motors))]
        self._file.write(",".join(names) + "\n")

    def observe(self, t: float, read: Callable[[], tuple[Truth, np.ndarray]]) -> None:
        """Write the row that is due at time t, if one is. read: the truth, and the duty of every motor on the wire."""
        if t + 1e-9 < self._due:
            return
        self._due = max(self._due + self._period, t)
        truth, duty = read()
        self._row([truth.t, *truth.p_WE.ravel(), *truth.length, *duty])

    def close(self) -> None:
        """End the file."""
        self._file.close()

    def _row(self, numbers: Sequence[float]) -> None:
        self._file.write(",".join(f"{x:.6f}" for x in numbers) + "\n")
