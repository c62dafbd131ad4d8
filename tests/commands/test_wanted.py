"""What makes a comparison stale: settings of `simulate` that it uses, and none that it does not."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from r2s2r_cli.commands.wanted import wanted_again
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.staleness import reasons

SAMPLE = Path(__file__).resolve().parents[2] / "examples" / "sample-project" / "project"


@pytest.mark.parametrize(
    ("simulate", "stale"),
    [
        ("", ""), ("tail_s = 2.0", ""), ("step_s = 0.001", ""),
        ("step_s = 0.002", "setting compare.simulate.step_s was absent, is 0.002"),
        ("rod_contact = false", "setting compare.simulate.rod_contact was absent, is False"),
        ("frame_rate_hz = 25.0", "setting compare.simulate.frame_rate_hz was absent, is 25.0"),
    ],
)  # fmt: skip
def test_settings_of_the_simulation_decide_a_comparison(tmp_path: Path, simulate: str, stale: str) -> None:
    """One that was made with the defaults, before they were noted, is as fresh with them as it was."""
    root = tmp_path / "sample"
    shutil.copytree(SAMPLE, root)
    (root / "project.toml").write_text(
        f'schema_version = 1\nname = "a"\nrobot = "robot.toml"\n[simulate]\n{simulate}\n'
    )
    project = Project.find(root)
    place = project.iteration(2)
    header = read_header(place.artifact("comparison"))
    assert reasons(project, header, wanted_again(project, place, header.provenance)) == ([stale] if stale else [])
