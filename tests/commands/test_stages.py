"""Stage commands in a project: what they write, when they run again, and what they refuse."""

from __future__ import annotations

import importlib
import json
import shutil
from pathlib import Path

import pytest

from r2s2r_cli.errors import ArtifactError, InputError
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke

RECORD = "iterations/001/10-record.h5"
ESTIMATE = "iterations/001/20-estimate.h5"


def test_init_overwrites_nothing(project: Path) -> None:
    """A second init in the same place is refused, and every file stays as it is."""
    before = {path: path.read_bytes() for path in project.iterdir() if path.is_file()}
    result = invoke("init", ".")
    assert result.exit_code == 2
    assert {path: path.read_bytes() for path in before} == before


def test_init_leaves_a_whole_project_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped half-way, it takes back what it wrote: the same command is not refused afterwards."""
    command = importlib.import_module("r2s2r_cli.commands.init")
    write = command.write_text

    def full(path: Path, text: str) -> None:
        if path.name == "Makefile":
            raise ArtifactError("the disk is full", where=str(path), hint="df -h .")
        write(path, text)

    monkeypatch.setattr(command, "write_text", full)
    assert invoke("init", str(tmp_path / "p"), "--sample").exit_code == 4
    assert not list((tmp_path / "p").iterdir())
    monkeypatch.undo()
    assert invoke("init", str(tmp_path / "p"), "--sample").exit_code == 0


@pytest.mark.parametrize("robot", ["threebar", "threebar-330", "sixbar"])
@pytest.mark.parametrize("attachment", ["surface", "rod_end"])
def test_init_knows_every_robot(tmp_path: Path, robot: str, attachment: str) -> None:
    """Each robot with each attachment gives a project that validates."""
    root = tmp_path / "p"
    assert invoke("init", str(root), "--robot", robot, "--attachment", attachment).exit_code == 0
    result = invoke("validate", "--project", str(root))
    assert result.exit_code == 0, result.stderr


def test_import_keeps_every_row_of_the_source(project: Path) -> None:
    """Rows that are left out later are still in the recording, with their reason."""
    rows = len((project / "sample.csv").read_text().splitlines()) - 1
    report = document("import", "sample.csv", "--no-draw")["report"]["runs"][0]
    _, data = read_artifact(project / RECORD, "recording")
    caps = data.groups["runs/sample/caps"]
    assert len(caps["t"]) == rows == report["rows"]
    assert (caps["drop_reason"] == 0).sum() == report["kept"] < rows


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


def test_several_logs_become_several_runs(project: Path) -> None:
    """`import a.csv b.csv` makes one run a file, named by its stem, and estimate takes them all."""
    shutil.copy("sample.csv", "second.csv")
    shutil.copy("sample.toml", "second.toml")
    assert invoke("import", "sample.csv", "second.csv", "--no-draw").exit_code == 0
    assert invoke("estimate", "--no-draw").exit_code == 0
    _, data = read_artifact(project / ESTIMATE, "estimate")
    assert data.runs() == ["sample", "second"]


def test_estimate_without_a_recording_says_what_to_run(project: Path) -> None:
    """A missing input names the command that makes it."""
    (project / "iterations/001").mkdir(parents=True)
    result = invoke("estimate")
    assert result.exit_code == 4
    assert "r2s2r import" in result.stderr.splitlines()[-1]


def test_a_wrong_setting_is_named_where_it_stands_however_often(estimated: Path) -> None:
    """A command asks for the settings of one stage after the other; project.toml is not to blame."""
    here = Project.find(estimated)
    place = here.iteration(1)
    (place.path / "config.toml").write_text("[estimate]\nfrobnicate = 1\n")
    for _ in range(2):
        with pytest.raises(InputError, match="frobnicate") as raised:
            here.config(place, {})
        assert raised.value.where == str(place.path / "config.toml")


def test_settings_come_from_four_layers(estimated: Path) -> None:
    """project.toml < iteration config.toml < --set; --show-config prints what holds."""
    key = "contact_clearance_m"
    shown = lambda *more: document("estimate", "--show-config", *more)[key]  # noqa: E731
    assert shown() == 0.003
    text = Path("project.toml").read_text()
    Path("project.toml").write_text(text.replace(f"{key} = 0.003", f"{key} = 0.004"))
    assert shown() == 0.004
    Path("iterations/001/config.toml").write_text(f"[estimate]\n{key} = 0.005\n")
    assert shown() == 0.005
    assert shown("--set", f"estimate.{key}=0.006") == 0.006


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("estimate.contact_clearence_m=1", "contact_clearance_m"),
        ("estimte.contact_clearance_m=1", "estimate"),
        ("estimate.contact_clearance_m=-1", "greater than 0"),
        ("estimate.contact_clearance_m=thick", "number"),
    ],
)
def test_a_wrong_override_names_the_right_one(estimated: Path, override: str, words: str) -> None:
    """A misspelt key or an impossible value of --set is a usage error with the near match."""
    result = invoke("estimate", "--set", override)
    assert result.exit_code == 2
    assert words in result.stderr


def test_an_iteration_with_executed_runs_alone_is_told_of_them(project: Path) -> None:
    """Nothing was recorded there, but its plan was executed: those runs are what can be estimated."""
    (project / "iterations/002").mkdir(parents=True)
    (project / "iterations/002/50-execute.h5").touch()
    result = invoke("estimate")
    assert result.exit_code == 4
    assert "hint: r2s2r estimate --of execute --iteration 2" in result.stderr


def test_an_override_is_remembered(estimated: Path) -> None:
    """What was made with --set is not stale for it, and is made again without it."""
    assert document("estimate", "--set", "estimate.contact_clearance_m=0.004", "--no-draw")["state"] == "done"
    assert invoke("status", "--check").exit_code == 0
    answer = document("estimate", "--no-draw")
    assert answer["state"] == "done"
    assert answer["reasons"] == ["setting estimate.contact_clearance_m was 0.004, is 0.003"]


def test_json_of_a_stage_is_one_document(project: Path) -> None:
    """stdout holds one JSON document and nothing else; the talk is on stderr."""
    result = invoke("import", "sample.csv", "--json", "--no-draw")
    answer = json.loads(result.stdout)
    assert answer["schema"] == "r2s2r.stage/1"
    assert answer["artifact"] == RECORD
    assert "wrote" in result.stderr
    assert invoke("import", "sample.csv", "--json", "--quiet", "--force", "--no-draw").stderr == ""


def test_pages_are_self_contained(estimated: Path) -> None:
    """The HTML pages refer to nothing outside themselves, and carry the label of the sample."""
    pages = list((estimated / "iterations/001").glob("*.html"))
    assert {page.name for page in pages} == {"10-record.html", "20-estimate.html"}
    for page in pages:
        text = page.read_text()
        assert "http" not in text
        assert "kinematic sample" in text
        assert "data:image/png;base64," in text


def test_the_real_crawl(project: Path, real_dir: Path) -> None:
    """The published figures of the real crawl: 11 intervals, a third duplicates, 1-4 mm noise, 4 mm ground offset."""
    crawl = real_dir / "tribar_crawl" / "crawl.csv"
    report = document("import", str(crawl), "--no-draw")["report"]["runs"][0]
    assert report["intervals"] == 11
    assert 0.30 < report["dropped"]["duplicate"] / report["rows"] < 0.40
    assert 0.5e-3 < report["noise"]["low_m"] < report["noise"]["high_m"] < 4.5e-3
    assert 3e-3 < report["ground_offset_m"] < 5e-3
    assert document("estimate", "--no-draw")["state"] == "done"


def test_the_real_calibrations(project: Path, real_dir: Path) -> None:
    """The straight-line residuals of the three real sets are 1.2, 1.6 and 1.9 mm; failed fits are flagged."""
    folder = real_dir / "tribar_calibration"
    points, history = folder / "length_capacitance_points.csv", folder / "calibration_history_2025.json"
    report = document("calibrate", "--points", str(points), "--history", str(history), "--no-draw")["report"]
    assert sorted(round(1e3 * fitted["rms_m"], 1) for fitted in report["sets"]) == [1.2, 1.6, 1.9]
    dead = [f for f in report["history"]["failed"] if "zero" in f["state"]]
    assert {(f["date"][:10], f["sensor"]) for f in dead} >= {("2025-01-14", 6), ("2025-01-14", 7), ("2025-01-14", 8)}


@pytest.mark.slow
def test_the_real_measurements_are_drawn(project: Path, real_dir: Path) -> None:
    """The pictures and pages of the real crawl and of the real calibrations: all that the commands name is there."""
    folder = real_dir / "tribar_calibration"
    points, history = folder / "length_capacitance_points.csv", folder / "calibration_history_2025.json"
    for words in (
        ("import", str(real_dir / "tribar_crawl" / "crawl.csv")),
        ("estimate",),
        ("calibrate", "--points", str(points), "--history", str(history)),
    ):
        drawings = document(*words)["drawings"]
        assert {Path(name).suffix for name in drawings} == {".png", ".html"}
        assert all((project / name).stat().st_size > 10_000 for name in drawings)
