"""The sample project: small, whole, of every kind; and each stage gives again what is stored in it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from schemas.results import StatusResult
from schemas.results_compare import CompareReport
from schemas.versions import KINDS
from tests.commands.conftest import invoke
from tests.examples.load import load
from tests.guards.listing import ROOT
from tests.support import builders
from tests.support.soak import drawn

SAMPLE = ROOT / "examples" / "sample-project" / "project"
SETTLED = ("was absent", "changed: made by version", "is stale itself", "cannot be made again here")
"""Why a part of it may be stale: r2s2r has got a setting or a stage a version since it was made."""
again = load("sample-project", "again")
COMPUTED = {"calibrate", "floor", "estimate", "identify", "plan", "compare", "diagnose", "simulate"}
"""The stages of it that are no measurements."""


@pytest.fixture
def sample(tmp_path: Path) -> Path:
    """A copy to work on."""
    return Path(shutil.copytree(SAMPLE, tmp_path / "project"))


def test_it_is_small_and_holds_every_kind() -> None:
    """Below 15 MB, two iterations, every kind of artifact; pictures of one run only."""
    paths = Project.find(SAMPLE).artifacts()
    headers = {path: read_header(path) for path in paths}
    assert sum(path.stat().st_size for path in SAMPLE.rglob("*")) < 15_000_000
    assert {header.kind for header in headers.values()} == set(KINDS)
    assert len(Project.find(SAMPLE).iterations()) == 2
    seen = [(path, name) for path, header in headers.items() for name in header.datasets if "/camera/depth" in name]
    assert len({(path, name.split("/")[1]) for path, name in seen}) == 1


def test_it_validates_and_nothing_is_damaged(sample: Path) -> None:
    """`validate` finds nothing wrong; what `status` calls stale is so because r2s2r went on, not the project."""
    result = invoke("validate", "--project", str(sample))
    assert result.exit_code == 0, result.stdout + result.stderr
    status = StatusResult.model_validate(json.loads(invoke("status", "--project", str(sample), "--json").stdout))
    assert len(status.artifacts) >= 12
    for one in status.artifacts:
        assert one.state in ("fresh", "stale"), one
        assert all(any(word in reason for word in SETTLED) for reason in one.reasons), one


def test_differences_are_seen_and_rounding_is_not() -> None:
    """Half a millimetre is the limit of states; a value that is missing, new or of another type is one."""
    old = builders.estimate()
    group = old.groups["runs/walk/frames"]

    def replaced(frames: Mapping[str, Any]) -> ArtifactData:
        return ArtifactData("estimate", {**old.groups, "runs/walk/frames": Group(frames, group.attributes)})

    def moved(by: float) -> ArtifactData:
        return replaced({**group.datasets, "p_WE": group["p_WE"] + by})

    assert list(again.differences(old, old)) == []
    assert list(again.differences(old, moved(1e-5))) == []
    (said,) = again.differences(old, moved(1e-3))
    assert said == "runs/walk/frames/p_WE: differs by 0.001, allowed 0.0005"
    frames = dict(moved(0.0).groups["runs/walk/frames"].datasets)
    caps = old.groups["runs/walk/frames"]["p_WE"].copy()
    caps[3, 1, 2] = np.nan
    frames["p_WE"] = caps
    assert list(again.differences(old, replaced(frames))) == ["runs/walk/frames/p_WE: other values are missing"]
    del frames["score"]
    frames["mode"] = frames["t"]
    said = list(again.differences(old, replaced(frames)))
    assert "runs/walk/frames/score is gone" in said and "runs/walk/frames/mode is new" in said


def test_every_kind_that_is_computed_has_a_rule_that_names_something() -> None:
    """A pattern that matches nothing would compare nothing."""
    made = {path: (read_header(path), path) for path in Project.find(SAMPLE).artifacts()}
    kinds = {header.kind for header, _ in made.values()} - {"recording", "policy"}
    assert {rule.kind for rule in again.RULES} >= kinds
    from fnmatch import fnmatch

    from r2s2r_cli.store.read import read_artifact

    for kind in kinds:
        names = {
            name for header, path in made.values() if header.kind == kind
            for name, _ in again._values(read_artifact(path)[1])
        }  # fmt: skip
        for rule in (rule for rule in again.RULES if rule.kind == kind):
            assert any(fnmatch(name, rule.what) for name in names), rule


def test_the_second_comparison_holds_both_iterations() -> None:
    """Runs of the first under the simulator that learned from them, marked; new runs from which none did; the floor."""
    made = read_header(SAMPLE / "iterations" / "002" / "60-compare.h5").provenance
    report = CompareReport.model_validate(made.report)
    assert report.iteration == 2
    assert [model.model for model in report.models] == ["initial", "iteration 1", "iteration 2"]
    first, second = ([run for run in report.runs if run.iteration == number] for number in (1, 2))
    assert first and all(run.run.startswith("001-") for run in first)
    assert {run.model for run in first if run.trained_on} == {"iteration 2"}
    assert all(run.trained_on for run in first if run.model == "iteration 2")
    assert second and not any(run.trained_on for run in second)
    assert report.floor.com_end_m is not None and report.models[2].heldout["com_end_m"].gap is not None
    assert [(one.iteration, one.model) for one in report.history] == [
        (number, model.model) for number in (1, 2) for model in report.models
    ]


def test_of_every_stage_the_newest_that_can_be_made_again() -> None:
    """Also where a later one is there whose pictures were taken out; the order is that of the making."""
    project = Project.find(SAMPLE)
    newest = again._newest(project)
    stages = [read_header(path).provenance.stage for path in newest]
    assert len(stages) == len(set(stages)) and set(stages) == COMPUTED | {"record"}
    assert {path.parent.name for path in newest if path.name[:2] in ("30", "40", "60")} == {"002"}
    assert SAMPLE / "iterations" / "001" / "20-estimate.h5" in newest
    assert newest == [path for path in project.artifacts() if path in newest]


@pytest.mark.slow
def test_every_stage_gives_again_what_is_stored() -> None:
    """Each from the stored artifacts before it, within the tolerances; the robot is not moved (`--dry-run`). In CI once
    (the newest of each stage), in a soak test in every iteration."""
    lines: list[str] = []
    newest = drawn(True, False)
    assert again.main(SAMPLE, lines.append, newest=newest) == [], "\n".join(lines)
    done = [line for line in lines if line.endswith(("bit by bit", "within tolerance"))]
    assert len(done) == len(COMPUTED) + (0 if newest else 3), "\n".join(lines)
    for stage in ("record", "execute"):
        assert any(f"r2s2r {stage}" in line and "--dry-run" in line for line in lines)
