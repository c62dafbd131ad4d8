"""What is free where nobody says so: winches by the time that they ran, however their commands were written down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.recipe import WINCH_DAMPING
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.task import Task, busy
from schemas.config import IdentifySettings
from tests.stages.measures.gait import run
from tests.support.robots import subject

ROBOT = subject().robot
FIRST = Request((Selection("walk", (1,)),))


def sent(rows: list[tuple[float, int, float]], *, sampled: bool = False) -> RunData:
    """A run whose first interval lasts 10 s, with commands (time as a share of it, winch, speed) that hold until the
    next row and end with it."""
    walk = run(2)
    begin, end = 0.0, 10.0
    intervals = replace(walk.intervals, t_first=np.array([begin, end]), t_last=np.array([end, 20.0]))
    control = np.zeros((len(rows), len(ROBOT.actuated)))
    for row, (_, winch, speed) in enumerate(rows):
        control[row, winch] = speed
    t = np.array([begin + share * (end - begin) for share, _, _ in rows])
    return replace(walk, t_command=t, control=control, intervals=intervals, sampled=sampled)


def test_time_counts_and_not_rows() -> None:
    """One row of 5 s against fifty of 10 ms each: the long one is the busy winch, the short ones are none."""
    blips = [(0.5 + 0.001 * k, 1, 1.0) for k in range(50)]
    walk = sent([(0.0, 0, 1.0), *blips, (0.55, 2, 0.0)])
    assert busy(ROBOT, [walk], FIRST) == (("in", ROBOT.actuated[0]),)


def test_each_way_has_its_own_share() -> None:
    """Out for 0.3 s after 4 s in is no rate of its own, for 1 s it is; the last row ends with the interval."""
    for seconds, ways in ((0.3, ["in"]), (1.0, ["in", "out"])):
        walk = sent([(0.0, 0, 1.0), (0.4, 0, -1.0), (0.4 + seconds / 10, 0, 0.0), (0.999, 3, 1.0)])
        assert busy(ROBOT, [walk], FIRST) == tuple((way, ROBOT.actuated[0]) for way in ways)


def test_half_speed_is_half_the_time() -> None:
    """A winch that runs at a quarter of the speed for as long as the busiest is left alone, at half it is not."""
    for speed, found in ((0.25, 1), (0.5, 2)):
        walk = sent([(0.0, 0, 1.0), (0.4, 1, speed), (0.8, 0, 0.0)])
        assert len(busy(ROBOT, [walk], FIRST)) == found


@pytest.mark.parametrize(
    ("asked", "given"),
    [
        ({}, {"damping_actuated": WINCH_DAMPING}),
        ({"free": ("+stiffness.6",)}, {"damping_actuated": WINCH_DAMPING}),
        ({"free": ("friction",)}, {}),
        ({"free": ("+damping_actuated",)}, {}),
        ({"free": ("+damping.0",)}, {}),
        ({"free": ("+damping.*",)}, {}),
        ({"fixed": {"damping_actuated": 4.0}}, {"damping_actuated": 4.0}),
        ({"method": "paper"}, {}),
    ],
)
def test_winches_do_not_follow_a_pull_unless_one_says_so(asked: dict[str, object], given: dict[str, float]) -> None:
    """Their damping goes with the default set, also with more beside it; not with a set of the user's own, nor where
    damping is free or fixed. Of the request or of the settings."""
    walk = sent([(0.0, 0, 1.0)])
    assert Task(ROBOT, [walk], replace(FIRST, **asked), IdentifySettings()).given == given  # type: ignore[arg-type]
    if free := asked.get("free"):
        assert Task(ROBOT, [walk], FIRST, IdentifySettings(free=free)).given == given  # type: ignore[arg-type]


def test_who_asked_for_a_number_is_told_that_it_has_no_effect() -> None:
    """Of the default set nobody did, also with more beside it; with a set of one's own everything is asked for."""
    walk = sent([(0.0, 0, 1.0)])
    (both, beside, own) = (
        Task(ROBOT, [walk], replace(FIRST, free=free), IdentifySettings()).of_default
        for free in ((), ("+stiffness.6",), ("friction",))
    )
    assert both == beside and f"motor_speed_in.{ROBOT.actuated[0]}" in both and "stiffness.6" not in both
    assert own == ()
