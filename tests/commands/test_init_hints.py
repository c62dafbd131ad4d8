"""What `init` refuses is answered with the same request, mended: its directory and its options stay."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.commands.conftest import invoke


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("x --robot fourbar --seed 4", "r2s2r init x --seed 4 --robot threebar"),
        ("'x y' --robot sixbra --attachment rod_end", "r2s2r init 'x y' --attachment rod_end --robot sixbar"),
        ("--robot threebar-33", "r2s2r init --robot threebar-330"),
        ("x --robot sixbar --sample --name me", "r2s2r init x --name me --robot threebar --sample"),
        ("also --robot sixbar", "r2s2r init also-3 --robot sixbar"),
        ("also/file --robot sixbar", "r2s2r init also/file-2 --robot sixbar"),
    ],
)
def test_the_hint_fills_the_directory_that_was_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str, hint: str
) -> None:
    """Or one beside it that is free, where something is in the way; pasted, it makes a project."""
    monkeypatch.chdir(tmp_path)
    assert invoke("init", "also").exit_code == invoke("init", "also-2").exit_code == 0
    (tmp_path / "also/file").touch()
    refused = invoke("init", *shlex.split(typed))
    assert refused.exit_code == 2 and refused.stderr.splitlines()[-1] == f"hint: {hint}"
    assert not (tmp_path / "x").exists()
    assert invoke(*shlex.split(hint)[1:]).exit_code == 0


def test_beside_the_present_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No project inside the project that is in the way."""
    (tmp_path / "robot").mkdir()
    monkeypatch.chdir(tmp_path / "robot")
    assert invoke("init").exit_code == 0
    assert invoke("init").stderr.splitlines()[-1] == "hint: r2s2r init ../robot-2"
