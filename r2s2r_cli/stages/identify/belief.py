"""What the filter of the start states believes of itself: how wrong simulator, tracker and first pose may be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Spread:
    """Sd of what is added to a member's state: position [m] of a rod, per axis; tilt and roll [rad], across a rod and
    about it; rest length of a winched cable [m]."""

    position: float = 0.0
    tilt: float = 0.0
    roll: float = 0.0
    rest: float = 0.0


@dataclass(frozen=True)
class Filter:
    """What the filter believes of its parts.

    members: how many; seed: of all that is drawn. noise: least sd of an observed coordinate [m]; persistence: how long
    errors of a tracker last [s]; frames closer than that say less than they would alone. dof: of the Student t of an
    observed cap. speed, friction: relative sd of a motor's rates and of a cap's friction from member to member, drawn
    again at every interval. first: of the first state, about the robot at rest in the observed pose; drift: after 1 s
    of simulation, growing as a random walk does; interval: added at every start.
    """

    members: int = 64
    seed: int = 0
    noise: float = 3e-3
    persistence: float = 0.5
    dof: float = 4.0
    speed: float = 0.05
    friction: float = 0.15
    first: Spread = Spread(position=6e-3, tilt=0.03, roll=0.15, rest=6e-3)
    drift: Spread = Spread(position=2.8e-3, tilt=0.011)
    interval: Spread = Spread(roll=0.01)
