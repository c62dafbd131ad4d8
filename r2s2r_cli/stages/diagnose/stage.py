"""The stage: evidence -> the groups of 70-diagnose.h5 and the report; with a checkpoint after every part."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.diagnose.diagnose import Checkpoint, Settings, diagnose
from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.groups import diagnosis_groups
from r2s2r_cli.stages.diagnose.next_gait import GaitLibrary
from r2s2r_cli.stages.diagnose.report import diagnose_report
from schemas.config import DiagnoseSettings
from schemas.results_diagnose import DiagnoseReport


def diagnosed(
    evidence: Evidence, settings: DiagnoseSettings, *, seed: int = 0, effects: tuple[str, ...] | None = None,
    library: GaitLibrary | None = None, cache_dir: Path | None = None, progress: Callable[[str, int, int], None],
    checkpoint: Checkpoint | None = None,
) -> tuple[ArtifactData, DiagnoseReport]:  # fmt: skip
    """Diagnose, and lay out what was found. Raises as `diagnose`."""
    how = Settings(
        effects=effects, step=settings.step_s, members=settings.members, seed=seed, library=library or GaitLibrary()
    )
    found = diagnose(evidence, how, progress, cache_dir=cache_dir, checkpoint=checkpoint)
    report = diagnose_report(found)
    return ArtifactData("diagnosis", diagnosis_groups(found, evidence.robot)), report


def library_of(policies: Mapping[str, Sequence[Sequence[float]]]) -> GaitLibrary:
    """Policies by name as a library."""
    return GaitLibrary({
        name: tuple(tuple(float(x) for x in row) for row in targets) for name, targets in policies.items()
    })  # fmt: skip
