"""Gaits judged over what is not known: the simulator's numbers, its sensors, and the pose that the robot starts from.

The score is mean minus so many standard deviations of the reward over all pairs of drawn numbers and start poses; a
gait that gives a target up, does not come back to rest, or not on its usual triangle, has earned nothing there. A gait
that works in one simulator only loses to one that works in all of them. One that ends here or there, as a tip-over on
the brink does, is not fit for long policies: `Primitive.same_element` says it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.stages.model import cap_distances
from r2s2r_cli.stages.plan.executor import Executor
from r2s2r_cli.stages.plan.gaits import Gait, padded, run_gaits
from r2s2r_cli.stages.plan.placement import Reference, wrapped
from r2s2r_cli.stages.plan.rewards import Outcomes, Reward
from r2s2r_cli.stages.plan.standing import Standing, stacked
from schemas.robot import Robot


@dataclass(frozen=True)
class Primitive:
    """A gait and what it is worth for one behaviour. nominal: reward with the best numbers from the rest pose; mean,
    sd: over all pairs; score: mean - spread x sd; worked: share of the pairs in which it came back to rest.

    move: (3,) shift [m] of the centre of mass over the ground in the frame of the start and turn [rad] of the principal
    axis, means where it worked and ended on its usual triangle; move_sd: (3,) their standard deviations; element: that
    triangle's symmetry; same_element: share of the pairs that worked which ended on it, and not astray; duration: [s].
    """

    name: str
    behaviour: str
    gait: Gait
    nominal: float
    mean: float
    sd: float
    score: float
    worked: float
    move: np.ndarray
    move_sd: np.ndarray
    element: int
    same_element: float
    duration: float


def start_poses(executor: Executor, robot: Robot, starts: int, generator: np.random.Generator) -> Standing:
    """Rested robots, every draw from `starts` poses, draw by draw: the first of all with all cables at their rest
    lengths, the others where the controller leaves them, done within its tolerance, reached from the short side, and
    that by what its sensors read. A sensor that is off moves where a robot starts as well as where it goes."""
    p_WE = np.array(robot.rest_caps_m)
    winched = list(robot.actuated)
    pairs = len(executor) * starts
    draw = np.repeat(np.arange(len(executor)), starts)
    lengths = np.tile(cap_distances(robot), (pairs, 1))
    short = robot.pid.tolerance * robot.pid.range_m * generator.random((pairs, len(winched)))
    lengths[1:, winched] -= (short + executor.bias.numpy()[draw][:, winched])[1:]
    return executor.standing(np.repeat(p_WE[None], pairs, axis=0), draw, lengths)


def arrived(
    executor: Executor, reference: Reference, pairs: Standing, gaits: list[Gait], rest_error_m: float
) -> Standing:
    """The robots of `pairs` after a gait each, in turn: where a gait within a sequence starts. Those that did not come
    back to rest stay where they were."""
    every = [gaits[k % len(gaits)] for k in range(len(pairs))]
    first = reference.place(executor.caps(pairs)).element
    targets = [reference.group.elements[k].relabelled(gait.targets) for k, gait in zip(first, every, strict=True)]
    run = executor.run(pairs, *padded(targets))
    good = run.sound & (reference.place(executor.caps(run.last)).error < rest_error_m)
    return stacked([pairs, run.last]).take(np.where(good, len(pairs), 0) + np.arange(len(pairs)))


def judged(
    executor: Executor, reference: Reference, pairs: Standing, gaits: list[Gait], rows: np.ndarray | None = None
) -> list[tuple[Outcomes, np.ndarray]]:
    """Every gait from every robot of `pairs` (or those rows), all in one call a length: outcomes and whether it came
    back to rest, one entry a gait. Rest is what `Reference.place` finds near the rest pose."""
    which = np.arange(len(pairs)) if rows is None else rows
    every = [gait for gait in gaits for _ in which]
    came, sound = run_gaits(executor, reference, pairs, every, np.tile(which, len(gaits)))
    size = len(which)
    return [
        (came.take(np.arange(k * size, (k + 1) * size)), sound[k * size : (k + 1) * size]) for k in range(len(gaits))
    ]


def steady(came: Outcomes, good: np.ndarray) -> tuple[int, np.ndarray]:
    """The symmetry that the gait mostly ends with, and where it came back to rest so, (B,)."""
    usual = int(np.bincount(came.element[good] if good.any() else came.element[:1]).argmax())
    return usual, good & (came.element == usual)


STRAY_M, STRAY_RAD, STRAY_SHARE = 0.04, float(np.radians(10.0)), 0.2
"""An end farther from the median of all ends than this, and this share of the way or turn: it tipped another way."""


def usual_ends(moves: np.ndarray) -> np.ndarray:
    """Which of the moves (B, 3), shift [m] and turn [rad], end where most do, (B,)."""
    middle = np.median(moves[:, :2], axis=0)
    far = np.linalg.norm(moves[:, :2] - middle, axis=1)
    # The median of angles is that of their differences from a direction among them.
    among = _direction(moves[:, 2])
    turn = wrapped(moves[:, 2] - among)
    usual = float(np.median(turn))
    most_m = STRAY_M + STRAY_SHARE * np.linalg.norm(middle)
    most_rad = STRAY_RAD + STRAY_SHARE * abs(float(wrapped(np.array(among + usual))))
    return np.asarray((far <= most_m) & (np.abs(turn - usual) <= most_rad))


def _direction(turn: np.ndarray) -> float:
    """The one that angles (B,) [rad] lie about."""
    return float(np.angle(np.exp(1j * turn).sum()))


def together(moves: np.ndarray) -> np.ndarray:
    """Moves (B, 3) with turns less than half a turn from the one that they lie about: of 179 and -179 degrees the mean
    is 180, not 0. Whole turns alone are added, so that others keep their numbers to the bit."""
    whole = 2 * np.pi * np.round((_direction(moves[:, 2]) - moves[:, 2]) / (2 * np.pi))
    return np.column_stack([moves[:, :2], moves[:, 2] + whole])


def earned(reward: Reward, came: Outcomes, good: np.ndarray) -> np.ndarray:
    """Rewards (B,), 0 where the gait did not come back to rest, or on another triangle than it mostly does: what
    follows it would then go astray. Turns of 179 and -179 degrees are rewarded as 179 and 181: they are nearly one."""
    _, good = steady(came, good)
    value = np.zeros(len(came))
    if good.any():
        of = came.take(np.flatnonzero(good))
        moves = np.column_stack([of.com[:, :2], of.turn])
        usual = usual_ends(moves)  # of ends all over the place there is no turn that they lie about
        moves[usual] = together(moves[usual])
        value[good] = reward(replace(of, turn=moves[:, 2]))
    return value


def primitive(
    name: str, behaviour: str, reward: Reward, gait: Gait, came: Outcomes, good: np.ndarray, *, spread: float
) -> Primitive:
    """What a gait is worth, of its outcomes over all pairs; the first pair is the best numbers from the rest pose."""
    value = earned(reward, came, good)
    mean, sd = float(value.mean()), float(value.std())
    usual, of = steady(came, good)
    every = np.column_stack([came.com[:, :2], came.turn])
    of[of] = usual_ends(every[of])
    rows = np.flatnonzero(of) if of.any() else np.arange(1)
    shown, moves = came.take(rows), together(every[rows])
    move = moves.mean(axis=0)
    move[2] = move[2] if abs(move[2]) <= np.pi else wrapped(move[2])
    same = float(of.sum() / good.sum()) if good.any() else 0.0
    return Primitive(
        name, behaviour, gait, float(value[0]), mean, sd, mean - spread * sd, float(good.mean()), move,
        moves.std(axis=0), usual, same, float(shown.duration.mean()),
    )  # fmt: skip
