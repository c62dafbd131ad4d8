"""`status` tells how the gap to the robot went, from the latest comparison; and lives with one that says nothing."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from r2s2r_cli.commands.next_command import explained, forward
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.staleness import artifact_ref
from r2s2r_cli.store.write import write_artifact
from schemas.results_compare import CompareFloor, CompareHistory, CompareMeasure, CompareReport
from tests.commands.conftest import document, invoke
from tests.support import builders

NO_FLOOR = CompareFloor(com_end_m=None, heading_end_rad=None, segment_s=None, keyframe_cap_m=None)


def measure(rms: float) -> CompareMeasure:
    """An error of the end beside a floor of 10 mm."""
    return CompareMeasure(
        rms=rms, lower=None, upper=None, floor=0.01, gap=(rms**2 - 1e-4) ** 0.5, change=None, change_lower=None,
        change_upper=None, runs=2,
    )  # fmt: skip


def write(project: Path, number: int, **errors: float) -> None:
    """60-compare.h5 of an iteration: one error a simulator, over its own runs."""
    folder = project / "iterations" / f"{number:03d}"
    folder.mkdir(exist_ok=True)
    history = [
        CompareHistory(iteration=number, model=model, trained_on=False, runs={"com_end_m": measure(rms)})
        for model, rms in errors.items()
    ]
    report = CompareReport(
        iteration=number, runs=(), models=(), policies=(), history=tuple(history), repeatability=(), floor=NO_FLOOR
    )
    made = builders.provenance(stage="compare", inputs=(), report=report.model_dump(mode="json"))
    write_artifact(folder / "60-compare.h5", builders.comparison(), made)


def test_the_latest_comparison_is_told(project: Path) -> None:
    """Its simulators with their errors, in the table and in the document; that of an earlier iteration is not."""
    write(project, 1, initial=0.333)
    write(project, 2, initial=0.160, refined=0.030)
    shown = invoke("status")
    assert shown.exit_code == 0, shown.stderr
    assert "160" in shown.stdout + shown.stderr
    assert "333" not in shown.stdout + shown.stderr
    told = document("status")["history"]
    assert [(one["model"], one["runs"]["com_end_m"]["rms"]) for one in told] == [("initial", 0.16), ("refined", 0.03)]


@pytest.mark.parametrize("broken", [True, False])
def test_without_a_report_nothing_is_told(project: Path, broken: bool) -> None:
    """No comparison, or one that is damaged: the rest of the survey stands."""
    if broken:
        write(project, 1, initial=0.333, refined=0.1)
        path = project / "iterations" / "001" / "60-compare.h5"
        path.write_bytes(path.read_bytes()[:300])
    assert document("status")["history"] == []


@pytest.mark.parametrize(
    ("stage", "hint"),
    [("record", "r2s2r execute --iteration 1 --dry-run"), ("import", "r2s2r compare --iteration 1")],
)
def test_a_plan_is_executed_where_there_is_a_robot(tmp_path: Path, stage: str, hint: str) -> None:
    """After the plan its execution is proposed, in a project whose runs came from a robot; simulators are compared on
    the runs of a log, which cannot be asked for more."""
    project = _planned(tmp_path, stage)
    assert forward(project) == hint  # type: ignore[arg-type]


def test_a_log_is_compared_once(tmp_path: Path) -> None:
    """Then there is nothing left that leads to the next iteration."""
    project = _planned(tmp_path, "import")
    made = builders.provenance(stage="compare", inputs=())
    write_artifact(project.iterations()[0].artifact("comparison"), builders.comparison(), made)
    assert forward(project) == ""  # type: ignore[arg-type]


def test_what_is_left_to_do_is_a_diagnosis(tmp_path: Path) -> None:
    """Of an iteration that has a simulator, until it is made."""
    project = _planned(tmp_path, "import")
    assert explained(project) == "r2s2r diagnose --iteration 1"  # type: ignore[arg-type]
    project.iterations()[0].artifact("diagnosis").write_bytes(b"made")
    assert explained(project) == ""  # type: ignore[arg-type]
    project.iterations()[0].artifact("diagnosis").unlink()
    project.iterations()[0].artifact("identification").unlink()
    assert explained(project) == ""  # type: ignore[arg-type]


def test_a_floor_of_stale_states_is_stale(estimated: Path) -> None:
    """It stands above the states that it was made of, and its staleness goes on to what was compared beside it."""
    here = Project.find(estimated)
    states = estimated / "iterations" / "001" / "20-estimate.h5"
    refs = (artifact_ref(here, states, read_header(states)),)
    write_artifact(here.artifact("floor", None), builders.floor(), builders.provenance(stage="x", inputs=refs))
    refs = (artifact_ref(here, here.artifact("floor", None), read_header(here.artifact("floor", None))),)
    compared = estimated / "iterations" / "001" / "60-compare.h5"
    write_artifact(compared, builders.comparison(), builders.provenance(stage="x", inputs=refs))
    path = estimated / "project.toml"
    path.write_text(path.read_text().replace("contact_clearance_m = 0.003", "contact_clearance_m = 0.004"))
    said = {one["artifact"]: one["reasons"] for one in document("status")["artifacts"]}
    assert "input iterations/001/20-estimate.h5 is stale itself" in said["floor.h5"]
    assert "input floor.h5 is stale itself" in said["iterations/001/60-compare.h5"]
    assert next(iter(said)) == "floor.h5"


def _planned(folder: Path, stage: str) -> SimpleNamespace:
    """A project of one iteration that is done up to its plan, its runs made by a stage."""
    place = Iteration(1, folder / "iterations" / "001")
    place.path.mkdir(parents=True)
    (folder / "project.toml").write_text("")
    write_artifact(place.artifact("recording"), builders.recording(), builders.provenance(stage=stage, inputs=()))
    for kind, data in (("estimate", builders.estimate()), ("identification", builders.identification()),
                       ("plan", builders.plan())):  # fmt: skip
        write_artifact(place.artifact(kind), data, builders.provenance(stage="x", inputs=()))
    return SimpleNamespace(iterations=lambda: [place], artifact=None)
