"""What a stage selects by itself is selected again: `status` sees what came later, and what was named stays named."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.commands.asked_again import joined
from r2s2r_cli.commands.compare_inputs import Asked
from r2s2r_cli.commands.identify_inputs import Asked as IdentifyAsked
from r2s2r_cli.commands.wanted import wanted
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.write import write_artifact
from schemas.header import InputRef
from tests.commands.conftest import document, invoke
from tests.support import builders
from tests.support.builders import floor, identification, plan, provenance

SHA = "0" * 64
PAIRS = (("10-record.h5", "50-execute.h5"), ("20-estimate.h5", "51-estimate.h5"))


def why(name: str) -> tuple[str, ...]:
    """Why an artifact is stale, as `status` says it."""
    (one,) = [one for one in document("status")["artifacts"] if one["artifact"] == name]
    return tuple(one["reasons"])


def new(*names: str) -> tuple[str, ...]:
    """The reasons of inputs that came later."""
    return tuple(f"input {name} is new: this was made without it" for name in names)


def executed(root: Path, number: int = 1) -> None:
    """The sample once more, as executed runs of an iteration."""
    place = root / "iterations" / f"{number:03d}"
    place.mkdir(exist_ok=True)
    for source, target in PAIRS:
        shutil.copy(root / "iterations" / "001" / source, place / target)


def put(root: Path, number: int, name: str, data: ArtifactData, stage: str, **made: Any) -> None:
    """An artifact of an iteration, fresh but for what is said of how it was made."""
    use = wanted(Project.find(root), None, stage, {}, {})
    fresh = {"stage_version": use.stage_version, "settings": use.settings, "robot": use.robot, "inputs": ()}
    folder = root / "iterations" / f"{number:03d}"
    folder.mkdir(exist_ok=True)
    write_artifact(folder / name, data, builders.provenance(stage=stage, **{**fresh, **made}))


def compared(root: Path, *models: str, of: str | None = None) -> None:
    """60-compare.h5 of the last iteration as `compare` would make it of what is there."""
    here = Project.find(root)
    place = here.iteration(None)
    asked = Asked(here, place, models, of)
    settings = {**wanted(here, None, "compare", {}, {}).settings, "flags": asked.flags()}
    put(root, place.number, "60-compare.h5", builders.comparison(), "compare", settings=settings,
        inputs=tuple(asked.refs()))  # fmt: skip


def identified(root: Path, number: int) -> str:
    """30-identify.h5 of an iteration, of the runs that are there; its path."""
    here = Project.find(root)
    read = IdentifyAsked(here, here.iteration(number)).refs()
    put(root, number, "30-identify.h5", identification(), "identify", inputs=tuple(read))
    return f"iterations/{number:03d}/30-identify.h5"


def test_a_comparison_without_runs_that_came_later_is_stale(estimated: Path) -> None:
    """Made of recorded runs before any was executed; the hint makes it of those that it would take now. Not yet while
    they have no states, which it would ask for; not where the recorded ones were asked for."""
    compared(estimated)
    assert why("iterations/001/60-compare.h5") == ()
    executed(estimated)
    states = estimated / "iterations" / "001" / "51-estimate.h5"
    away = states.rename(estimated / "away")
    assert why("iterations/001/60-compare.h5") == ()
    away.rename(states)
    found = ("iterations/001/51-estimate.h5", "iterations/001/50-execute.h5")
    assert why("iterations/001/60-compare.h5") == new(*found)
    assert document("status")["next"] == "r2s2r compare --iteration 1"
    assert {*found} <= {*document("compare", "--iteration", "1", "--dry-run")["inputs"]}
    compared(estimated, of="record")
    assert why("iterations/001/60-compare.h5") == ()


def test_a_comparison_without_a_simulator_that_came_later_is_stale(estimated: Path) -> None:
    """By default all up to its iteration are compared; with --model those that were named, whatever came since."""
    executed(estimated, 2)
    second = identified(estimated, 2)
    compared(estimated)
    assert why("iterations/002/60-compare.h5") == ()
    first = identified(estimated, 1)
    assert why("iterations/002/60-compare.h5") == new(first)
    compared(estimated, second)
    assert why("iterations/002/60-compare.h5") == ()


def test_an_older_comparison_is_judged_by_what_it_named(estimated: Path) -> None:
    """Before it was noted what was typed, nothing tells a selection of runs from a request: it stays what it is. No
    simulator at all cannot have been asked for."""
    flags = {"models": {}, "of": "record", "own": False}
    settings = {**wanted(Project.find(estimated), None, "compare", {}, {}).settings, "flags": flags}
    read = tuple(
        InputRef(path=f"iterations/001/{name}", kind=kind, sha256=read_header(path).content_sha256)
        for name, kind in (("10-record.h5", "recording"), ("20-estimate.h5", "estimate"))
        for path in (estimated / "iterations" / "001" / name,)
    )
    put(estimated, 1, "60-compare.h5", builders.comparison(), "compare", settings=settings, inputs=read)
    executed(estimated)
    assert why("iterations/001/60-compare.h5") == ()
    later = identified(estimated, 1)
    assert why("iterations/001/60-compare.h5") == new(later)


def test_a_floor_without_runs_that_came_later_is_stale(estimated: Path) -> None:
    """By default it is of all runs; of one iteration it does not ask for another's. What reads it is stale then."""
    assert invoke("floor", "--no-draw").exit_code == 0
    compared(estimated)
    assert why("floor.h5") == ()
    executed(estimated, 2)
    found = ("iterations/002/50-execute.h5", "iterations/002/51-estimate.h5")
    assert why("floor.h5") == new(*found)
    assert document("status")["next"] == "r2s2r floor"
    assert why("iterations/001/60-compare.h5") == ("input floor.h5 is stale itself",)
    assert invoke("floor", "--no-draw").exit_code == 0
    assert why("floor.h5") == ()
    assert invoke("floor", "--iteration", "1", "--no-draw").exit_code == 0
    executed(estimated, 3)
    assert why("floor.h5") == ()


@pytest.mark.parametrize("reach_m", [0.0, 2.0])
def test_a_plan_without_the_states_that_came_later_is_stale(estimated: Path, reach_m: float) -> None:
    """They say how far the camera sees, unless a setting does."""
    executed(estimated)
    place = Project.find(estimated).iteration(2, create=True)
    text = (estimated / "project.toml").read_text()
    (estimated / "project.toml").write_text(text.replace("\nreach_m = 0.0", f"\nreach_m = {reach_m}"))
    states = "iterations/001/51-estimate.h5"
    read = InputRef(path=states, kind="estimate", sha256=read_header(estimated / states).content_sha256)
    put(estimated, 2, "40-plan.h5", plan(), "plan", inputs=(read,) * (reach_m == 0))
    assert why("iterations/002/40-plan.h5") == ()
    shutil.copy(estimated / "iterations" / "001" / "20-estimate.h5", place.artifact("estimate"))
    latest = "iterations/002/20-estimate.h5"
    assert why("iterations/002/40-plan.h5") == (new(latest) if reach_m == 0 else ())


def test_an_identification_without_runs_that_came_later_is_stale(estimated: Path) -> None:
    """One of the runs before its iteration: those that executed the plan there are learned from as well."""
    read = tuple(
        InputRef(path=f"iterations/001/{name}", kind=kind, sha256=read_header(path).content_sha256)
        for name, kind in (("10-record.h5", "recording"), ("20-estimate.h5", "estimate"))
        for path in (estimated / "iterations" / "001" / name,)
    )
    put(estimated, 2, "30-identify.h5", identification(), "identify", inputs=read)
    assert why("iterations/002/30-identify.h5") == ()
    executed(estimated)
    assert why("iterations/002/30-identify.h5") == new("iterations/001/50-execute.h5", "iterations/001/51-estimate.h5")


def test_an_optional_input_that_came_later_is_named(estimated: Path) -> None:
    """A floor for compare and diagnose, a plan for diagnose, an identification for plan; nothing that was read, and
    nothing where the artifact belongs to no iteration."""
    here = Project.find(estimated)
    place = here.iteration(1)
    known = tuple(InputRef(path=f"iterations/001/{name}", kind="recording", sha256=SHA) for name, _ in PAIRS)

    def found(stage: str, *read: str) -> list[str]:
        inputs = (*known, *(InputRef(path=name, kind="floor", sha256=SHA) for name in read))
        settings = {"flags": {"models": {}, "of": "record", "own": False}}
        return joined(here, place, provenance(stage=stage, inputs=inputs, settings=settings))

    assert found("diagnose") == []
    write_artifact(here.artifact("floor", None), floor(), provenance(stage="floor", inputs=()))
    write_artifact(here.artifact("plan", place), plan(), provenance(stage="plan", inputs=()))
    assert found("diagnose") == [*new("floor.h5", "iterations/001/40-plan.h5")]
    assert found("compare") == [*new("floor.h5")]
    assert found("compare", "floor.h5") == found("plan") == []
    write_artifact(here.artifact("identification", place), identification(), provenance(stage="identify", inputs=()))
    assert found("plan") == [*new("iterations/001/30-identify.h5")]
    assert found("identify") == []
    assert joined(here, None, provenance(stage="compare", inputs=())) == []
