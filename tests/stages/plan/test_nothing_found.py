"""A search that finds no gait ends with none, and is no crash: the stage says it in its own words."""

from __future__ import annotations

import copy

import numpy as np
import pytest

from r2s2r_cli.stages.plan.choose import shortlist
from r2s2r_cli.stages.plan.rewards import BEHAVIOURS, Outcomes
from r2s2r_cli.stages.plan.search import Found, Search, SearchSettings
from tests.stages.plan.planted import bench


def searched(settings: SearchSettings, *, ticks: int | None = None) -> Found:
    """Of the paper's robot. ticks: after so many a target is given up."""
    executor, reference, at = bench()
    executor = copy.copy(executor)
    executor.timeout = executor.timeout if ticks is None else ticks
    return Search(executor, reference, at, BEHAVIOURS, settings).found()


def never_asked(came: Outcomes) -> np.ndarray:
    """A reward that a largest of nothing would fail."""
    return came.com[:, 1] - came.com[:, 1].max()


@pytest.mark.parametrize("depth", [2, 3])
def test_every_target_given_up(depth: int) -> None:
    """Time for no target: everything is lost at the first level, and the shortlist of every behaviour is empty."""
    found = searched(SearchSettings(depth=depth, most_changed=1), ticks=3)
    assert found.gaits == [] and found.lost == found.simulated == 6
    assert shortlist(found, {**BEHAVIOURS, "own": never_asked}, 8) == {name: [] for name in [*BEHAVIOURS, "own"]}


def test_no_gait_near_enough_to_the_rest_pose() -> None:
    """Gaits that all end too far from rest are none: empty shortlists."""
    found = searched(SearchSettings(depth=2, most_changed=1, rest_error_m=1e-9))
    assert found.gaits == [] and found.lost == 0
    assert shortlist(found, BEHAVIOURS, 8) == {name: [] for name in BEHAVIOURS}


def test_no_robots_are_run_as_any_others() -> None:
    """Robots of a level that has none: as many targets as asked for, and nobody at any of them."""
    executor, _, at = bench()
    run = executor.run(at.take(np.zeros(0, dtype=int)), np.zeros((0, 2, 6)))
    assert len(run.ends) == 2 and len(run.last) == len(run.sound) == len(run.total) == 0
