"""What `execute` takes of a plan by itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.commands.execute import _long
from r2s2r_cli.stages.plan.view import far
from r2s2r_cli.store.write import write_artifact
from tests.support import builders


def test_the_long_policies_are_the_default(tmp_path: Path) -> None:
    """Not all 44; of a plan without any the best gait of every behaviour."""
    data = builders.plan()
    path = tmp_path / "40-plan.h5"
    write_artifact(path, data, builders.provenance(stage="plan"))
    assert _long(path) == ["straight"]
    write_artifact(path, ArtifactData("plan", {k: v for k, v in data.groups.items() if k != "long"}),
                   builders.provenance(stage="plan"))  # fmt: skip
    assert _long(path) == ["forward-1"]


def test_how_far_a_run_goes_is_its_farthest_place() -> None:
    """There and back counts the way out, whatever the end."""
    p = np.zeros((3, 2, 3))
    p[1, :, 0] = [0.5, 0.7]
    assert far(ArtifactData("simulation", {"runs/a/frames": Group({"p_WE": p}), "runs/b": Group()})) == {"a": 0.6}
