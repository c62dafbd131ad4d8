"""Effects of installed packages decide whether a diagnosis is fresh: it looks for them beside the catalogue's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.commands.wanted import wanted
from r2s2r_cli.installed import GROUP
from r2s2r_cli.store.project import Project


def test_an_installed_effect_makes_a_diagnosis_stale(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the version of its package, which may look for something else. No other stage looks for it by itself, and a
    diagnosis from before there were any stays as it was."""
    here = Project.find(project)

    def settings(stage: str) -> dict[str, Any]:
        return wanted(here, None, stage, {}, {}).settings

    before = {stage: settings(stage) for stage in ("diagnose", "identify")}
    assert "installed_effects" not in before["diagnose"]
    info = tmp_path / "windy" / "windy-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: windy\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\nside_wind = windy:SideWind\n")
    monkeypatch.syspath_prepend(str(info.parent))
    assert settings("diagnose") == {**before["diagnose"], "installed_effects": "side_wind (windy 1.0)"}
    assert settings("identify") == before["identify"]
