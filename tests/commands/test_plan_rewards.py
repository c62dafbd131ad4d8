"""Behaviours that a user brings along."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2s2r_cli.commands.plan_inputs import Asked
from r2s2r_cli.stages.plan import rewards
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document, invoke
from tests.commands.test_plan import PLAN, small

MINE = """
def forward(came):
    return came.com[:, 1] - 0.1 * abs(came.turn)
"""


def asked(project: Path, *behaviours: str) -> Asked:
    """A request of a plan."""
    here = Project.find(project)
    return Asked(here, here.iteration(1, create=True), behaviours, (), 0)


def test_the_file_of_a_reward_is_an_input(project: Path) -> None:
    """So that a plan is stale once it changes. One outside of the project, as an installed package, is none."""
    (project / "wish_a.py").write_text(MINE)
    (ref,) = asked(project, "wish_a:forward", "forward").refs()
    assert (ref.path, ref.kind) == ("wish_a.py", "file")
    assert asked(project, "tests.stages.plan.test_search:sideways").refs() == []


def test_a_reward_of_an_entry_point(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Named as its package registered it."""

    class Entry:
        name = "sideways"

        def load(self) -> object:
            """The function."""
            from tests.stages.plan.test_search import sideways

            return sideways

    monkeypatch.setattr(rewards, "entry_points", lambda group: [Entry()] if group == rewards.ENTRY_POINTS else [])
    assert invoke("plan", "--behaviour", "sideways", "--dry-run").exit_code == 0
    refused = invoke("plan", "--behaviour", "upwards", "--dry-run")
    assert refused.exit_code == 2 and "sideways" in refused.stderr


@pytest.mark.slow
def test_a_behaviour_of_ones_own_is_planned_beside_those_of_the_paper(project: Path) -> None:
    """Under a name of its own, though its function is called as one of them; the artifact validates. Another function
    makes it stale."""
    (project / "wish_b.py").write_text(MINE)
    words = small("--behaviour", "wish_b:forward", "--behaviour", "forward", "--no-draw")
    assert document(*words)["state"] == "done"
    assert invoke("validate", PLAN).exit_code == 0
    table = read_artifact(project / PLAN, "plan")[1].groups["primitives"]
    assert [name.decode() for name in table["name"]] == [
        "wish_b-forward-1", "wish_b-forward-2", "forward-1", "forward-2",
    ]  # fmt: skip
    assert document(*words)["state"] == "fresh"
    (project / "wish_b.py").write_text(MINE.replace("0.1", "0.2"))
    (reason,) = document(*words, "--dry-run")["reasons"]
    assert "wish_b.py" in reason
