"""What is to be imitated: the observed part of a real run, or a synthetic one of known parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.paper.key_frames import Spans, spans

if TYPE_CHECKING:
    from r2s2r_cli.engine import Simulator
    from r2s2r_cli.stages.identify.paper.flight import Flight


@dataclass(frozen=True)
class Demonstration:
    """Consecutive target intervals of one run, on a clock that is 0 at the first frame.

    t: (frame,) [s]. p_WE: observed caps [m], v_WE: their velocities [m/s], (frame, cap, 3); only multiple shooting
    reads velocities. targets: (interval, actuated). first: number of its first interval in the run. t_command [s],
    control: the recorded commands.
    """

    name: str
    t: np.ndarray
    p_WE: np.ndarray
    v_WE: np.ndarray
    targets: np.ndarray
    first: int
    spans: Spans
    t_command: np.ndarray
    control: np.ndarray


def demonstrations(run: RunData, selection: Selection) -> tuple[Demonstration, ...]:
    """The selected intervals, one demonstration for each stretch without a gap, as the tracker saw them (not smoothed).

    Raises InputError where nothing complete is selected.
    """
    complete = set((np.flatnonzero(run.intervals.complete) + 1).tolist())
    chosen = [k for k in selection.intervals if k in complete]
    if not chosen:
        raise InputError(
            "nothing to identify from", where=f"run {run.name}",
            expected="complete target intervals", received=f"intervals {', '.join(map(str, selection.intervals))}",
            hint=f"r2s2r inspect 20-estimate.h5   # lists the intervals of run {run.name}",
        )  # fmt: skip
    stretches: list[list[int]] = []
    for k in chosen:
        if stretches and k == stretches[-1][-1] + 1:
            stretches[-1].append(k)
        else:
            stretches.append([k])
    return tuple(_stretch(run, stretch) for stretch in stretches)


def _stretch(run: RunData, chosen: list[int]) -> Demonstration:
    rows = np.array(chosen) - 1
    first, last = int(run.intervals.first[rows[0]]), int(run.intervals.last[rows[-1]])
    frames = slice(first, last + 1)
    t0, own = float(run.t[first]), spans(run.segments, chosen)
    return Demonstration(
        name=f"{run.name}:{chosen[0]}-{chosen[-1]}", t=run.t[frames] - t0, p_WE=run.observed[frames],
        v_WE=run.v_WE[frames], targets=run.intervals.target[rows], first=chosen[0],
        spans=Spans(own.interval, own.t_first - t0, own.t_last - t0, own.t_next - t0),
        t_command=run.t_command - t0, control=run.control,
    )  # fmt: skip


def synthetic(
    simulator: Simulator, flight: Flight, p_WE: np.ndarray, targets: np.ndarray, *, name: str = "synthetic",
    every: int = 1, noise_sd: float = 0.0, seed: int = 0,
) -> Demonstration:  # fmt: skip
    """A simulated closed-loop run as ground truth. p_WE: its caps [m], (tick, cap, 3); every: ticks a frame; noise [m].

    Velocities are differences of the noisy positions: nothing else would be observed of a real one.
    """
    from r2s2r_cli.stages.segments import segments, target_intervals

    t, control, target = flight.t[::every], flight.control[::every], flight.target[::every]
    seen = p_WE[::every] + noise_sd * np.random.default_rng(seed).standard_normal(p_WE[::every].shape)
    own = segments(target_intervals(t, target, control=control), t, control)
    return Demonstration(
        name=name, t=t, p_WE=seen, v_WE=np.gradient(seen, t, axis=0), targets=targets, first=1,
        spans=spans(own, range(1, len(targets) + 1)), t_command=flight.t[:-1], control=flight.control[:-1],
    )  # fmt: skip
