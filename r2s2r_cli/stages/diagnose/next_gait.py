"""What to run next: the gait of a library under which the remaining candidates differ most.

T-optimal (Hunter and Reiner 1965): the largest of the smallest distances between the most probable candidate, as if it
were the truth, and another one, with what that one's nuisances and numbers can make up for taken off. Commands are
those of an ideal controller, the same for all candidates, as in the replay of a recorded run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.next_apart import apart
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.stretches import Stretch
from r2s2r_cli.stages.diagnose.which.which import Compared
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from r2s2r_cli.engine import State

Targets = tuple[tuple[float, ...], ...]
SETTLE_S = 0.3
"""After the last cable of a target is there."""
RATE_HZ = 10.0
LONGEST = 8
"""Targets of a policy that are simulated: a longer one goes on as it began."""
REMAINING = 4
"""Candidates that are told apart."""


@dataclass(frozen=True)
class GaitLibrary:
    """Policies that can be suggested: target vectors (step, actuated) by name, as `record` takes them."""

    gaits: dict[str, Targets] = field(default_factory=dict)


@dataclass(frozen=True)
class NextGait:
    """name, targets: the policy. separates: the first candidate with every other one and the nats that it tells them
    apart by. nats: the smallest of these; now: that of the best of the gaits that were run, in the same manner.
    typical: median over the library, which is what a gait taken at random is worth."""

    name: str
    targets: Targets
    separates: tuple[tuple[str, str, float], ...]
    nats: float
    now: float | None
    typical: float


def next_gait(
    evidence: Evidence, compared: Compared, library: GaitLibrary, *, told: Callable[[str, int, int], None]
) -> NextGait | None:
    """None where fewer than two candidates remain, or there is no gait to choose from."""
    fits = _remaining(compared)
    if len(fits) < 2 or not library.gaits:
        return None
    told("next gait", 0, 1)
    own = {f"as run: {run.name}": _targets(run.caps.intervals.target) for run in evidence.only(evidence.fit)}
    names = {**library.gaits, **own}
    found: dict[str, tuple[tuple[str, str, float], ...]] = {}
    for name, targets in names.items():
        pairs = _distances(compared.arena, fits, targets[:LONGEST])
        if pairs:
            found[name] = pairs
    told("next gait", 1, 1)
    fresh = {name: min(nats for _, _, nats in pairs) for name, pairs in found.items() if name in library.gaits}
    if not fresh:
        return None
    best = max(fresh, key=lambda name: fresh[name])
    ran = [min(nats for _, _, nats in found[name]) for name in own if name in found]
    return NextGait(
        best,
        library.gaits[best],
        found[best],
        fresh[best],
        max(ran) if ran else None,
        float(np.median(list(fresh.values()))),
    )


def _remaining(compared: Compared) -> list[Fit]:
    """The best fits of the effects that are still in the 90 % set, at least of two; one a name."""
    wanted = [name for name in compared.which.set90 if name not in ("none", "unknown")]
    ranked = [one.effect for one in compared.which.ranking if one.effect not in ("none", "unknown")]
    names = [*wanted, *(name for name in ranked if name not in wanted)][: max(2, min(len(wanted), REMAINING))]
    found: dict[str, Fit] = {}
    for fit in compared.fits:
        if len(fit.hypothesis.parts) == 1 and fit.hypothesis.effects[0] in names:
            found.setdefault(fit.hypothesis.effects[0], fit)
    return list(found.values())


def _targets(targets: np.ndarray) -> Targets:
    return tuple(tuple(float(x) for x in row) for row in np.nan_to_num(targets, nan=1.0))


def _distances(arena: Arena, fits: Sequence[Fit], targets: Targets) -> tuple[tuple[str, str, float], ...]:
    """Between the first candidate, taken as the truth, and every other one; empty where there is nothing to see."""
    many = _imagined(arena, targets)
    if not many:
        return ()
    first, *others = fits
    found = apart(arena, many[0], first, others)
    return tuple(
        (first.hypothesis.effects[0], other.hypothesis.effects[0], nats)
        for other, nats in zip(others, found, strict=True)
    )


def _imagined(arena: Arena, targets: Targets) -> list[Stretch]:
    """The policy as one stretch from where a fitted run began, its targets driven by an ideal controller."""
    like = arena.many[0]
    robot = arena.model.robot
    state: State = like.window.state
    speed = float(arena.model.theta(arena.model.values0).speed_in.mean())
    control, t = _commands(targets, robot.pid.range_m, speed)
    frames = np.arange(1, int(t[-1] * RATE_HZ) + 1) / RATE_HZ
    if not len(frames):
        return []
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
    return [Stretch("imagined", "imagined", 1, 0, window, caps, noise, length, sd, like.sensors)]


def _commands(targets: Targets, wide: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Motor commands (row, actuated) at times (row,): full speed until each cable is there, from all cables long."""
    before = np.ones(len(targets[0]))
    begin = 0.0
    rows, times = [np.zeros(len(before))], [0.0]
    for target in targets:
        goal = np.array(target)
        need = np.abs(goal - before) * wide / max(speed, 1e-6)
        sign = np.sign(before - goal)  # shorter: reel in, +1
        for at in (0.0, *sorted(set(need[need > 0].tolist()))):
            rows.append(np.where(need > at + 1e-9, sign, 0.0))
            times.append(begin + at)
        begin += float(need.max(initial=0.0)) + SETTLE_S
        before = goal
    return np.array([*rows, np.zeros(len(before))]), np.array([*times, begin])
