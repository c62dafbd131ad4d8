"""What a command needs to find a project: nothing inside of it, the way there from elsewhere."""

from pathlib import Path

import pytest

from r2s2r_cli.store.from_here import project_option


def test_inside_nothing_and_elsewhere_the_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The working directory counts where no other is named."""
    root, inside = tmp_path / "a lab", tmp_path / "a lab" / "iterations" / "001"
    inside.mkdir(parents=True)
    assert project_option(root, root) == project_option(root, inside) == []
    assert project_option(root, tmp_path) == ["--project", "a lab"]
    assert project_option(root, tmp_path / "a lab 2") == ["--project", "../a lab"]
    monkeypatch.chdir(inside)
    assert project_option(root) == [] and project_option(tmp_path / "b") == ["--project", "../../../b"]


def test_links_are_followed(tmp_path: Path) -> None:
    """A folder that a link leads to is the project's wherever the link lies."""
    (tmp_path / "lab").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "lab")
    assert (
        project_option(tmp_path / "link", tmp_path / "lab") == project_option(tmp_path / "lab", tmp_path / "link") == []
    )
