"""The hint of `status` works when it is pasted: it never asks for what cannot be done with what there is."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.commands.asked_again import would_read
from r2s2r_cli.commands.mend import MOVES
from r2s2r_cli.commands.wanted import wanted
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.store.staleness import artifact_ref
from r2s2r_cli.store.write import write_artifact
from schemas.header import InputRef
from schemas.versions import STAGE_VERSIONS
from tests.commands.conftest import document, invoke
from tests.support import builders

GAIT = 'schema_version = 1\nrobot = "threebar"\nname = "gait"\n[[steps]]\ntarget = [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]\n'
FLAGS = {"policies": ["gait.toml"], "port": "/dev/ttyUSB0", "protocol": "checked", "camera": "realsense", "repeats": 2}
OLD = STAGE_VERSIONS["estimate"] - 1
NAMES = {"record": ("10-record.h5", "20-estimate.h5"), "execute": ("50-execute.h5", "51-estimate.h5")}
ESTIMATE = "iterations/001/20-estimate.h5"


def ref(root: Path, name: str) -> InputRef:
    """An artifact of iteration 1 as an input."""
    path = root / "iterations" / "001" / name
    return artifact_ref(Project.find(root), path, read_header(path))


def put(root: Path, name: str, data: ArtifactData, stage: str, **made: Any) -> None:
    """An artifact of iteration 1, fresh but for what is said of how it was made: of all that its stage would read."""
    folder, here = root / "iterations" / "001", Project.find(root)
    folder.mkdir(parents=True, exist_ok=True)
    use = wanted(here, None, stage, {}, {})
    fresh = {"stage_version": use.stage_version, "settings": use.settings, "robot": use.robot, "inputs": ()}
    asked = builders.provenance(stage=stage, **{**fresh, **made})
    known = {one.path for one in asked.inputs}
    more = [path for path in would_read(here, here.iteration(1), asked) if here.relative(path) not in known]
    refs = [artifact_ref(here, path, read_header(path)) for path in more]
    write_artifact(folder / name, data, asked.model_copy(update={"inputs": (*asked.inputs, *refs)}))


def without_pictures(root: Path, stage: str) -> None:
    """Runs of gait.toml whose pictures were taken out, states from them by an older version, and a comparison."""
    (root / "gait.toml").write_text(GAIT)
    recording, estimate = NAMES[stage]
    runs = builders.recording().groups.items()
    blind = ArtifactData("recording", {name: group for name, group in runs if not name.endswith(("/camera", "/caps"))})
    for name in {recording, NAMES["record"][0]}:
        made = stage if name == recording else "record"
        put(root, name, blind, made, settings={"flags": FLAGS})
    put(root, estimate, builders.estimate(), "estimate", stage_version=OLD, inputs=(ref(root, recording),))
    put(root, "60-compare.h5", builders.comparison(), "compare", inputs=(ref(root, estimate),))


def said(name: str) -> str:
    """Why an artifact of iteration 1 is stale, as `status` says it."""
    found = document("status")["artifacts"]
    return "; ".join(next(one for one in found if one["artifact"] == f"iterations/001/{name}")["reasons"])


def pasted() -> str:
    """The hint of `status`, after it was run in the project's directory and did what it says."""
    hint: str = document("status")["next"]
    done = invoke(*shlex.split(hint, comments=True)[1:])
    assert done.exit_code == 0, (hint, done.stderr)
    return hint


@pytest.mark.parametrize("stage", NAMES)
def test_states_whose_pictures_are_gone_are_not_asked_for(project: Path, stage: str) -> None:
    """Where a setting changed their runs are shown instead, without the robot that made them, and why is said. Nor is
    what was made of the states asked for: of the same states it would be the same."""
    without_pictures(project, stage)
    recording, estimate = NAMES[stage]
    config = project / "project.toml"
    config.write_text(config.read_text().replace("sensor_gap_s = 0.25", "sensor_gap_s = 0.5", 1))
    assert f"the pictures or end caps of iterations/001/{recording} are not kept" in said(estimate)
    assert pasted() == f"r2s2r {stage} gait.toml --repeats 2 --iteration 1 --force --dry-run   # {MOVES}"
    (project / "gait.toml").unlink()
    assert document("status")["next"] == ""


@pytest.mark.parametrize("stage", NAMES)
def test_a_recording_without_a_camera_never_had_pictures(project: Path, stage: str) -> None:
    """It replaced the one that the states are of: both are said, and not that something was not kept."""
    without_pictures(project, stage)
    recording, estimate = NAMES[stage]
    before = read_artifact(project / "iterations/001" / recording, "recording")[1]
    blind = {name: group for name, group in before.groups.items() if not name.startswith("runs/walk/imu")}
    put(project, recording, ArtifactData("recording", blind), stage, settings={"flags": {**FLAGS, "camera": None}})
    why = f"iterations/001/{recording} was recorded without a camera"
    assert f"cannot be made again: {why}; these states are of another recording than that" in said(estimate)
    shown = " ".join(invoke("run", "--iteration", "1", "--dry-run").stderr.split())
    assert f"cannot be made again here, {why}, and these states are of another recording than that" in shown
    assert "not kept" not in shown


@pytest.mark.parametrize("stage", NAMES)
def test_no_robot_is_asked_to_move_for_a_newer_version_of_a_stage(project: Path, stage: str) -> None:
    """States that an older version made of pictures that are gone remain usable: it is said, and nothing is hinted."""
    without_pictures(project, stage)
    recording, estimate = NAMES[stage]
    why = f"the pictures or end caps of iterations/001/{recording} are not kept"
    assert f"it cannot be made again here, and remains usable: {why}" in said(estimate)
    hint = document("status")["next"]
    assert "--dry-run" not in hint and f"r2s2r {stage}" not in hint
    assert not hint or invoke(*shlex.split(hint)[1:]).exit_code == 0


@pytest.mark.parametrize("kept", [True, False])
def test_no_robot_is_asked_to_move_because_a_plan_was_made_again(project: Path, kept: bool) -> None:
    """What it did stays what it did, and it is said under which plan; one that is gone is made again."""
    without_pictures(project, "execute")
    put(project, "10-record.h5", builders.recording(), "record")
    put(project, "20-estimate.h5", builders.estimate(), "estimate")
    put(project, "30-identify.h5", builders.identification(), "identify")
    put(project, "40-plan.h5", builders.plan(), "plan", inputs=(ref(project, "30-identify.h5"),))
    plan = ref(project, "40-plan.h5").model_copy(update={"sha256": "1" * 64})
    put(project, "50-execute.h5", builders.recording(), "execute", inputs=(plan,),
        settings={"flags": {**FLAGS, "policies": ["gone-7"]}})  # fmt: skip
    put(project, "51-estimate.h5", builders.estimate(), "estimate")
    put(project, "60-compare.h5", builders.comparison(), "compare")
    if not kept:
        (project / "iterations/001/40-plan.h5").unlink()
    wanted = "r2s2r diagnose --iteration 1" if kept else "r2s2r plan --iteration 1"
    words = "recorded under an older iterations/001/40-plan.h5: what the robot did" if kept else "40-plan.h5"
    assert words in said("50-execute.h5")
    assert document("status")["next"] == wanted


def test_what_another_program_made_hides_no_hint(project: Path) -> None:
    """How it is made is said where it stands; what comes next is a command."""
    put(project, "10-record.h5", builders.recording(), "record")
    put(project, "20-estimate.h5", builders.estimate(), "estimate")
    states = ref(project, "20-estimate.h5").model_copy(update={"sha256": "1" * 64})
    made = {"stage_version": 1, "settings": {}, "robot": {}, "argv": ("make.py", "out dir"), "inputs": (states,)}
    put(project, "40-plan.h5", builders.plan(), "collect", **made)
    assert said("40-plan.h5").endswith("another program makes it: make.py 'out dir'")
    assert document("status")["next"] == "r2s2r identify --iteration 1"


def test_a_missing_input_is_made_first(estimated: Path) -> None:
    """Not the stage that needs it, which could only say so."""
    made = {"stage_version": 0, "inputs": (ref(estimated, "20-estimate.h5"),)}
    put(estimated, "30-identify.h5", builders.identification(), "identify", **made)
    (estimated / ESTIMATE).unlink()
    assert f"{ESTIMATE} must be made first" in said("30-identify.h5")
    assert pasted() == "r2s2r estimate --iteration 1"
    assert document("status")["next"] == "r2s2r identify --iteration 1"


def test_a_floor_that_came_later_is_said(estimated: Path) -> None:
    """As the command itself says that it would make the comparison again."""
    made = (ref(estimated, "20-estimate.h5"), ref(estimated, "10-record.h5"))
    flags = {"models": {}, "of": "record", "own": False}
    settings = {**wanted(Project.find(estimated), None, "compare", {}, {}).settings, "flags": flags}
    put(estimated, "60-compare.h5", builders.comparison(), "compare", inputs=made, settings=settings)
    assert said("60-compare.h5") == ""
    assert invoke("floor").exit_code == 0
    assert said("60-compare.h5") == "input floor.h5 is new: this was made without it"
    assert document("compare", "--dry-run")["reasons"] == ["input floor.h5 is new: this was made without it"]


def test_a_fresh_artifact_says_that_its_inputs_are_stale(estimated: Path) -> None:
    """Through an input of theirs, too; `status` calls it stale, and is named."""
    assert invoke("floor").exit_code == 0
    assert (document("floor")["state"], document("floor")["reasons"]) == ("fresh", [])
    (estimated / "sample.csv").write_text((estimated / "sample.csv").read_text() + "\n")
    done = invoke("floor")
    assert done.exit_code == 0
    assert "floor.h5 is fresh, nothing to do" in done.stderr
    assert "but its input iterations/001/10-record.h5 is stale itself" in done.stderr
    assert "but its input iterations/001/20-estimate.h5 is stale itself" in done.stderr
    assert "hint: r2s2r status" in done.stderr


def test_what_is_computed_from_stale_inputs_says_so(estimated: Path) -> None:
    """Which, why and through what, when the stage runs as when it would run; not where all is fresh."""
    assert document("floor")["stale_inputs"] == []
    (estimated / "sample.csv").write_text((estimated / "sample.csv").read_text() + "\n")
    done = invoke("floor", "--force")
    assert done.exit_code == 0
    why, record = "input sample.csv changed: its bytes are others", "iterations/001/10-record.h5"
    said = " ".join(done.stderr.split())
    assert f"warning: floor.h5: its input {record} is stale itself: {why}" in said
    assert f"warning: floor.h5: its input {ESTIMATE} is stale itself: through {record}: {why}" in said
    assert "hint: r2s2r status" in done.stderr
    floor = f"its input floor.h5 is stale itself: through {record}: {why}"
    assert floor in document("compare", "--dry-run")["stale_inputs"]
    assert f"warning: {ESTIMATE}: its input {record} is stale itself: {why}" in invoke("estimate", "--force").stderr


def test_a_calibration_is_one_line_of_the_table(estimated: Path) -> None:
    """Many numbers of robot.toml changed: the table counts them, the document names each."""
    text = (estimated / "robot.toml").read_text()
    (estimated / "robot.toml").write_text(text.replace("[[sensors]]", "[[sensors]]\noffset_f = 1e-11"))
    assert said("20-estimate.h5").count("offset_f was absent, is 1e-11") == 9
    shown = " ".join(invoke("status").stdout.split())
    assert "9 values of robot.toml changed (sensors.*)" in shown
    assert shown.count("sensors.8") == 0
    assert "because 9 values of robot.toml changed" in invoke("estimate", "--dry-run").stderr


def test_a_log_that_is_gone_is_not_asked_for(estimated: Path) -> None:
    """What was imported from it stays, stale, and the project goes on."""
    config = estimated / "project.toml"
    config.write_text(config.read_text().replace("rod_length_tolerance = 0.05", "rod_length_tolerance = 0.04", 1))
    assert document("status")["next"] == "r2s2r import sample.csv --iteration 1"
    (estimated / "sample.csv").unlink()
    assert "cannot be made again: sample.csv is not kept" in said("10-record.h5")
    assert document("status")["next"] == "r2s2r identify --iteration 1"
