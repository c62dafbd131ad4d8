"""Behaviours that a user brings along."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.commands.plan_inputs import Asked
from r2s2r_cli.errors import UsageError
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


def test_a_behaviour_whose_gaits_would_be_called_as_ways_to_goals_is_refused(project: Path) -> None:
    """Two goals are gone to by `to-1` and `to-2`, as the gaits of a function `to` are called; one goal by `to`."""
    (project / "wish_to.py").write_text(MINE.replace("forward", "to"))
    here = Project.find(project)
    place = here.iteration(1, create=True)
    settings = here.config(place, {}).plan
    one = Asked(here, place, ("wish_to:to",), ("0.1,0,0",), 0)
    assert list(one.request(settings).goals) == ["to"]
    with pytest.raises(UsageError, match="ways to the goals"):
        Asked(here, place, ("wish_to:to",), ("0.1,0,0", "0.2,0,0"), 0).request(settings)


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


BROKEN = """
import math

import numpy as np


def boom(came):
    return math.sqrt(-1.0)


def nothing(came):
    return None


def word(came):
    return "far"


def hole(came):
    return np.where(np.arange(len(came)) < 2, np.nan, came.turn)


def short(came):
    return came.turn[1:]
"""


@pytest.mark.parametrize(
    ("function", "what", "where", "received"),
    [
        ("boom", "the reward fails", "wish_c.py, line 8", "ValueError"),
        ("nothing", "the reward gives no number for every gait", "--behaviour", "shape ()"),
        ("word", "the reward gives no numbers", "--behaviour", "str"),
        ("hole", "the reward gives no number for every gait", "--behaviour", "2 that are not finite"),
        ("short", "the reward gives no number for every gait", "--behaviour", "shape (4,)"),
    ],
)
def test_a_reward_that_is_wrong_is_told_by_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, function: str, what: str, where: str, received: str
) -> None:
    """It is the user's to mend, and no bug of ours."""
    (tmp_path / "wish_c.py").write_text(BROKEN)
    monkeypatch.syspath_prepend(str(tmp_path))
    came = rewards.Outcomes(np.zeros((5, 3)), *(np.zeros(5) for _ in range(5)))
    with pytest.raises(UsageError) as caught:
        rewards.reward_named(f"wish_c:{function}")(came)
    error = caught.value
    assert error.what == what and where in error.where and received in error.received
    assert error.expected == "5 finite numbers" and error.hint.startswith("--behaviour forward ")


@pytest.mark.parametrize(("text", "line"), [("x = 1\ny = (\n", 2), ("x = 1\n\ny = 1 / 0\n", 3)])
def test_a_file_of_a_reward_that_cannot_be_imported(project: Path, text: str, line: int) -> None:
    """Its line is said, with exit code 2."""
    (project / f"wish_d{line}.py").write_text(text)
    result = invoke("plan", "--behaviour", f"wish_d{line}:away", "--dry-run")
    assert result.exit_code == 2, result.stderr
    assert f"wish_d{line}.py, line {line}" in result.stderr and "Traceback" not in result.stderr


def test_a_name_that_no_gait_can_have(project: Path) -> None:
    """Said before the search, with exit code 2."""
    (project / "wish_e.py").write_text(MINE.replace("forward", "_forward"))
    result = invoke("plan", "--behaviour", "wish_e:_forward", "--dry-run")
    assert result.exit_code == 2, result.stderr
    assert "--behaviour wish_e:_forward" in result.stderr and "letter or digit" in result.stderr


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
