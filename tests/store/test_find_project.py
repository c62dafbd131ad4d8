"""A project is found from inside it, and from above it one is shown the way into it."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.project import PROJECT_FILE, SHARED_CACHE, Project, iteration_number

NEW = "r2s2r init myrobot && cd myrobot"


def hinted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """What a command that is given in this folder hints, where it finds no project."""
    monkeypatch.chdir(folder)
    with pytest.raises(ArtifactError) as raised:
        Project.find()
    assert raised.value.where == str(folder)
    return raised.value.hint


def test_from_above_the_way_leads_into_the_first_project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One of several is enough, and its name may have spaces."""
    assert hinted(tmp_path, monkeypatch) == NEW
    (tmp_path / "notes").mkdir()
    assert hinted(tmp_path, monkeypatch) == NEW
    for name in ("second robot", "first robot"):
        (tmp_path / name).mkdir()
        (tmp_path / name / PROJECT_FILE).touch()
    assert hinted(tmp_path, monkeypatch) == "cd 'first robot'"


def test_a_project_that_was_named_is_not_looked_for_elsewhere(tmp_path: Path) -> None:
    """`--project` says which one is meant."""
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / PROJECT_FILE).touch()
    with pytest.raises(ArtifactError) as raised:
        Project.find(tmp_path)
    assert raised.value.hint == NEW


@pytest.mark.parametrize(
    ("name", "number"), [("007", 7), ("12", 12), ("²", None), ("٣", None), ("", None), ("1a", None), ("-1", None)]
)
def test_a_folder_has_the_number_that_it_is_called_by(name: str, number: int | None) -> None:
    """Digits that are no number, as Python has some, are none."""
    assert iteration_number(Path(name)) == number


def test_projects_share_the_folder_of_compiled_code_that_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """R2S2R_CACHE is one folder for all of them, wherever a command is run; without it each keeps its own."""
    roots = [tmp_path / "one", tmp_path / "two"]
    for root in roots:
        root.mkdir()
        (root / PROJECT_FILE).write_text('schema_version = 1\nname = "threebar"\n')
    monkeypatch.delenv(SHARED_CACHE, raising=False)
    own = [Project.find(root).cache for root in roots]
    assert all(cache.is_relative_to(root) for cache, root in zip(own, roots, strict=True))
    monkeypatch.setenv(SHARED_CACHE, str(tmp_path / "all"))
    assert [Project.find(root).cache for root in roots] == [tmp_path / "all"] * 2
    monkeypatch.setenv(SHARED_CACHE, "")
    assert [Project.find(root).cache for root in roots] == own
