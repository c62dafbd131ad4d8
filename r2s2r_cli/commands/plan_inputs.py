"""What `plan` was asked for: the identification, behaviours and goals; as inputs, flags and a request."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import UsageError
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.stages.plan.belief import Belief
    from r2s2r_cli.stages.plan.goal import Goal
    from r2s2r_cli.stages.plan.stage import Request
    from schemas.config import PlanSettings


@dataclass(frozen=True)
class Asked:
    """The request of one command line, its texts as typed."""

    project: Project
    iteration: Iteration
    behaviours: tuple[str, ...]
    to: tuple[str, ...]
    seed: int
    reach_m: float = 0.0

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        return {"behaviours": list(self.behaviours), "to": list(self.to), "seed": self.seed}

    @cached_property
    def identified(self) -> Path | None:
        """The identification of the iteration; None where there is none."""
        path = self.iteration.artifact("identification")
        return path if path.exists() else None

    def refs(self) -> list[InputRef]:
        """The inputs. Raises ArtifactError where one cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref, source_ref

        found = [artifact_ref(self.project, path, whole_header(path)) for path in self.artifacts()]
        return found + [source_ref(self.project, path) for path in self.written]

    def artifacts(self) -> list[Path]:
        """The artifacts that are read, of those that are there."""
        return [path for path in (self.identified, self.seen) if path is not None]

    @cached_property
    def written(self) -> list[Path]:
        """Files of the project in which rewards of its own are written. Raises UsageError as `reward_named`."""
        from r2s2r_cli.stages.plan.rewards import source_of

        with _importable(self.project.root):
            files = dict.fromkeys(path for name in self.behaviours if (path := source_of(name)) is not None)
        return [path for path in files if path.resolve().is_relative_to(self.project.root.resolve())]

    @cached_property
    def seen(self) -> Path | None:
        """The latest estimate, whose camera says how far the robot may go; None where there is none, or where
        plan.reach_m says it."""
        if self.reach_m > 0:
            return None
        return last_estimate(self.project, self.iteration)

    def reach(self) -> float:
        """How far long policies may go [m]. Raises ArtifactError."""
        from r2s2r_cli.stages.plan.view import reach_seen
        from r2s2r_cli.store.read import read_artifact

        if self.seen is None:
            return self.reach_m or math.inf
        found = reach_seen(read_artifact(self.seen, "estimate")[1], self.project.robot())
        return math.inf if found is None else found

    def check(self, settings: PlanSettings) -> None:
        """Find what is wrong with the request before any work. Raises UsageError, InputError, ArtifactError."""
        from r2s2r_cli.stages.plan.rewards import try_out
        from r2s2r_cli.stages.ticks import whole_steps

        whole_steps(self.project.robot(), settings.step_s, "plan.step_s")
        for reward in self.request(settings).rewards.values():
            try_out(reward)

    def request(self, settings: PlanSettings) -> Request:
        """The request. Raises UsageError for behaviours and goals that cannot be read, InputError for an
        identification of another robot."""
        from r2s2r_cli.stages.plan.choose import short_names
        from r2s2r_cli.stages.plan.rewards import BEHAVIOURS, reward_named
        from r2s2r_cli.stages.plan.stage import Request

        names = dict.fromkeys(self.behaviours or BEHAVIOURS)
        with _importable(self.project.root):
            rewards = {name: reward_named(name) for name in names}
        called = short_names(names)  # a name that no gait can have is said now, not after the search
        self._apart(called)
        goals = {_goal_name(k, len(self.to)): self._goal(text, settings) for k, text in enumerate(self.to)}
        return Request(self.belief(), rewards, goals, self.seed, self.reach())

    def _apart(self, called: Mapping[str, str]) -> None:
        """Raises UsageError where gaits of a behaviour, numbered, would be called as the ways to several goals are."""
        ways = {_goal_name(k, len(self.to)) for k in range(len(self.to))}
        for behaviour, name in called.items():
            if f"{name}-1" in ways:
                raise UsageError(
                    "its gaits would be called as the ways to the goals", where=f"--behaviour {behaviour}",
                    expected="another name of the function, or a single --to", received=", ".join(sorted(ways)),
                    hint=f"--behaviour forward --to {self.to[0]}",
                )  # fmt: skip

    def belief(self) -> Belief:
        """The simulator's numbers. Raises InputError where they are those of another robot, or of robot.toml as it was
        before it was changed."""
        from r2s2r_cli.commands.numbers import read_numbers
        from r2s2r_cli.stages.plan.belief import assumed, identified

        robot = self.project.robot()
        if self.identified is None:
            return assumed(robot)
        return identified(robot, read_numbers(self.project, self.identified), self.project.relative(self.identified))

    def _goal(self, text: str, settings: PlanSettings) -> Goal:
        from r2s2r_cli.stages.plan.goal import Goal

        try:
            x, y, heading = (float(part) for part in text.split(","))
            if not (math.hypot(x, y) <= FARTHEST_M and abs(heading) <= MOST_TURNED_DEG):  # NaN is not, either
                raise ValueError
        except ValueError as error:
            raise UsageError("this is no place to go to", where="--to",
                             expected=f"X,Y,HEADING: metres, {FARTHEST_M:g} m away at most, and degrees",
                             received=text, hint="--to 0.5,1,90") from error  # fmt: skip
        return Goal((x, y), math.radians(heading), settings.goal_within_m, math.radians(settings.goal_within_deg),
                    text)  # fmt: skip


@contextmanager
def _importable(root: Path) -> Iterator[None]:
    """Modules beside project.toml can be imported, whatever else may be."""
    sys.path.insert(0, str(root))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(str(root))


FARTHEST_M, MOST_TURNED_DEG = 1000.0, 36000.0
"""Of a goal: beyond any way of a crawling robot, it is a slip of the keyboard."""


def last_estimate(project: Project, iteration: Iteration) -> Path | None:
    """The recorded runs' states of the iteration, or the latest before it; executed ones come after recorded ones."""
    places = [one for one in project.iterations() if one.number <= iteration.number]
    for place in reversed(places):
        # Those of its own plan come after the plan.
        kinds = (False,) if place.number == iteration.number else (True, False)
        for executed in kinds:
            path = place.artifact("estimate", executed=executed)
            if path.exists():
                return path
    return None


def _goal_name(number: int, of: int) -> str:
    """Name of the policy that goes there."""
    return "to" if of == 1 else f"to-{number + 1}"
