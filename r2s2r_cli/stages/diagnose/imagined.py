"""Policies that nobody has run, imagined: as one stretch, driven by an ideal controller from where a fitted run began.

Commands are the same for all candidates, as in the replay of a recorded run: what differs is the robot.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

Targets = tuple[tuple[float, ...], ...]
SETTLE_S = 0.3
"""After the last cable of a target is there."""
RATE_HZ = 10.0
LONGEST = 8
"""Targets of a policy that are simulated: a longer one goes on as it began."""


def targets_of(targets: np.ndarray) -> Targets:
    """Of the target intervals of a run (interval, actuated); where none is known the cable is long."""
    return tuple(tuple(float(x) for x in row) for row in np.nan_to_num(targets, nan=1.0))


def imagined(arena: Arena, targets: Targets, *, like: Stretch | None = None, name: str = "") -> Stretch:
    """The policy as one stretch from where a fitted one begins, its targets driven by an ideal controller. Nobody has
    seen it: caps and lengths are 0. like: that stretch, the first if None; name: of the policy, no two alike that begin
    apart."""
    like = arena.many[0] if like is None else like
    robot = arena.model.robot
    state: State = like.window.state
    control, t = commands(targets, robot.pid.range_m, speed_of(arena.model), before=_before(like))
    frames = np.arange(1, int(t[-1] * RATE_HZ) + 1) / RATE_HZ
    noise = np.broadcast_to(like.noise.mean(axis=0), (len(frames), *like.noise.shape[1:]))
    length = sd = None
    if like.length is not None and like.length_sd is not None:
        length = np.zeros((len(frames), len(like.sensors)))
        sd = np.broadcast_to(like.length_sd.mean(axis=0), length.shape)
    run = replace(
        like.window.run, t=np.concatenate([[0.0], frames]), t_command=t, control=control, sampled=False,
        observed=np.broadcast_to(like.caps[0], (len(frames) + 1, *like.caps[0].shape)),
    )  # fmt: skip
    window = Window(
        run=run, intervals=(1,), first=0, frames=np.arange(1, len(frames) + 1), key=np.zeros(len(frames), bool),
        place=np.zeros(len(frames), dtype=int), state=state,
    )  # fmt: skip
    caps = np.zeros((len(frames), *like.caps[0].shape))
    run_name = f"imagined {name} from {like.run}"
    return Stretch(run_name, run_name, 1, 0, window, caps, noise, length, sd, like.sensors)


def _before(like: Stretch) -> np.ndarray | None:
    """What cables were told before a stretch, as far as its run says; None: it is the first, all are long."""
    target = like.window.run.intervals.target
    return np.nan_to_num(target[like.interval - 2], nan=1.0) if 1 < like.interval <= len(target) else None


def commands(
    targets: Targets, wide: float, speed: float, *, before: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Motor commands (row, actuated) at times (row,): full speed until each cable is there. before (actuated,): the
    target where the cables are to begin with; None: all are long."""
    longer, needs = _ways(targets, wide, speed, before)
    edges = [0.0, *_ends(needs).tolist()]
    rows, times = [np.zeros(needs.shape[1])], [0.0]
    for begin, need, sign in zip(edges, needs, -np.sign(longer), strict=False):  # shorter: reel in, +1
        for at in (0.0, *sorted(set(need[need > 0].tolist()))):
            rows.append(np.where(need > at + 1e-9, sign, 0.0))
            times.append(begin + at)
    return np.array([*rows, np.zeros(needs.shape[1])]), np.array([*times, edges[-1]])


def target_ends(targets: Targets, wide: float, speed: float, *, before: np.ndarray | None = None) -> np.ndarray:
    """When each target is over [s], (target,), as `commands` drives them."""
    return _ends(_ways(targets, wide, speed, before)[1])


def _ways(
    targets: Targets, wide: float, speed: float, before: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """By how much each cable gets longer for each target, over the range, and how long that takes [s], (target,
    actuated) each."""
    goals = np.array(targets)
    first = np.ones(goals.shape[1]) if before is None else before
    longer = np.diff(np.vstack([first, goals]), axis=0)
    return longer, np.abs(longer) * wide / max(speed, 1e-6)


def _ends(needs: np.ndarray) -> np.ndarray:
    return np.asarray(np.cumsum(needs.max(axis=1) + SETTLE_S))


def part(whole: Stretch, a: int, b: int) -> Stretch:
    """Frames a to b of an imagined policy, after the one before them; the state is still that of its beginning."""
    window = whole.window
    frames = window.frames[a:b]
    return replace(
        whole, caps=whole.caps[a:b], noise=whole.noise[a:b],
        length=None if whole.length is None else whole.length[a:b],
        length_sd=None if whole.length_sd is None else whole.length_sd[a:b],
        window=replace(
            window, first=int(frames[0]) - 1, frames=frames, key=window.key[a:b], place=window.place[a:b]
        ),
    )  # fmt: skip


def ends(arena: Arena, whole: Stretch, like: Stretch, targets: Targets) -> list[int]:
    """Frames of a policy that was imagined from where `like` begins, before which its targets end, 0 first."""
    at = target_ends(targets, arena.model.robot.pid.range_m, speed_of(arena.model), before=_before(like))
    return [0, *np.searchsorted(whole.t - whole.window.start, at + 1e-9, side="right").tolist()]


def speed_of(model: Model) -> float:
    """Of the winches at full drive, as robot.toml has it [m/s]."""
    return float(model.theta(model.values0).speed_in.mean())
