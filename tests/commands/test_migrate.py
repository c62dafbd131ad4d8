"""`r2s2r migrate` as a user meets it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.newer import newer_r2s2r
from schemas.results import MigrateResult
from schemas.versions import KINDS, MIGRATIONS
from tests.commands.conftest import document, invoke
from tests.support.versions import current, write_toy


def toys(project: Path) -> list[Path]:
    """Three artifacts of the made-up kind: one of version 1, one of 2, one that is current."""
    paths = [project / "iterations" / f"00{i}" / "90-toy.h5" for i in (1, 2, 3)]
    for version, path in enumerate(paths, start=1):
        write_toy(path, version)
    return paths


def test_the_whole_project_is_migrated_once(estimated: Path) -> None:
    """Without files, all artifacts: old ones are rewritten, current ones are not; the second time none is."""
    paths = toys(estimated)
    with current(3):
        first = MigrateResult.model_validate(document("migrate"))
        second = MigrateResult.model_validate(document("migrate"))
    words = [first.files[str(path)] for path in paths]
    assert ["migrated from version 1 to 3" in words[0], "migrated from version 2 to 3" in words[1]] == [True, True]
    assert "is current" in words[2] and len(first.files) == 5
    assert all("is current" in text for text in second.files.values())
    assert [read_header(path).schema_version for path in paths] == [3, 3, 3]


def test_dry_run_changes_nothing(estimated: Path) -> None:
    """It says what would be done."""
    paths = toys(estimated)
    before = [path.read_bytes() for path in paths]
    with current(3):
        result = invoke("migrate", "--dry-run")
    assert result.exit_code == 0 and result.stdout.count("would migrate") == 2
    assert [path.read_bytes() for path in paths] == before


def test_one_bad_file_does_not_stop_the_others(estimated: Path) -> None:
    """A newer artifact gives exit code 4 and its reason; the others are migrated."""
    paths = toys(estimated)
    with current(2):
        result = invoke("migrate", *map(str, paths), "--json")
    answer = json.loads(result.stdout)
    assert result.exit_code == 4 and newer_r2s2r() in result.stderr and "Traceback" not in result.stderr
    assert set(answer["failed"]) == {str(paths[2])} and set(answer["files"]) == set(map(str, paths[:2]))


def test_a_file_that_is_no_artifact_is_refused(estimated: Path) -> None:
    """robot.toml is no artifact."""
    result = invoke("migrate", "robot.toml")
    assert result.exit_code == 4 and "hint: " in result.stderr


def test_a_project_without_artifacts_has_nothing_to_do(project: Path) -> None:
    """It says so and succeeds."""
    result = invoke("migrate")
    assert (result.exit_code, result.stdout) == (0, "") and "no artifacts yet" in result.stderr


def test_the_old_files_are_no_artifacts_of_the_project(estimated: Path) -> None:
    """`status` and `validate` do not see what `migrate` kept."""
    paths = toys(estimated)
    before = document("status")["artifacts"]
    with current(3):
        document("migrate")
    assert (paths[0].parent / "90-toy.h5.v1").exists()
    assert [a["artifact"] for a in document("status")["artifacts"]] == [a["artifact"] for a in before]
    assert not any("toy.h5.v" in name for name in json.loads(invoke("validate", "--json").stdout)["files"])


def test_what_was_made_of_a_migrated_artifact_stays_fresh(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A new version of the recording's form does not ask for the estimate to be computed again."""
    record = estimated / "iterations" / "001" / "10-record.h5"
    before = read_header(record).content_sha256
    newer = KINDS["recording"].model_copy(update={"version": KINDS["recording"].version + 1})
    monkeypatch.setitem(KINDS, "recording", newer)
    monkeypatch.setitem(MIGRATIONS, ("recording", newer.version - 1), lambda groups: groups)
    assert "migrated" in document("migrate")["files"][str(record)]
    assert read_header(record).content_sha256 != before
    assert {a["artifact"]: a["state"] for a in document("status")["artifacts"]}[
        "iterations/001/20-estimate.h5"
    ] == "fresh"
    assert document("estimate")["state"] == "fresh"
