"""What one identification is asked for, and what it says on the way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.identify.data import Selection

Method = Literal["default", "paper", "cma"]
Drive = Literal["command replay", "closed loop"]


@dataclass(frozen=True)
class Request:
    """The request of one command line.

    train, test: target intervals by run, complete and disjoint; test may be empty. free: what is free, as after --free;
    empty: the default set of the method. fixed: values by parameter, in its unit, not fitted. effects: ids of the
    catalogue that are in the simulator. of_effects: what is free of them unless `free` or `fixed` names it, as after
    --free. before: the identification to continue from (online), or None. discrepancy: whether what the simulator
    leaves behind in training intervals and the robot repeats may be added to the prediction of test intervals.
    left_out: what is to be said of runs that nobody named and that are not used.
    """

    train: tuple[Selection, ...]
    test: tuple[Selection, ...] = ()
    free: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[str, ...] = ()
    of_effects: tuple[str, ...] = ()
    method: Method = "default"
    drive: Drive = "command replay"
    seed: int = 0
    online: bool = False
    before: ArtifactData | None = None
    discrepancy: bool = True
    left_out: tuple[str, ...] = ()


PERCENT = 100


@dataclass(frozen=True)
class Step:
    """A word on the way: `done` of `total` steps of one part (`fit`, `starts`, `ranges` ...) and the cost now."""

    part: str
    done: int
    total: int
    cost: float | None = None

    @classmethod
    def share(cls, part: str, done: float, cost: float | None = None) -> Step:
        """Of a part that has no items: `done`, 0 to 1, in percent."""
        return cls(part, int(PERCENT * done), PERCENT, cost)


Progress = Callable[[Step], None]


def silent(step: Step) -> None:
    """No progress."""
