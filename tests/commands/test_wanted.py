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
NOTED = {"step_s": 0.001, "frame_rate_hz": 50.0, "rod_contact": True}
CHANGES = [
    ("", ""), ("tail_s = 2.0", ""), ("step_s = 0.001", ""),
    ("step_s = 0.002", "setting compare.simulate.step_s was 0.001, is 0.002"),
    ("rod_contact = false", "setting compare.simulate.rod_contact was True, is False"),
    ("frame_rate_hz = 25.0", "setting compare.simulate.frame_rate_hz was 50.0, is 25.0"),
]  # fmt: skip


@pytest.mark.parametrize(("simulate", "stale"), CHANGES, ids=[text for text, _ in CHANGES])
def test_settings_of_the_simulation_decide_a_comparison(tmp_path: Path, simulate: str, stale: str) -> None:
    """Of one that was made with the defaults. One from before they were noted says nothing of them: it stays fresh."""
    root = tmp_path / "sample"
    shutil.copytree(SAMPLE, root)
    head = 'schema_version = 1\nname = "a"\nrobot = "robot.toml"\n'
    (root / "project.toml").write_text(f"{head}[simulate]\n{simulate}\n")
    project = Project.find(root)
    place = project.iteration(2)
    header = read_header(place.artifact("comparison"))
    made = header.provenance
    older = {name: value for name, value in made.settings.items() if name != "simulate"}
    for settings, expected in ((older, []), ({**older, "simulate": NOTED}, [stale] if stale else [])):
        told = header.model_copy(update={"provenance": made.model_copy(update={"settings": settings})})
        assert reasons(project, told, wanted_again(project, place, told.provenance)) == expected


def test_the_comparisons_of_the_sample_are_fresh() -> None:
    """They are part of the repository, and nothing of theirs is to change unseen."""
    project = Project.find(SAMPLE)
    for place in project.iterations():
        header = read_header(place.artifact("comparison"))
        assert reasons(project, header, wanted_again(project, place, header.provenance)) == []
