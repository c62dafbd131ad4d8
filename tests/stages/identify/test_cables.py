"""How much the winched cables give way is what the training intervals say, and only where nobody else has said it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify import cables
from r2s2r_cli.stages.identify.cables import with_cables
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.recipe import default_fixed
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.task import Task
from schemas.config import IdentifySettings
from tests.stages.identify.replayed import walk
from tests.support.engine import threebar

SOFTER = tuple(default_fixed(threebar()).items())
TRAIN = (Selection("walk", (1, 2, 3)),)


def task(cache: Path | None = None, **request: object) -> Task:
    """A fit of a walk of 3 intervals with 1 mm of noise, of a robot as robot.toml says."""
    run = walk(3, noise=1e-3, seed=5)
    return Task(threebar(), [run], Request(TRAIN, **request), IdentifySettings(), cache)  # type: ignore[arg-type]


@pytest.mark.slow
def test_cables_that_are_as_robot_toml_says_stay(tmp_path: Path) -> None:
    """Planted as robot.toml has them; the fit goes on with what was tried."""
    found = with_cables(task(tmp_path))
    assert found.stock and found.given == {}
    assert found.near is not None and found.near.rollouts > 0 and np.isfinite(found.near.solution.cost)


@pytest.mark.parametrize(
    ("costs", "softer", "last"),
    [
        ((100.0, 130.0), True, 0),  # softer ones fit clearly better
        ((100.0, 105.0, 99.0), False, 1),  # by less than robot.toml is worth
        ((200.0, 100.0, 80.0), True, 2),  # begun again, as the others were
        ((200.0, 100.0, 95.0), False, 1),
        ((None, 100.0, None), False, 1),  # not to be simulated
        ((100.0, None), True, 0),
    ],
)
def test_softer_cables_must_fit_clearly_better(
    monkeypatch: pytest.MonkeyPatch, costs: tuple[float | None, ...], softer: bool, last: int
) -> None:
    """Softer ones first, then those of robot.toml from there, then perhaps softer ones from there: whose fit it is."""
    made: list[SimpleNamespace | None] = []
    begun: list[object] = []

    def near(task: Task, other: object = None) -> SimpleNamespace | None:
        assert task.stock is (len(made) == 1)
        cost = costs[len(made)]
        made.append(None if cost is None else SimpleNamespace(solution=SimpleNamespace(cost=cost)))
        begun.append(other)
        return made[-1]

    monkeypatch.setattr(cables, "_near", near)
    found = with_cables(task())
    assert len(made) == len(costs) and begun == [None, *made[:-1]]
    assert found.stock is not softer
    assert found.near is made[last]


def test_none_that_can_be_simulated_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit 6."""
    monkeypatch.setattr(cables, "_near", lambda *_: None)
    with pytest.raises(NumericalError, match="cannot be simulated"):
        with_cables(task())


@pytest.mark.parametrize(
    "request_",
    [{"free": ("friction",)}, {"fixed": dict(SOFTER)}, {"free": ("+stiffness_actuated", "+damping_actuated")}],
)
def test_who_names_them_decides(request_: dict[str, object]) -> None:
    """Nothing is simulated: the task has no run that could be."""
    asked = task(**request_)
    assert with_cables(asked) is asked


@pytest.mark.parametrize("softer", [False, True])
def test_online_keeps_what_the_last_estimate_was_made_with(softer: bool) -> None:
    """Its fixed numbers tell."""
    names = [name.encode() for name, _ in SOFTER] if softer else [b"friction"]
    table = Group({"name": np.array(names), "trust": np.full(len(names), 4 if softer else 0, np.uint8)})
    before = ArtifactData("identification", {"parameters": table})
    assert with_cables(task(online=True, before=before)).stock is not softer
