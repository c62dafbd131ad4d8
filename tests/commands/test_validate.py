"""`validate` on a project and on single files: what is found, what is said, which code it leaves with."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from r2s2r_cli.checks import CHECKS
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.newer import newer_r2s2r
from schemas.results import ValidateResult
from tests.commands.conftest import invoke
from tests.support.forge import forge, forge_head, put

RECORDING = Path("iterations/001/10-record.h5")
ESTIMATE = Path("iterations/001/20-estimate.h5")


def outcome(*arguments: str) -> tuple[int, ValidateResult]:
    """Exit code and JSON document of `validate`."""
    result = invoke("validate", *arguments, "--json")
    assert "Traceback" not in result.stderr
    return result.exit_code, ValidateResult.model_validate(json.loads(result.stdout))


def checks(document: ValidateResult, importance: str = "error") -> list[str]:
    """Names of the checks that found something, in order."""
    return [finding.check for finding in document.findings if finding.importance == importance]


def test_a_sound_project_passes(estimated: Path) -> None:
    """Without files, everything in the project is checked; sensors without calibration are advice, no error."""
    code, document = outcome()
    assert code == 0
    assert document.files == ("project.toml", "robot.toml", str(RECORDING), str(ESTIMATE))
    assert document.checks == tuple(entry.name for entry in CHECKS)
    assert [f.check for f in document.findings] == ["sensors_are_calibrated"]
    assert (document.errors, document.warnings, document.advice, document.unreadable) == (0, 0, 1, ())


def test_a_wrong_value_is_an_error(estimated: Path) -> None:
    """A target out of range, in a file that is sealed and whole, is found and leaves with 3."""
    forge(RECORDING, put("runs/sample/commands/target", (9, 2), 1.5))
    code, document = outcome(str(RECORDING))
    assert code == 3
    assert "targets_in_range" in checks(document)
    finding = next(f for f in document.findings if f.check == "targets_in_range")
    assert (finding.file, finding.location) == (str(RECORDING), "runs/sample/commands/target")
    assert (finding.expected, finding.received) == ("0 (short) .. 1 (long)", "1.5 at row 9, cable 2")


def test_people_get_one_block_a_finding_and_a_summary(estimated: Path) -> None:
    """The same as text: importance, sentence, name of the check, where, expected, received, hint; then the count."""
    forge(RECORDING, put("runs/sample/commands/target", (9, 2), 1.5))
    result = invoke("validate", str(RECORDING), "--select", "targets_in_range")
    again = "r2s2r import sample.csv --iteration 1 --force"
    assert result.exit_code == 3
    assert result.stdout.splitlines() == [
        "error: a target position is out of range  [targets_in_range]",
        f"  where:    {RECORDING}: runs/sample/commands/target",
        "  expected: 0 (short) .. 1 (long)",
        "  received: 1.5 at row 9, cable 2",
        f"  hint:     {again}   # first write targets in the source as positions 0 .. 1",
        "",
        "1 file, 1 kind of check: 1 error, 0 warnings, 0 advice",
    ]
    assert result.stderr.splitlines()[0] == "error: 1 error in 1 of 1 files"
    assert result.stderr.splitlines()[-1].startswith("hint: ")


def test_a_damaged_dataset_is_named(estimated: Path) -> None:
    """One changed number in an unsealed file: code 4, the dataset named, and the other files still looked at."""
    with h5py.File(RECORDING, "r+") as file:
        file["runs/sample/caps/t"][3] += 1e-3
    code, document = outcome()
    assert code == 4
    assert document.unreadable == (str(RECORDING),)
    damaged = [f for f in document.findings if f.file == str(RECORDING)]
    assert [(f.check, f.location) for f in damaged] == [("content_intact", "runs/sample/caps/t")]
    assert damaged[0].hint == f"r2s2r recover {RECORDING}"
    assert len(document.files) == 4
    assert "sensors_are_calibrated" in checks(document, "advice")


@pytest.mark.parametrize("place", ["behind the data", "behind the head"])
def test_bytes_that_nothing_reads_are_a_warning(estimated: Path, place: str) -> None:
    """Bytes that hold no value changed: the hash proves it, a warning says it, the code is 0."""
    content = bytearray(RECORDING.read_bytes())
    if place == "behind the data":
        content += b"junk"
    else:
        content[read_header(RECORDING).body_offset - 2] = ord("x")
    RECORDING.write_bytes(content)
    code, document = outcome(str(RECORDING))
    assert (code, checks(document), checks(document, "warning")) == (0, [], ["bytes_intact"])


def test_a_file_that_was_cut_off_says_how_much_is_left(estimated: Path) -> None:
    """A truncated file: expected and received are the lengths."""
    header = read_header(RECORDING)
    RECORDING.write_bytes(RECORDING.read_bytes()[:-1000])
    code, document = outcome(str(RECORDING))
    first = document.findings[0]
    assert (code, first.what) == (4, "the file was cut off")
    assert first.expected == f"{header.body_bytes} bytes of data"
    assert first.received == f"{header.body_bytes - 1000} bytes"


def test_a_damaged_head_over_intact_data(estimated: Path) -> None:
    """Where only the head is damaged, the finding says that the data are intact, and recover is the hint."""
    content = bytearray(RECORDING.read_bytes())
    content[200] ^= 1
    RECORDING.write_bytes(content)
    code, document = outcome(str(RECORDING))
    assert (code, checks(document)) == (4, ["file_opens"])
    assert document.findings[0].received.endswith("the data behind it are intact")
    assert document.findings[0].hint == f"r2s2r recover {RECORDING}"


def test_damage_is_found_behind_a_damaged_head(estimated: Path) -> None:
    """Head and a dataset damaged: both are findings."""
    with h5py.File(RECORDING, "r+") as file:
        file["runs/sample/caps/t"][3] += 1e-3
    content = bytearray(RECORDING.read_bytes())
    content[200] ^= 1
    RECORDING.write_bytes(content)
    code, document = outcome(str(RECORDING))
    assert (code, checks(document)) == (4, ["file_opens", "content_intact"])


def test_a_wrong_layout_hides_no_crash(estimated: Path) -> None:
    """A sealed file of another layout: the mismatch is the finding, and no check of the values runs on it."""

    def change(file: h5py.File) -> None:
        t = file["runs/sample/caps/t"]
        file["runs/sample/caps"].attrs["surprise"] = 1
        t.attrs["unit"] = np.bytes_(b"ms")
        file["runs/sample/commands/target"][0] = 9.0

    forge(RECORDING, change)
    code, document = outcome(str(RECORDING))
    assert code == 3
    assert set(checks(document)) == {"layout_matches"}
    assert {f.location for f in document.findings} == {"runs/sample/caps@surprise", "runs/sample/caps/t@unit"}


def test_nan_where_it_means_nothing(estimated: Path) -> None:
    """NaN in the stamps: the form is wrong, the physics is not looked at."""
    forge(ESTIMATE, put("runs/sample/frames/cov_p_WE", (0, 0, 0, 0), np.nan))
    code, document = outcome(str(ESTIMATE))
    assert (code, checks(document)) == (3, ["values_finite"])


def test_a_newer_version_is_refused(estimated: Path) -> None:
    """An artifact of a newer r2s2r: code 4, and the hint brings this one up to date."""
    forge_head(RECORDING, schema_version=99)
    code, document = outcome(str(RECORDING))
    assert (code, checks(document)) == (4, ["version_known"])
    assert document.findings[0].hint == newer_r2s2r()


def test_a_head_that_contradicts_its_body(estimated: Path) -> None:
    """A head with another provenance than the body is an error, although each of both is intact."""
    made = read_header(ESTIMATE).provenance
    forge_head(ESTIMATE, provenance=made.model_copy(update={"seed": 7}))
    code, document = outcome(str(ESTIMATE))
    assert (code, checks(document)) == (3, ["head_matches_body"])
    assert document.findings[0].location == "provenance/seed"


def test_an_estimate_of_another_recording(estimated: Path) -> None:
    """The recording holds something else than when the estimate was made: an error of the estimate."""
    forge(RECORDING, put("runs/sample/caps/p_WE", (0, 0, 0), 0.0))
    code, document = outcome("--select", "inputs_match")
    assert code == 3
    assert [(f.check, f.file) for f in document.findings] == [("inputs_match", str(ESTIMATE))]
    RECORDING.unlink()
    _, document = outcome(str(ESTIMATE), "--select", "inputs_match")
    assert document.findings[0].received == "there is no such file"


def test_a_source_that_changed_is_a_warning(estimated: Path) -> None:
    """The recording is sound, its CSV is another now; a CSV that is gone is nothing to complain about."""
    with Path("sample.csv").open("a") as file:
        file.write("\n")
    code, document = outcome(str(RECORDING))
    assert (code, checks(document, "warning")) == (0, ["source_unchanged"])
    Path("sample.csv").unlink()
    assert checks(outcome(str(RECORDING))[1], "warning") == []


def test_data_of_another_robot(estimated: Path) -> None:
    """With another robot.toml the data are of another robot, and nothing else about it is claimed."""
    text = Path("robot.toml").read_text()
    Path("robot.toml").write_text(text.replace('name = "threebar"', 'name = "mine"', 1))
    code, document = outcome(str(RECORDING), str(ESTIMATE))
    assert code == 3
    assert set(checks(document)) == {"robot_is_the_projects"}


def test_a_recording_that_was_cut_off_is_a_warning(estimated: Path) -> None:
    """A journal left behind is named, with the command that rescues it; given as a file it is no artifact."""
    journal = Path("iterations/001/10-record.journal")
    journal.write_bytes(b"r2s2r-journal 1 ")
    code, document = outcome()
    assert code == 0
    assert [(f.location, f.hint) for f in document.findings if f.importance == "warning"] == [
        (str(journal), f"r2s2r recover {journal}")
    ]
    code, document = outcome(str(journal))
    assert (code, document.findings[0].hint) == (4, f"r2s2r recover {journal}")


def test_a_misspelt_key_is_found_with_its_neighbour(estimated: Path) -> None:
    """robot.toml with an unknown key has an error; the other files are still checked, without the robot."""
    text = Path("robot.toml").read_text()
    Path("robot.toml").write_text(text.replace("winch_radius_m", "winch_radus_m", 1))
    code, document = outcome()
    assert (code, document.unreadable, document.findings[0].check) == (3, (), "values_allowed")
    assert document.findings[0].expected == "winch_radius_m"
    assert len(document.files) == 4
    said = invoke("validate").stderr
    assert "checks against the robot are left out: robot.toml has an error, see below" in said
    assert "1 error in 1 of 4 files" in said
    alone = invoke("validate", str(RECORDING)).stderr  # no block says it then
    assert "left out: robot.toml cannot be used: unknown key motors.0.winch_radus_m" in alone


def test_a_broken_project_file_is_a_finding(estimated: Path) -> None:
    """project.toml that is no TOML does not keep the rest of the project from being checked."""
    Path("project.toml").write_text("name = ")
    code, document = outcome()
    assert (code, document.unreadable) == (4, ("project.toml",))
    assert document.files == ("project.toml", "robot.toml", str(RECORDING), str(ESTIMATE))


def policy(**changes: Any) -> str:
    """A policy file of two steps, with other values where they are given."""
    values = {"schema_version": 1, "robot": "threebar", "name": "gait", **changes}
    steps = values.pop("steps", [[0, 0, 0, 0, 0, 0], [1, 1, 1, 1, 1, 1]])
    head = "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items())
    return head + "".join(f"[[steps]]\ntarget = {json.dumps(step)}\n" for step in steps)


@pytest.mark.parametrize(
    ("text", "code", "found"),
    [
        (policy(), 0, []),
        (policy(robot="sixbar"), 3, ["policy_robot_known"]),
        (policy(steps=[[0, 1, 0]]), 3, ["policy_fits_cables"]),
        (policy(steps=[[0, 1, 0, 1, 0, 95]]), 3, ["values_allowed"]),
        (policy(nam="x"), 3, ["values_allowed"]),
        (policy(steps=[]), 3, ["values_allowed"]),
    ],
)
def test_policies_are_checked(project: Path, text: str, code: int, found: list[str]) -> None:
    """A policy file is known by its keys; what its model or the robot refuses is found."""
    Path("gait.toml").write_text(text)
    document = outcome("gait.toml")
    assert (document[0], checks(document[1])) == (code, found)


def test_policies_of_the_project_are_among_its_files(project: Path) -> None:
    """TOML files with steps are policies; sidecars and other people's files are left alone."""
    Path("gait.toml").write_text(policy())
    Path("policies").mkdir()
    Path("policies/turn.toml").write_text(policy(robot="sixbar"))
    Path("other.toml").write_text("[tool]\nx = 1\n")
    code, document = outcome()
    assert code == 3
    assert document.files == ("project.toml", "robot.toml", "gait.toml", "policies/turn.toml")


def test_settings_of_an_iteration_are_checked(estimated: Path) -> None:
    """config.toml of an iteration with a misspelt setting."""
    (RECORDING.parent / "config.toml").write_text("[estimate]\ncontact_clearence_m = 0.01\n")
    code, document = outcome("--iteration", "1")
    assert (code, document.unreadable, checks(document)) == (3, (), ["values_allowed"])
    assert document.files == (str(RECORDING.parent / "config.toml"), str(RECORDING), str(ESTIMATE))
    assert document.findings[0].expected == "contact_clearance_m"


def test_files_outside_a_project(estimated: Path, tmp_path: Path) -> None:
    """Without a project the file itself is checked; robot and inputs are left out, and it is said so."""
    alone = tmp_path / "alone.h5"
    shutil.copy(RECORDING, alone)
    forge(alone, put("runs/sample/caps/p_WE", slice(None), 0.0))
    result = invoke("validate", str(alone))
    assert result.exit_code == 0
    assert "no project above these files" in result.stderr


@pytest.mark.parametrize("where", ["sub", "..", "absolute"])
def test_a_project_is_found_from_anywhere(estimated: Path, where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a subdirectory, from outside with --project, and by an absolute path, the same findings come out."""
    if where == "sub":
        monkeypatch.chdir("iterations/001")
        code, document = outcome()
    elif where == "..":
        monkeypatch.chdir("..")
        code, document = outcome("--project", "robot")
    else:
        monkeypatch.chdir("/")
        code, document = outcome(str(estimated / RECORDING), str(estimated / "robot.toml"))
    assert (code, [f.check for f in document.findings]) == (0, ["sensors_are_calibrated"])
    assert all(Path(file).is_file() for file in document.files)
