"""Every artifact kind, its current version, and the chain of migrations that leads there.

Versions count from the first release. Raising one: `docs/how-to-extend.md`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from schemas.base import ArtifactSpec
from schemas.calibration import CALIBRATION
from schemas.compare import COMPARISON
from schemas.diagnosis import DIAGNOSIS
from schemas.estimate import ESTIMATE
from schemas.floor import FLOOR
from schemas.identification import IDENTIFICATION
from schemas.plan import PLAN
from schemas.policy import POLICY
from schemas.recording import RECORDING
from schemas.simulation import SIMULATION

KINDS: dict[str, ArtifactSpec] = {
    spec.kind: spec
    for spec in (
        CALIBRATION,
        RECORDING,
        ESTIMATE,
        IDENTIFICATION,
        PLAN,
        POLICY,
        SIMULATION,
        COMPARISON,
        FLOOR,
        DIAGNOSIS,
    )
}
"""The artifact kinds by name, in the order of the data."""

Groups = Mapping[str, Any]
Migration = Callable[[Groups], Groups]
"""A pure step from one version to the next: groups by path in, groups by path out."""

MIGRATIONS: dict[tuple[str, int], Migration] = {}
"""(kind, version it starts from) -> step. Empty until a version above 1 is released."""


class NoMigration(Exception):
    """There is no chain of steps from this version to the current one."""


def chain(
    kind: str,
    version: int,
    *,
    kinds: Mapping[str, ArtifactSpec] = KINDS,
    migrations: Mapping[tuple[str, int], Migration] = MIGRATIONS,
) -> list[tuple[int, Migration]]:
    """The steps from `version` of `kind` to the current version, each with the version it starts from.

    Empty where nothing is to be done. Raises NoMigration for a newer version, or where a step is missing.
    """
    current = kinds[kind].version
    if version > current:
        raise NoMigration(f"version {version} is newer than {current}, the newest this r2s2r knows")
    steps = []
    for start in range(version, current):
        step = migrations.get((kind, start))
        if step is None:
            raise NoMigration(f"no step from version {start} to {start + 1} of kind {kind}")
        steps.append((start, step))
    return steps


STAGE_VERSIONS: dict[str, int] = {
    "import": 1, "calibrate": 1, "record": 1, "estimate": 2, "identify": 5, "simulate": 1, "floor": 4,
    "plan": 4, "execute": 1,
    "compare": 6, "diagnose": 23,
}  # fmt: skip
"""Raised by hand when a stage computes something else from the same input; `status` then calls its results stale."""
