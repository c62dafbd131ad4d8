"""Online: what was known becomes a prior, and drifts."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.identify.before import specs_of
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.found import ParameterFound
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.free.base import Coordinate
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.online import (
    DRIFT,
    Known,
    _course,
    _dropped,
    by_run,
    drift_of,
    drifted,
    first_free,
    known_of,
    learned,
    update_of,
)
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.identify.twice import learned_twice
from schemas.config import IdentifySettings
from tests.stages.identify.planted import BOUNCE, SPEED, found
from tests.stages.measures.gait import run as walk
from tests.support.robots import subject

NAN = (math.nan, math.nan)
NOTHING: dict[str, Any] = {"train_segments": (), "test_segments": (), "test": None, "free_runs": ()}


def test_the_prior_is_what_was_known_and_the_drift() -> None:
    """sqrt(0.03^2 + 0.05^2) about the old value in a log coordinate, never wider than the first prior."""
    after = drifted(SPEED, Known({"motor_speed": 0.8}, {"motor_speed": 0.03}))
    assert after.start == 0.8 and after.prior_sd == pytest.approx(math.hypot(0.03, DRIFT))
    assert drifted(SPEED, Known({"motor_speed": 0.8}, {"motor_speed": 9.0})).prior_sd == SPEED.prior_sd
    assert drifted(BOUNCE, Known({}, {})) is BOUNCE


def test_a_value_on_a_bound_can_be_gone_on_from() -> None:
    """It is moved inside by a thousandth of the range."""
    after = drifted(SPEED, Known({"motor_speed": 2.0}, {"motor_speed": 0.1}))
    assert SPEED.lower < after.start < SPEED.upper


def test_a_linear_coordinate_drifts_by_a_share_of_its_width() -> None:
    """5 % of the smaller of the prior and a uniform one between the bounds."""
    slope = replace(SPEED, coordinate=Coordinate.LINEAR, lower=-0.6, upper=0.6, start=0.0, prior_sd=math.inf)
    assert drift_of(slope) == pytest.approx(0.05 * 1.2 / math.sqrt(12))
    assert drift_of(replace(slope, prior_sd=0.1)) == pytest.approx(0.005)


def test_what_an_artifact_knows() -> None:
    """The determined speed with the sd of its coordinate; nothing of the restitution, which keeps its prior."""
    known = known_of(identification(found()))
    assert known == Known({"motor_speed": 0.8}, {"motor_speed": 0.01})


def test_knowledge_that_is_not_used_is_told() -> None:
    """A number that was known, and now is neither free nor given, with the option that keeps it."""
    task = Task(subject().robot, (), Request(train=()), IdentifySettings())
    (text,) = _dropped(Known({"mass.1": 0.41}, {"mass.1": 0.1}), task, ())
    assert "mass.1" in text and "--fix mass.1=0.41" in text
    assert _dropped(Known({"mass.1": 0.41}, {"mass.1": 0.1}), task, select(("mass.1",), task.robot)) == ()


def test_what_was_free_is_free_again() -> None:
    """With the start, bounds and prior that it had, as a spec that can be read."""
    specs = specs_of(identification(found()), subject().robot)
    speed, bounce = select(tuple(specs.values()), subject().robot)
    assert (speed.name, speed.start, speed.lower, speed.upper, speed.prior_sd) == ("motor_speed", 1.0, 0.1, 2.0, 0.3)
    assert (bounce.name, bounce.start, bounce.upper) == ("restitution", 0.3, 0.95)


def test_what_was_gone_on_from_keeps_its_first_prior() -> None:
    """After --online the artifact has the last prior, the first one and what is known: the next one begins from what
    is known, though the last run determined none of it, and becomes as wide as the first again, not as the last."""
    first = (SPEED, BOUNCE)
    known = Known({"motor_speed": 0.8, "restitution": 0.4}, {"motor_speed": 0.04, "restitution": 0.06})
    last = tuple(
        ParameterFound(drifted(free, known), 0.5, 9.0, 0.1, 0.9, NAN, Trust.NOT_IDENTIFIABLE) for free in first
    )
    plain = {"information": None, "updates": (), "starts": (), "trace": (), "profiles": ()}
    before = identification(found(parameters=last, course=_course(first, known), **plain))
    assert before.groups["parameters"]["prior_sd"].max() < 0.2
    assert known_of(before) == known
    again = select(tuple(specs_of(before, subject().robot).values()), subject().robot)
    assert [free.mean for free in again] == [SPEED.mean, 0.4]  # a flat prior has no mean: it begins at the last start
    assert [free.prior_sd for free in again] == [0.3, select(("restitution",), subject().robot)[0].prior_sd]
    alone = identification(found(parameters=last, **plain))
    assert known_of(alone) == Known({}, {})


def test_a_winch_whose_likes_came_out_equal_can_be_gone_on_with() -> None:
    """Their scatter, which is its prior then, is 0: as a prior that was asked for, that is refused."""
    (free,) = select((f"motor_speed_in.{subject().robot.actuated[0]}",), subject().robot)
    held = ParameterFound(replace(free, prior_sd=0.0), free.start, 0.0, 0.0, 0.0, NAN, Trust.NOT_IDENTIFIABLE)
    before = identification(found(parameters=(held,), information=None, updates=(), starts=(), trace=(), profiles=()))
    (again,) = select(tuple(specs_of(before, subject().robot).values()), subject().robot)
    assert (again.start, again.prior_sd) == (free.start, free.prior_sd)


@pytest.mark.parametrize("name", ["damping", "damping_actuated"])
def test_a_damping_that_was_free_is_free_again(name: str) -> None:
    """And not given beside it, as it is with the default set: the same number would be free and fixed."""
    free = select((f"{name}=4,1..40,~0.3", "friction"), subject().robot)
    known = tuple(ParameterFound(one, one.start, 0.1, 3.0, 5.0, NAN, Trust.IDENTIFIED) for one in free)
    before = identification(found(parameters=known, information=None, updates=(), starts=(), trace=(), profiles=()))
    request = Request((Selection("line", (1,)),), online=True, before=before)
    task = Task(subject().robot, (), request, IdentifySettings())
    again = first_free(task)
    assert {one.name for one in again} == {name, "friction"}
    assert task.given == {}
    assert task.predictor(again).mapping.names == tuple(one.name for one in again)


@pytest.mark.parametrize(
    ("asked", "given"),
    [
        ({}, {"damping_actuated": 40.0, "stiffness.6": 300.0}),
        ({"free": ("+stiffness.6",)}, {"damping_actuated": 40.0}),
        ({"free": ("+stiffness.7",)}, {"damping_actuated": 40.0, "stiffness.6": 300.0}),
        ({"free": ("friction",)}, {}),
        ({"fixed": {"stiffness.6": 250.0}}, {"damping_actuated": 40.0, "stiffness.6": 250.0}),
    ],
)
def test_what_was_given_is_given_again(asked: dict[str, Any], given: dict[str, float]) -> None:
    """By hand or with the default set, where nobody says what is free now; and nothing else is: what an earlier fit
    of friction alone left at robot.toml's value stays there."""
    robot = subject().robot
    friction, *fixed = select(("friction", "damping_actuated=40", "stiffness.6=300"), robot)
    known = [ParameterFound(friction, 0.5, 0.1, 0.4, 0.6, NAN, Trust.IDENTIFIED)]
    own = [ParameterFound(one, one.start, *NAN[:1] * 3, NAN, None, "fixed by hand") for one in fixed]
    plain = {"information": None, "updates": (), "starts": (), "trace": (), "profiles": ()}
    for parameters, expected in ((known + own, given), (known, asked.get("fixed", {}))):
        before = identification(found(parameters=tuple(parameters), **plain))
        request = Request((Selection("line", (1,)),), online=True, before=before, **asked)
        task = Task(robot, (), request, IdentifySettings())
        assert task.given == expected
        assert not {one.free.name for one in task.fixed()} ^ set(expected)


def test_a_run_that_shows_nothing_changes_nothing_but_the_width() -> None:
    """The speed is learned, though the run alone is too short to report it; the restitution stays what it was and
    drifts on; its update has no sd."""
    frees = (replace(SPEED, start=0.9, prior_sd=0.1), replace(BOUNCE, start=0.4, prior_sd=0.2))
    sure: Any = SimpleNamespace(
        parameters=(
            ParameterFound(frees[0], 0.8, 0.016, 0.77, 0.83, NAN, Trust.NOT_IDENTIFIABLE, "too few windows"),
            ParameterFound(frees[1], 0.7, 0.3, 0.1, 0.9, NAN, Trust.NOT_IDENTIFIABLE),
        ),
        spread=SimpleNamespace(covariance=np.diag([4e-4, 0.04])),
        after=SimpleNamespace(trust=(Trust.IDENTIFIED, Trust.NOT_IDENTIFIABLE)),
    )
    before = Known({"motor_speed": 0.9, "restitution": 0.4}, {"motor_speed": 0.08, "restitution": 0.19})
    after = learned(before, frees, sure)
    assert after.value == {"motor_speed": 0.8, "restitution": 0.4}
    assert after.sd_z == pytest.approx({"motor_speed": 0.02, "restitution": 0.2})
    update = update_of("two", frees, sure)
    assert update.value.tolist() == [0.8, 0.4] and update.sd[0] == 0.016 and np.isnan(update.sd[1])


def test_runs_are_taken_one_after_the_other() -> None:
    """In the order in which they are named first, each once."""
    train = (Selection("b", (3,)), Selection("a", (1, 2)), Selection("b", (1,)))
    assert by_run(train) == (Selection("b", (1, 3)), Selection("a", (1, 2)))


def test_a_run_is_learned_from_once() -> None:
    """Under whatever name: frames of a training interval count twice, those that were only tested do not, and another
    run of the same gait, with noise of its own, is new."""
    before = identification(found())
    line = [segment.step for segment in (*found().train_segments, *found().test_segments)]
    t, p_WE = (np.concatenate([getattr(step, name) for step in line]) for name in ("t", "p_WE"))
    ends = np.cumsum([len(step.t) for step in line])
    starts = ends - len(line[0].t)
    table = replace(walk(4).intervals, first=starts, last=ends - 1)
    same_run = replace(walk(4), name="002-line", t=t, observed=p_WE, intervals=table)
    other = replace(same_run, name="other", observed=p_WE + 1e-9)
    for intervals, twice in (((2, 3), ("002-line",)), ((4,), ())):
        train = (Selection("002-line", intervals), Selection("other", intervals))
        assert learned_twice(before, [same_run, other], train) == twice
    assert learned_twice(identification(found(**NOTHING)), [same_run], (Selection("002-line", (1,)),)) == ()
