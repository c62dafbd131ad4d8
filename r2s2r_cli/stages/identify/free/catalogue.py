"""Which numbers of a robot, its ground, its observation and the effects can be free, by name."""

from __future__ import annotations

from collections.abc import Sequence

from r2s2r_cli.errors import UsageError
from r2s2r_cli.nearest import nearest
from r2s2r_cli.stages.effects import effect_of
from r2s2r_cli.stages.identify.free.base import Free
from r2s2r_cli.stages.identify.free.entry import Entry
from r2s2r_cli.stages.identify.free.mechanics import cable_entries, motor_entries, rod_entries
from r2s2r_cli.stages.identify.free.surroundings import (
    effect_entries,
    ground_entries,
    observation_entries,
    pid_entries,
)
from schemas.robot import Robot


def catalogue(robot: Robot, effects: tuple[str, ...] = ()) -> dict[str, Free]:
    """Every number that can be free, by name, in the order of docs/reference/free-parameters.md.

    Those of all effects are there; effects: ids that are in the simulator anyway. Raises UsageError for an unknown id.
    """
    require_effects(effects)
    return {name: entry.free for name, entry in entries(robot).items()}


def entries(robot: Robot) -> dict[str, Entry]:
    """The catalogue with what each number does."""
    return {**own_entries(robot), **{entry.free.name: entry for entry in effect_entries(robot)}}


def own_entries(robot: Robot) -> dict[str, Entry]:
    """The catalogue without the effects; without torch."""
    found = motor_entries(robot) + cable_entries(robot) + rod_entries(robot) + ground_entries(robot)
    found += observation_entries() + pid_entries(robot)
    return {entry.free.name: entry for entry in found}


def require_effects(effects: Sequence[str]) -> None:
    """Raises UsageError for an effect that is not in the catalogue of effects."""
    for name in effects:
        effect_of(name, where="--with-effect", command="r2s2r identify --with-effect")


def unknown(name: str, known: Sequence[str], option: str = "--free") -> UsageError:
    """The error for a name that the catalogue lacks, with the one that is near to it, where one is."""
    known = tuple(dict.fromkeys(known))
    near = nearest(name, known)
    value = "=0.5" if option == "--fix" else ""
    return UsageError(
        f"unknown parameter {name!r}", where=option,
        expected=f"{near or 'one'} of the {len(known)} names in docs/reference/free-parameters.md", received=name,
        hint=f"r2s2r identify {option} {near}{value}" if near else
        "r2s2r identify --help   # docs/reference/free-parameters.md lists the names",
    )  # fmt: skip
