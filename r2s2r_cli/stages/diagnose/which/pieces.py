"""Target intervals cut into pieces of about a second, each begun anew in the pose that was seen.

Where a robot tips is decided by less than a millimetre: two good engines tip at other instants and are decimetres apart
ever after. A piece forgives that at its end. What the caps do not show goes on from one piece to the next: roll, slack
cables, the memory of effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.starts import known_at, loose
from r2s2r_cli.stages.diagnose.which.stretches import Stretch, stretch_of
from r2s2r_cli.stages.diagnose.which.white import OFFSET_SHARE
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.offsets import StartSpread
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from r2s2r_cli.engine import State
    from r2s2r_cli.stages.diagnose.which.replay import Replayer

SHORTEST_S, LONGEST_S = 0.7, 1.5
"""[s] Length of a piece: the noisier the caps, the longer a piece must be to say more than where it began."""
SECONDS_PER_M = 150.0
LEAST_FRAMES = 3
ROLL_RAD, ROLL_RATE = 0.08, 0.1
"""Of a rod about its own axis, which no cap shows."""
LEAST_SPEED_SD = 5e-3
"""[m/s] The filter takes motion for smoother than a fall is."""
LEAST_REST_M = 1e-3


@dataclass(frozen=True)
class _Cut:
    """One piece to be: frames (F,) of the run, after the one it starts at."""

    run: Run
    interval: int
    piece: int
    first: int
    frames: np.ndarray

    @property
    def place(self) -> tuple[str, int]:
        """Run and interval."""
        return self.run.name, self.interval


def pieces(
    runs: Sequence[Run],
    part: Sequence[Selection],
    states: Mapping[tuple[str, int], State],
    replayer: Replayer,
    values: np.ndarray,
) -> tuple[Stretch, ...]:
    """The intervals of a part of the split as pieces, in order. states: at the begin of each interval; values (n,): of
    the model, with which what is not seen is carried on. Raises NumericalError where nothing can be simulated."""
    named = {run.name: run for run in runs}
    cuts = [cut for one in part for number in one.intervals for cut in _cuts(named[one.run], number)]
    begin: dict[tuple[str, int], State] = dict(states)
    taut: dict[tuple[str, int], np.ndarray] = {}
    made: dict[tuple[str, int, int], Stretch] = {}
    for depth in range(1 + max((cut.piece for cut in cuts), default=-1)):
        now = [cut for cut in cuts if cut.piece == depth]
        found = [_piece(cut, begin[cut.place], taut.get(cut.place), replayer) for cut in now]
        made.update({(*cut.place, depth): one for cut, one in zip(now, found, strict=True)})
        longer = {cut.place for cut in cuts if cut.piece == depth + 1}
        going = [k for k, cut in enumerate(now) if cut.place in longer]
        if going:
            after = replayer.finals([found[k] for k in going], values)
            own, rest = _begun([now[k] for k in going], after, replayer, values)
            begin.update({now[k].place: state for k, state in zip(going, own, strict=True)})
            taut.update({now[k].place: row for k, row in zip(going, rest, strict=True)})
    ordered = [made[(*cut.place, cut.piece)] for cut in cuts]
    return tuple(replace(one, order=k, goes_on=_gap(one, ordered[k + 1 : k + 2])) for k, one in enumerate(ordered))


def _gap(one: Stretch, following: Sequence[Stretch]) -> float:
    """Seconds to the begin of the next piece, if that comes in the run before a frame can be missing."""
    apart = float(np.diff(one.window.run.t).max(initial=0.0)) if len(one.t) > 1 else 0.0
    gaps = [after.window.start - float(one.t[-1]) for after in following if after.run == one.run]
    return max((gap for gap in gaps if 0.0 < gap <= apart + 1e-6), default=0.0)


def length_of(run: RunData) -> float:
    """How long its pieces are, at most [s]."""
    return float(np.clip(SECONDS_PER_M * np.sqrt(np.mean(run.noise**2)) + 0.5, SHORTEST_S, LONGEST_S))


def _cuts(run: Run, number: int) -> list[_Cut]:
    """An interval in pieces of about equal length, at frames of the camera."""
    caps = run.caps
    first, last = int(caps.intervals.first[number - 1]), int(caps.intervals.last[number - 1])
    t = caps.t[first : last + 1]
    if last - first < LEAST_FRAMES:
        return [_Cut(run, number, 0, first, np.arange(first + 1, last + 1))] if last > first else []
    count = max(1, min(round((t[-1] - t[0]) / length_of(caps)), (last - first) // LEAST_FRAMES))
    wanted = t[0] + (t[-1] - t[0]) * np.arange(1, count) / count
    inner = [first + int(np.argmin(np.abs(t - at))) for at in wanted]
    edges = sorted({first, *inner, last})
    return [_Cut(run, number, k, a, np.arange(a + 1, b + 1)) for k, (a, b) in enumerate(pairwise(edges))]


def _piece(cut: _Cut, state: State, taut: np.ndarray | None, replayer: Replayer) -> Stretch:
    caps = cut.run.caps
    count = len(cut.frames)
    own = Window(
        run=caps, intervals=(cut.interval,), first=cut.first, frames=cut.frames, key=np.zeros(count, bool),
        place=np.zeros(count, dtype=int), state=state,
    )  # fmt: skip
    made = stretch_of(cut.run, cut.interval, own, 0)
    return replace(
        made, piece=cut.piece, taut=taut, margin=loose(cut.run, cut.first),
        start_sd=_start_sd(cut.run, cut.first, replayer),
    )  # fmt: skip


def _start_sd(run: Run, frame: int, replayer: Replayer) -> np.ndarray:
    """Sd of the start state, as the caps are known by then."""
    rods = replayer.structure.n_rods
    known = run.known
    offset = OFFSET_SHARE * np.sqrt(np.mean(run.caps.noise**2))
    position = float(np.hypot(np.sqrt(np.mean(known.sd_p[frame] ** 2)), offset))
    speed = float(np.hypot(np.sqrt(np.mean(known.sd_v[frame] ** 2)), LEAST_SPEED_SD))
    ends = known.p_WE[frame].reshape(rods, 2, 3)
    length = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1).mean())
    spread = StartSpread(
        position=position / np.sqrt(2.0), tilt=np.sqrt(2.0) * position / length, roll=ROLL_RAD,
        velocity=speed / np.sqrt(2.0), tilt_rate=np.sqrt(2.0) * speed / length, roll_rate=ROLL_RATE,
        rest=max(np.sqrt(2.0) * position, LEAST_REST_M),
    )  # fmt: skip
    return spread.sd(replayer.structure)


def _begun(
    cuts: Sequence[_Cut], after: State, replayer: Replayer, values: np.ndarray
) -> tuple[list[State], np.ndarray]:
    """Starts of the next pieces: known poses, what they do not show from the pieces before (a batch of states); and
    the rest lengths of winched cables that are just taut there [m], (piece, actuated)."""
    import torch

    from r2s2r_cli.engine.reading import read

    theta = replayer.mapping.theta(torch.as_tensor(values, dtype=torch.float64))
    state = known_at([(cut.run, int(cut.frames[-1])) for cut in cuts], after, replayer, values)
    with torch.no_grad():
        reading, winched = read(replayer.structure, theta, state), list(replayer.structure.actuated)
        just = state.rest + (reading.length - reading.rest)[:, winched]  # effects may add to what the winches give
        taut = torch.where(reading.tension[:, winched] > 0, state.rest, torch.minimum(just, state.rest))
    return [state.select(k) for k in range(len(cuts))], taut.numpy()
