"""The stage: evidence -> the groups of 70-diagnose.h5 and the report; with a checkpoint after every part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.checkpoint import Answers
from r2s2r_cli.stages.diagnose.diagnose import Settings, diagnose
from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.groups import diagnosis_groups
from r2s2r_cli.stages.diagnose.next_gait import GaitLibrary
from r2s2r_cli.stages.diagnose.report import diagnose_report
from r2s2r_cli.stages.record.policies import EXCITATIONS, random_targets
from schemas.config import DiagnoseSettings
from schemas.results_diagnose import DiagnoseReport
from schemas.robot import Robot

RANDOM_GAITS, RANDOM_STEPS = 8, 8
"""Random policies in the library, and their targets."""


def diagnosed(
    evidence: Evidence, settings: DiagnoseSettings, *, seed: int = 0, effects: tuple[str, ...] | None = None,
    policies: Mapping[str, Sequence[Sequence[float]]] | None = None, cache_dir: Path | None = None,
    progress: Callable[[str, int, int], None], checkpoint: Answers | None = None,
) -> tuple[ArtifactData, DiagnoseReport]:  # fmt: skip
    """Diagnose, and lay out what was found. policies: more to choose the next gait from. Raises as `diagnose`."""
    how = Settings(
        effects=effects,
        step=settings.step_s,
        members=settings.members,
        seed=seed,
        library=library_of(evidence.robot, policies),
    )
    found = diagnose(evidence, how, progress, cache_dir=cache_dir, checkpoint=checkpoint)
    report = diagnose_report(found)
    report = report.model_copy(update={"missing": (*evidence.missing, *report.missing)})
    return ArtifactData("diagnosis", diagnosis_groups(found, evidence.robot)), report


def library_of(robot: Robot, policies: Mapping[str, Sequence[Sequence[float]]] | None = None) -> GaitLibrary:
    """The excitations of `record`, some random gaits, and the policies that are given (of a plan), by name."""
    own = [make(robot) for make in EXCITATIONS.values()]
    own += [random_targets(robot, RANDOM_STEPS, seed) for seed in range(1, RANDOM_GAITS + 1)]
    found = {one.name: tuple(tuple(float(x) for x in step.target) for step in one.steps) for one in own}
    for name, targets in (policies or {}).items():
        found[name] = tuple(tuple(float(x) for x in row) for row in targets)
    return GaitLibrary(found)
