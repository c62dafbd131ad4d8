"""Stages that are run again: what is fresh, what is forced, what is in the way, and inputs that change meanwhile."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke

RECORD = "iterations/001/10-record.h5"
ESTIMATE = "iterations/001/20-estimate.h5"


def test_a_fresh_artifact_is_not_made_again(estimated: Path) -> None:
    """The second run says fresh, leaves every byte, and touches the file so that make rests."""
    before = {name: (estimated / name).read_bytes() for name in (RECORD, ESTIMATE)}
    times = {name: (estimated / name).stat().st_mtime_ns for name in before}
    assert document("import", "sample.csv")["state"] == "fresh"
    assert document("estimate")["state"] == "fresh"
    assert {name: (estimated / name).read_bytes() for name in before} == before
    assert all((estimated / name).stat().st_mtime_ns > time for name, time in times.items())


def test_the_same_inputs_give_the_same_content(estimated: Path, tmp_path: Path) -> None:
    """Another project, the same sample and settings: the content hashes are equal, and inspect --same-as says so."""
    other = tmp_path / "other"
    assert invoke("init", str(other), "--sample").exit_code == 0
    assert invoke("import", "--project", str(other), str(other / "sample.csv"), "--no-draw").exit_code == 0
    assert invoke("estimate", "--project", str(other), "--no-draw").exit_code == 0
    for name in (RECORD, ESTIMATE):
        assert read_header(estimated / name).content_sha256 == read_header(other / name).content_sha256
        assert document("inspect", str(estimated / name), "--same-as", str(other / name))["same"]


def test_force_gives_the_same_content_again(estimated: Path) -> None:
    """--force computes again; nothing but times differs."""
    before = read_header(estimated / ESTIMATE)
    assert document("estimate", "--force", "--no-draw")["state"] == "done"
    after = read_header(estimated / ESTIMATE)
    assert after.content_sha256 == before.content_sha256


def test_dry_run_writes_nothing(project: Path) -> None:
    """--dry-run says what would be made and why, and leaves the directory alone."""
    before = sorted(project.rglob("*"))
    answer = document("import", "sample.csv", "--dry-run")
    assert (answer["state"], answer["reasons"]) == ("dry_run", ["there is no artifact yet"])
    assert sorted(project.rglob("*")) == before


def test_another_log_does_not_replace_a_recording(estimated: Path) -> None:
    """Importing another log into the same iteration is refused, with the iteration to use instead."""
    shutil.copy("sample.csv", "second.csv")
    shutil.copy("sample.toml", "second.toml")
    result = invoke("import", "second.csv")
    assert result.exit_code == 2
    assert result.stderr.splitlines()[-1] == "hint: r2s2r import second.csv --iteration 2"
    assert invoke("import", "second.csv", "--iteration", "2", "--no-draw").exit_code == 0


def test_a_dry_run_says_that_a_recording_is_in_the_way(estimated: Path) -> None:
    """In the words of the real run; with --force and into another iteration the log would go."""
    for ending in ("csv", "toml"):
        shutil.copy(f"sample.{ending}", f"other.{ending}")
    before = sorted(estimated.rglob("*"))
    real, dry = invoke("import", "other.csv"), invoke("import", "other.csv", "--dry-run")
    assert (real.exit_code, dry.exit_code) == (2, 2)
    assert "import loses none" in dry.stderr
    assert [line for line in dry.stderr.splitlines() if "hint" not in line] == real.stderr.splitlines()[:-1]
    assert document("import", "other.csv", "--dry-run", "--force")["state"] == "dry_run"
    assert document("import", "other.csv", "--dry-run", "--iteration", "2")["state"] == "dry_run"
    assert sorted(estimated.rglob("*")) == before


def test_a_recording_never_loses_a_run(project: Path) -> None:
    """Of two imported runs none can be dropped by importing one again; a third can be added."""
    for name in ("second", "third"):
        shutil.copy("sample.csv", f"{name}.csv")
        shutil.copy("sample.toml", f"{name}.toml")
    assert invoke("import", "sample.csv", "second.csv", "--no-draw").exit_code == 0
    assert invoke("import", "second.csv", "--no-draw").exit_code == 2
    assert invoke("import", "sample.csv", "second.csv", "third.csv", "--no-draw").exit_code == 0
    _, data = read_artifact(project / RECORD, "recording")
    assert data.runs() == ["sample", "second", "third"]


def test_moved_projects_and_logs_stay_fresh(project: Path, tmp_path: Path) -> None:
    """What counts is the name and content of a source, not where it lies."""
    outside = tmp_path / "logs"
    outside.mkdir()
    for ending in ("csv", "toml"):
        shutil.move(f"sample.{ending}", outside)
    assert invoke("import", str(outside / "sample.csv"), "--no-draw").exit_code == 0
    deep = tmp_path / "elsewhere" / "deep"
    shutil.copytree(project, deep)
    where = ("--project", str(deep), "--no-draw")
    assert document("import", str(outside / "sample.csv"), *where)["state"] == "fresh"


def test_missing_pictures_are_drawn_again(estimated: Path) -> None:
    """A deleted page or picture comes back without computing, with the same report; other ones are left alone."""
    before = read_header(estimated / ESTIMATE)
    folder = estimated / "iterations/001"
    (folder / "20-estimate.html").unlink()
    answer = document("estimate")
    assert (answer["state"], answer["report"]) == ("fresh", before.provenance.report)
    assert (folder / "20-estimate.html").exists()
    assert read_header(estimated / ESTIMATE) == before


def test_pictures_never_show_another_artifact(estimated: Path) -> None:
    """A new artifact without pictures takes the old ones away; drawing later makes them from the new one."""
    folder = estimated / "iterations/001"
    settings = ("--set", "estimate.contact_clearance_m=0.02")
    assert document("estimate", *settings, "--no-draw")["state"] == "done"
    assert not list(folder.glob("20-estimate*.png")) and not (folder / "20-estimate.html").exists()
    assert document("estimate", *settings)["reasons"] == ["it was made with --no-draw"]
    assert (folder / "20-estimate.html").exists()


def test_pictures_of_a_damaged_artifact_go_with_it(estimated: Path) -> None:
    """Its head cannot say any more what was drawn of it: what is called after it goes, and nothing else."""
    folder = estimated / "iterations/001"
    mine = folder / "20-notes.png"
    mine.write_bytes(b"mine")
    (estimated / ESTIMATE).write_bytes(b"nothing")
    assert document("estimate", "--no-draw", "--force")["state"] == "done"
    assert not list(folder.glob("20-estimate*.png")) and not (folder / "20-estimate.html").exists() and mine.exists()


def test_an_input_that_changes_while_it_is_read_is_noticed(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Provenance must name what was read: a log that grows during the import is refused and nothing is written."""
    import r2s2r_cli.stages.import_ as stage

    merge = stage.merge_runs

    def grow_and_merge(runs: object) -> object:
        with Path("sample.csv").open("a") as file:
            file.write("\n")
        return merge(runs)  # type: ignore[arg-type]

    monkeypatch.setattr(stage, "merge_runs", grow_and_merge)
    result = invoke("import", "sample.csv")
    assert result.exit_code == 4
    assert "changed while it was read" in result.stderr
    assert not (project / RECORD).exists()


def test_an_input_that_appears_while_it_is_read_is_noticed(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The facts beside a log decide what is made of it: some that come meanwhile are an error in words."""
    import r2s2r_cli.stages.import_ as stage

    merge, facts = stage.merge_runs, project / "sample.toml"
    text = facts.read_text()
    facts.unlink()

    def appear_and_merge(runs: object) -> object:
        facts.write_text(text)
        return merge(runs)  # type: ignore[arg-type]

    monkeypatch.setattr(stage, "merge_runs", appear_and_merge)
    result = invoke("import", "sample.csv")
    assert result.exit_code == 4 and "where: sample.toml" in result.stderr
    assert not (project / RECORD).exists()


def test_a_robot_that_is_edited_meanwhile_is_the_one_before(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is computed with is what the provenance says: afterwards the artifact is stale, by the edit."""
    import r2s2r_cli.stages.import_ as stage

    merge, path = stage.merge_runs, project / "robot.toml"
    before = path.read_text()

    def edit_and_merge(runs: object) -> object:
        path.write_text(before.replace("cap_radius_m = 0.0175", "cap_radius_m = 0.01"))
        return merge(runs)  # type: ignore[arg-type]

    ground = document("import", "sample.csv", "--no-draw")["report"]["runs"][0]
    monkeypatch.setattr(stage, "merge_runs", edit_and_merge)
    assert document("import", "sample.csv", "--no-draw", "--force")["report"]["runs"][0] == ground
    assert path.read_text() != before
    (reason,) = document("status")["artifacts"]
    assert "cap_radius_m" in str(reason)


def test_dry_run_of_a_fresh_artifact_touches_nothing(estimated: Path) -> None:
    """--dry-run leaves even the file time, which make would act on."""
    before = (estimated / ESTIMATE).stat().st_mtime_ns
    assert document("estimate", "--dry-run")["state"] == "fresh"
    assert (estimated / ESTIMATE).stat().st_mtime_ns == before
