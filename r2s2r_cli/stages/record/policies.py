"""What to record: random policies, and named excitation sets that show one property of the robot each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.simulate.policies import RANDOM_MAX, random_policy
from schemas.policy import PolicyFile
from schemas.robot import Robot

LEVELS = (2, 21)
"""Fewest and most different targets of a cable; 21 are steps of a twentieth, less than half a tolerance."""
_HOLD_S = 5.0
"""A stretched tendon has relaxed most of the way by then."""
_RAMP = (0.75, 0.5, 0.25, 0.0, 0.25, 0.5, 0.75, 1.0)
_REVERSAL = (0.3, 0.7) * 3
_REPEATS = 5

Step = tuple[Sequence[float], float]
"""Target and hold [s]."""


def random_targets(robot: Robot, steps: int, seed: int, *, levels: int = 2) -> PolicyFile:
    """`steps` random target shapes, each another one than the one before.

    levels: equally spaced targets a cable can have; 2 is the paper's binary policy. Raises UsageError.
    """
    if levels == 2:
        return random_policy(robot, steps, seed)
    if not LEVELS[0] <= levels <= LEVELS[1] or not 1 <= steps <= RANDOM_MAX:
        raise UsageError(
            "this is no random policy", where="--random, --levels", received=f"{steps} targets, {levels} levels",
            expected=f"1 to {RANDOM_MAX} targets, {LEVELS[0]} to {LEVELS[1]} levels",
            hint="r2s2r record --random 15 --levels 5 --port /dev/ttyUSB0",
        )  # fmt: skip
    generator = np.random.default_rng(seed)
    before = np.ones(len(robot.actuated))
    shapes: list[Step] = []
    while len(shapes) < steps:
        shape = generator.integers(0, levels, len(before)) / (levels - 1)
        if (shape != before).any():
            shapes.append((shape.tolist(), 0.0))
            before = shape
    return _policy(robot, f"graded-{seed}", f"{steps} random target shapes of {levels} levels, seed {seed}", shapes)


def excitation(robot: Robot, name: str) -> tuple[PolicyFile, ...]:
    """The policies of a named set. Raises UsageError for an unknown name."""
    if name == "commission":
        return tuple(make(robot) for make in EXCITATIONS.values())
    if name not in EXCITATIONS:
        raise UsageError(
            f"there is no excitation set {name}", where="--excite", received=name,
            expected=", ".join((*EXCITATIONS, "commission")),
            hint="r2s2r record --excite commission --port /dev/ttyUSB0",
        )  # fmt: skip
    return (EXCITATIONS[name](robot),)


def ramps(robot: Robot) -> PolicyFile:
    """One cable after the other in steps to short and back: motor speeds, stiffness, gain of each sensor."""
    shapes = [(_one(robot, k, level), 0.0) for k in range(_motors(robot)) for level in _RAMP]
    return _policy(robot, "ramps", "each cable alone to short and back in quarters", shapes)


def holds(robot: Robot) -> PolicyFile:
    """One cable after the other held short: relaxation, drift of the sensors at rest."""
    shapes = [(_one(robot, k, level), _HOLD_S) for k in range(_motors(robot)) for level in (0.0, 1.0)]
    return _policy(robot, "holds", f"each cable alone held short and long for {_HOLD_S:g} s", shapes)


def reversals(robot: Robot) -> PolicyFile:
    """One cable after the other back and forth about its middle: backlash, hysteresis, dead zone."""
    shapes = [(_one(robot, k, level), 0.0) for k in range(_motors(robot)) for level in (*_REVERSAL, 1.0)]
    return _policy(robot, "reversals", "each cable alone back and forth about its middle, three times", shapes)


def repeats(robot: Robot) -> PolicyFile:
    """Every second cable short, then all long, again and again: how far the robot repeats itself."""
    n = _motors(robot)
    shape = [float(k % 2) for k in range(n)]
    shapes = [(target, 1.0) for _ in range(_REPEATS) for target in (shape, [1.0] * n)]
    return _policy(robot, "repeats", f"one shape and back, {_REPEATS} times", shapes)


EXCITATIONS: dict[str, Callable[[Robot], PolicyFile]] = {
    "ramps": ramps, "holds": holds, "reversals": reversals, "repeats": repeats,
}  # fmt: skip
"""By name; `commission` is all of them."""


def _motors(robot: Robot) -> int:
    return len(robot.actuated)


def _one(robot: Robot, cable: int, level: float) -> list[float]:
    """One cable at `level`, the others long."""
    target = [1.0] * _motors(robot)
    target[cable] = level
    return target


def _policy(robot: Robot, name: str, description: str, shapes: Sequence[Step]) -> PolicyFile:
    steps: list[dict[str, Any]] = [{"target": tuple(target), "hold_s": hold} for target, hold in shapes]
    head = {"schema_version": 1, "robot": robot.name, "name": name, "description": description}
    return PolicyFile.model_validate({**head, "steps": steps})
