"""How much the winched cables give way is what the training intervals say, and only where nobody else has said it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
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


def task(cache: Path | None = None, *, softer: bool = False, **request: object) -> Task:
    """A fit of a walk of 3 intervals with 1 mm of noise, of a robot as robot.toml says or with softer cables."""
    run = walk(3, values=SOFTER if softer else (), noise=1e-3, seed=5)
    return Task(threebar(), [run], Request(TRAIN, **request), IdentifySettings(), cache)  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("softer", [False, True])
def test_the_cables_that_the_robot_has_are_found(tmp_path: Path, softer: bool) -> None:
    """Planted both ways; what is given to the fit is what was planted."""
    found = with_cables(task(tmp_path, softer=softer))
    assert found.stock is not softer
    assert found.given == (dict(SOFTER) if softer else {})
    assert found.near is not None and found.near.rollouts > 0 and np.isfinite(found.near.solution.cost)


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
