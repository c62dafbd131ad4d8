"""Which runs of an estimate a simulator has learned from, whatever `identify` called them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.commands.compare_inputs import Asked
from r2s2r_cli.store.project import Project


@pytest.mark.parametrize(
    ("of", "trained", "known", "wanted"),
    [
        ("record", {"sample"}, ["sample"], {"sample"}),
        ("record", {"001-sample"}, ["001-sample", "walk"], {"sample"}),
        ("record", {"executed-sample"}, ["sample", "executed-sample"], set()),
        ("execute", {"executed-sample"}, ["sample", "executed-sample"], {"sample"}),
        ("execute", {"sample"}, ["sample", "executed-sample"], set()),
        ("execute", {"sample"}, ["sample"], {"sample"}),
        ("execute", {"executed-001-sample"}, ["001-sample", "executed-001-sample"], {"sample"}),
    ],
)
def test_a_run_is_held_out_only_if_it_was_not_trained_on(
    estimated: Path, of: str, trained: set[str], known: list[str], wanted: set[str]
) -> None:
    """Names of other iterations and of executed runs carry a prefix there."""
    project = Project.find(estimated)
    folder = estimated / "iterations" / "001"
    (folder / "51-estimate.h5").write_bytes((folder / "20-estimate.h5").read_bytes())
    asked = Asked(project, project.iteration(1), (), of)
    segments = Group({"run": np.array([name.encode() for name in known])})
    assert asked._own(trained, segments) == wanted
