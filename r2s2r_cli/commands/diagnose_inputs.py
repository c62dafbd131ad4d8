"""What `diagnose` was asked for: runs of one or several iterations, the identified simulator, the floor."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.commands.diagnose_split import fit_and_judge
from r2s2r_cli.commands.identify_inputs import Asked as IdentifyAsked
from r2s2r_cli.commands.named_runs import Source, estimated, named_runs, nearest_run, require_robot
from r2s2r_cli.commands.outcome import require_input, require_model
from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.store.project import Iteration, Project
from schemas.header import InputRef

if TYPE_CHECKING:
    from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run
    from r2s2r_cli.stages.identified import Identified


CATALOGUE = "catalogue"
"""Word for all effects that are looked for without being named."""


@dataclass(frozen=True)
class Asked:
    """The request of one command line, its texts as typed."""

    project: Project
    iteration: Iteration
    model: Path | None = None
    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    healthy: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    also: tuple[int, ...] = ()
    seed: int = 0

    def flags(self) -> dict[str, Any]:
        """What else than settings and inputs decides the result, for the provenance."""
        return {
            "train": list(self.train), "test": list(self.test), "healthy": list(self.healthy),
            "effects": list(self.effects), "also": list(self.also), "seed": self.seed,
        }  # fmt: skip

    @property
    def named(self) -> tuple[str, ...]:
        """Effects that were named, without the word for the rest."""
        return tuple(name for name in self.effects if name != CATALOGUE)

    @property
    def only(self) -> bool:
        """Whether no others than the named effects are looked for."""
        return bool(self.named) and CATALOGUE not in self.effects

    def considered(self) -> tuple[str, ...] | None:
        """Ids of the effects to choose from; None: the catalogue. Raises InputError as `all_effects`."""
        from r2s2r_cli.stages.effects import effects_looked_for

        if CATALOGUE not in self.effects:
            return self.effects or None
        return tuple(effect.name for effect in effects_looked_for(self.named)) if self.named else None

    def not_weighed(self) -> tuple[str, ...]:
        """What the named effects were not held against, in words: all others, and sets that calibrate what is said."""
        from r2s2r_cli.effects import FURTHER

        found = []
        if self.only:
            only = ", ".join(self.named)
            found.append(f"all other effects: --effect has only {only}; --effect {CATALOGUE} adds the rest")
        if beyond := [effect.name for effect in FURTHER if effect.name in self.named]:
            found.append(f"calibration of {', '.join(beyond)}: probabilities were learned from sets without")
        return tuple(found)

    @property
    def identification(self) -> Path:
        """The nominal simulator."""
        return self.model or self.iteration.artifact("identification")

    @property
    def floor_file(self) -> Path:
        """The floor of the project, there or not."""
        return self.project.artifact("floor", None)

    @property
    def plan_file(self) -> Path:
        """The plan of the iteration, there or not: its policies may be what to run next."""
        return self.iteration.artifact("plan")

    @cached_property
    def sources(self) -> tuple[Source, ...]:
        """Where the runs lie. Raises ArtifactError, UsageError as `identify`."""
        return IdentifyAsked(self.project, self.iteration, also=self.also, command="r2s2r diagnose").sources

    def refs(self) -> list[InputRef]:
        """The inputs. Raises ArtifactError where one is missing or cannot be read."""
        from r2s2r_cli.store.header import whole_header
        from r2s2r_cli.store.staleness import artifact_ref

        known = {} if self.model is None else {self.model: require_model(self.project, self.model, "diagnose")}
        require_input(self.identification, self._identified_first())
        paths = [*self.artifacts(), self.identification, *self.beside()]
        return [artifact_ref(self.project, path, known.get(path) or whole_header(path)) for path in paths]

    def artifacts(self) -> list[Path]:
        """Recordings and estimates that are read, those of the main iteration first."""
        return [path for source in self.sources for path in (source.recording, source.estimate)]

    def beside(self) -> list[Path]:
        """What else is read where it is there."""
        return [path for path in (self.floor_file, self.plan_file) if path.exists()]

    def _identified_first(self) -> str:
        """The command where the iteration has no identification: with that of an earlier one, made of other runs than
        those that are suspected; an identification of the suspected runs alone may take up what is wrong with them."""
        number = self.iteration.number
        earlier = [one for one in self.project.iterations() if one.number < number]
        found = next((one for one in reversed(earlier) if one.artifact("identification").exists()), None)
        if found is None:
            return f"r2s2r identify --iteration {number}"
        if found.number in self.also:
            return f"r2s2r diagnose --model {shlex.quote(os.path.relpath(found.artifact('identification')))}"
        return f"r2s2r diagnose --iteration {found.number}" + f" --also {number}" * bool(estimated(self.iteration))

    def evidence(self, say: Callable[[str], None] | None = None) -> Evidence:
        """What the diagnosis is made from. say: is told where the split is not what it usually is. Raises
        ArtifactError, InputError, UsageError."""
        from r2s2r_cli.stages.diagnose.evidence import Evidence, require_enough
        from r2s2r_cli.stages.identified import identified
        from r2s2r_cli.store.read import read_artifact

        robot = self.project.robot()
        found = read_artifact(self.identification, "identification")[1]
        model = identified(found, robot, words=self.project.relative(self.identification))
        runs = self._runs()
        healthy = tuple(run for run in runs if run.name in self.healthy)
        missing = [name for name in self.healthy if name not in {run.name for run in runs}]
        if missing:
            known = [run.name for run in runs]
            raise UsageError("there is no such run", where="--healthy", received=missing[0],
                             expected=", ".join(known),
                             hint=f"--healthy {nearest_run(missing[0], known)}")  # fmt: skip
        diagnosed = tuple(run for run in runs if run.name not in self.healthy)
        if not diagnosed and healthy:
            raise self._nothing_else(healthy)
        fit, judge = fit_and_judge(diagnosed, found, self.train, self.test, healthy=self.healthy, say=say)
        told = (*_unsaid(model, self.identification), *there_already(model, self.named, self.identification),
                *self.not_weighed())  # fmt: skip
        made = Evidence(robot, model, diagnosed, fit, judge, self._floor(), healthy, told)
        require_enough(made)
        return made

    def policies(self) -> dict[str, list[list[float]]]:
        """Target vectors of the planned policies by name; none where nothing was planned."""
        from r2s2r_cli.store.read import read_artifact

        if not self.plan_file.exists():
            return {}
        groups = read_artifact(self.plan_file, "plan")[1].groups
        own = {path.partition("/")[2]: group for path, group in groups.items() if path.startswith("policies/")}
        return {name: group["target"].tolist() for name, group in own.items() if "target" in group.datasets}

    def _runs(self) -> tuple[Run, ...]:
        """All runs, named as `identify` names them; those of the same targets are repeats of one gait, which bears the
        name of the first."""
        from r2s2r_cli.stages.diagnose.evidence import Run
        from r2s2r_cli.stages.floor.runs import sensed_run
        from r2s2r_cli.stages.identify.load import run_data

        robot = self.project.robot()
        found: list[Run] = []
        gaits: dict[bytes, str] = {}
        for one in named_runs(self.sources):
            require_robot(one.recording, one.run, robot.name)
            caps = run_data(one.recording, one.estimate, one.run, name=one.name, still=True)
            gait = gaits.setdefault(caps.intervals.target.round(6).tobytes(), one.name)
            found.append(Run(caps, sensed_run(one.name, one.recording, one.run, robot), gait=gait))
        return tuple(found)

    def _nothing_else(self, healthy: Sequence[Run]) -> InputError:
        """For runs that are all given as healthy: those of other iterations, or what to record."""
        from r2s2r_cli.reached import ROBOT

        used = {source.place.number for source in self.sources}
        others = [one for one in self.project.iterations() if one.number not in used and estimated(one)]
        free = 1 + max((one.number for one in self.project.iterations()), default=0)
        names = ", ".join(run.name for run in healthy)
        hint = f"r2s2r record --random 15 --repeats 3 --iteration {free} {ROBOT}   # then estimate it, name it here"
        return InputError(
            "there is no run to diagnose: all of them are given as healthy", where="--healthy",
            expected="a run that is not, beside them", received=f"{names} and no other",
            hint=f"r2s2r diagnose --also {others[-1].number}" if others else hint,
        )  # fmt: skip

    def _floor(self) -> FloorGiven | None:
        from r2s2r_cli.stages.diagnose.evidence import FloorGiven
        from r2s2r_cli.store.read import read_artifact

        if not self.floor_file.exists():
            return None
        group = read_artifact(self.floor_file, "floor")[1].groups.get("caps")
        if group is None:
            return None
        told = group.attributes
        return FloorGiven(float(told["floor"]), float(told["sensor"]), f"floor.h5, {told['basis']}")


def _unsaid(model: Identified, path: Path) -> tuple[str, ...]:
    """What the identification does not say, in words."""
    import numpy as np

    unsure = np.isnan(np.diag(model.covariance)) if len(model.values) else np.zeros(0, dtype=bool)
    names = [name for name, yes in zip(model.mapping.names, unsure, strict=True) if yes]
    if not names:
        return ()
    return (f"uncertainty of {', '.join(names)}: {path.name} has none, so the refit takes its usual priors",)


def there_already(model: Identified, named: Collection[str], path: Path) -> tuple[str, ...]:
    """Effects that were named and that the identification has, in words: a diagnosis looks for what it lacks."""
    theta = model.theta
    return tuple(
        f"{effect.name}: {path.name} has it already, so it is not looked for"
        for effect in model.structure.effects
        if effect.name in named
        and any(bool((theta.of(effect.name)[key] != off).any()) for key, off in effect.off(model.structure).items())
    )
