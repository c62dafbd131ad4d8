"""What the latest comparison of a project says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.header import whole_header
from r2s2r_cli.store.project import Project

if TYPE_CHECKING:
    from schemas.results_compare import CompareReport


def latest_gap(project: Project) -> CompareReport | None:
    """Of its last iteration that has one; None where there is none that can be read."""
    from pydantic import ValidationError

    from schemas.results_compare import CompareReport

    for place in reversed(project.iterations()):
        path = place.artifact("comparison")
        if path.exists():
            try:
                return CompareReport.model_validate(whole_header(path).provenance.report)
            except (ArtifactError, ValidationError):
                return None  # damaged: said above; of an older version: nothing is said of it
    return None
