"""Stage commands in a project: what they write, when they run again, and what they refuse."""

from __future__ import annotations

import importlib
import json
import shutil
from pathlib import Path

import pytest

from r2s2r_cli.errors import ArtifactError, InputError
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
