"""Every method and drive on a planted run: it finds what was planted, or says that it does not go together."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.commands.identify_inputs import Asked
from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.stages.identify import held_out as judge
from r2s2r_cli.stages.identify.closed_method import closed_problem
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.found import Found, ParameterFound
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.identify import find
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.self_tested import self_tested
from r2s2r_cli.stages.identify.task import Task, require_combination
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.store.project import Project
from schemas.config import IdentifySettings
from tests.stages.identify.planted import SPEED as SPEED_FREE, found as planted
from tests.support.layouts import same
from tests.support.simulated_log import SPEED, simulated_project

GAIT = """\
schema_version = 1
robot = "threebar"
name = "gait"
[[steps]]
target = [1.0, 0.6, 1.0, 1.0, 0.7, 1.0]
[[steps]]
target = [0.7, 1.0, 1.0, 0.7, 1.0, 1.0]
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
"""
TOLD = 0.55
ANY = Request((Selection("gait", (1, 2)),))


class Kept:
    """A checkpoint in memory that stops the fit after so many saves, or generations, as Ctrl-C would."""

    def __init__(self, stop_after: int = 0, generations: int = 0) -> None:
        self.left, self.generations = stop_after, generations
        self.text: str | None = None

    def load(self) -> dict[str, Any] | None:
        """What was saved last."""
        return None if self.text is None else dict(json.loads(self.text))

    def save(self, values: Any) -> None:
        """As JSON, which keeps every bit."""
        self.text = json.dumps(values, allow_nan=False)
        self.left -= 1
        if not self.left or len(values.get("generations", ())) == self.generations > 0:
            raise KeyboardInterrupt


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> Task:
    """A log of the engine's own robot, estimated; robot.toml is then a third too slow, and friction known."""
    root = tmp_path_factory.mktemp("methods") / "robot"
    simulated_project(root, GAIT, told=TOLD)
    project = Project.find(root)
    asked = Asked(project, project.iteration(1, create=False), train=("gait:1-2",), free=("motor_speed",))
    runs = asked.runs()
    settings = IdentifySettings(starts=1, profiles=0)
    return Task(project.robot(), runs, asked.request(runs, settings), settings, project.cache)


@pytest.fixture
def no_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rivals are fits of their own, which other tests look at."""
    monkeypatch.setattr(judge, "_rivals", lambda *arguments: ({}, 0, []))


def found_by(task: Task, *, checkpoint: Kept | None = None, iterations: int = 40, **request: Any) -> Found:
    """What one request finds."""
    settings = task.settings.model_copy(update={"max_iterations": iterations})
    return find(task.robot, task.runs, replace(task.request, **request), settings, cache_dir=task.cache_dir,
                checkpoint=checkpoint)  # fmt: skip


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        ({"method": "cma", "drive": "closed loop"}, "--drive closed-loop"),
        ({"method": "paper", "online": True}, "identify --online"),
        ({"method": "cma", "online": True}, "identify --online"),
        ({"drive": "closed loop", "online": True}, "identify --online"),
    ],
)
def test_what_does_not_go_together_is_refused(options: dict[str, Any], hint: str) -> None:
    """Exit code 2, never another fit than was asked for."""
    with pytest.raises(UsageError) as refused:
        require_combination(replace(ANY, **options))
    assert refused.value.exit_code == 2 and hint in str(refused.value.hint)


@pytest.mark.parametrize("options", [{"method": "paper"}, {"method": "cma"}, {"drive": "closed loop"}])
def test_the_self_test_is_of_the_default_fit(options: dict[str, Any]) -> None:
    """It does not stand for a method that it does not run."""
    robot: Any = None
    with pytest.raises(UsageError, match="self-test"):
        self_tested(robot, (), replace(ANY, **options), IdentifySettings())


def test_online_needs_something_to_go_on_from() -> None:
    """Without an earlier identification: bad input, and how to make the first."""
    robot: Any = None
    with pytest.raises(InputError, match="go on from"):
        find(robot, (), replace(ANY, online=True), IdentifySettings())


@pytest.mark.slow
def test_the_paper_in_closed_loop(task: Task, no_rivals: None) -> None:
    """Adam nears the planted speed and says no interval; interrupted and resumed it makes the same steps."""
    whole = found_by(task, method="paper", drive="closed loop", iterations=6)
    (speed,) = whole.parameters
    assert abs(speed.value - SPEED) < abs(TOLD - SPEED) / 2
    assert speed.trust is Trust.WEAK and np.isnan(speed.interval).all() and "no uncertainty" in speed.reason
    assert whole.covariance is None and whole.mask is not None and "segments kept" in whole.mask
    assert [step.iteration for step in whole.trace] == [1, 2, 3, 4, 5, 6]
    kept = Kept(stop_after=3)
    with pytest.raises(KeyboardInterrupt):
        found_by(task, checkpoint=kept, method="paper", drive="closed loop", iterations=6)
    again = found_by(task, checkpoint=kept, method="paper", drive="closed loop", iterations=6)
    assert [step.cost for step in again.trace] == [step.cost for step in whole.trace]
    assert again.mask == whole.mask


@pytest.mark.slow
def test_the_paper_on_recorded_commands(task: Task, no_rivals: None) -> None:
    """Durations are given there: the mask says that it is not applicable."""
    made = found_by(task, method="paper", iterations=2)
    assert made.mask is not None and "not applicable" in made.mask
    assert identification(made).groups["fit"].attributes["drive"] == "command replay"


@pytest.mark.slow
def test_the_closed_loop_finds_the_speed(task: Task, no_rivals: None) -> None:
    """Residuals vanish within their sd at the planted speed, and the fit comes back to it."""
    problem = closed_problem(replace(task, request=replace(task.request, drive="closed loop")))
    at = {speed: np.abs(problem.batch(np.log([[speed]]))[0]).max() for speed in (TOLD, SPEED)}
    assert at[SPEED] < 1.5 and at[TOLD] > 2.0
    made = found_by(task, drive="closed loop", iterations=4)
    (speed,) = made.parameters
    assert abs(speed.value - SPEED) < 0.03 * SPEED
    assert made.request.drive == "closed loop" and "controller in the loop" in made.loss


@pytest.mark.slow
def test_gains_are_free_in_closed_loop_only(task: Task, no_rivals: None) -> None:
    """The tolerance decides when a target is reached, and so does a delay between the controller and its winches."""
    problem = closed_problem(replace(task, request=replace(task.request, free=("pid_tolerance",), drive="closed loop")))
    step = problem.evaluate(problem.z0, jacobian=True)
    assert step.jacobian is not None and np.abs(step.jacobian).max() > 1.0
    late = closed_problem(
        replace(task, request=replace(task.request, free=("command_delay=0.1,0..0.5",), drive="closed loop"))
    )
    at, after = late.batch(np.array([[0.1], [0.2]]))
    assert np.abs(after - at).max() > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("stop_after", [2, 5])
def test_an_interrupted_fit_leaves_the_same_artifact(task: Task, no_rivals: None, stop_after: int) -> None:
    """Trace and all: the content of the artifact does not say that the fit was taken up again."""
    whole, kept = identification(found_by(task, iterations=4)), Kept(stop_after)
    with pytest.raises(KeyboardInterrupt):
        found_by(task, checkpoint=kept, iterations=4)
    again = identification(found_by(task, checkpoint=kept, iterations=4))
    assert len(again.groups["trace"]["cost"]) > stop_after
    assert same(again, whole)


@pytest.mark.slow
def test_an_interrupted_cma_leaves_the_same_artifact(task: Task, no_rivals: None) -> None:
    """Stopped at its third generation: the fit before it is not made twice, nor are its samples simulated again."""
    whole, kept = identification(found_by(task, method="cma", iterations=1)), Kept(generations=3)
    with pytest.raises(KeyboardInterrupt):
        found_by(task, checkpoint=kept, method="cma", iterations=1)
    assert len((kept.load() or {})["generations"]) == 3
    kept.generations = 0
    again = identification(found_by(task, checkpoint=kept, method="cma", iterations=1))
    assert same(again, whole)


@pytest.mark.slow
def test_cma_says_which_of_the_two_won(task: Task, no_rivals: None) -> None:
    """Both fits stand among the starts, and the cost is that of the better."""
    made = found_by(task, method="cma", iterations=1)
    assert len(made.starts) == 2 and "CMA-ES" in made.starts[1].reason
    assert made.cost <= min(one.cost for one in made.starts)
    assert abs(made.parameters[0].value - SPEED) < 0.03 * SPEED
    assert any(text.startswith("CMA-ES reached") for text in made.warnings)


@pytest.mark.slow
def test_online_goes_on_run_after_run(task: Task, no_rivals: None) -> None:
    """From 0.7 +- 0.03 two runs at 0.8: both move it there; interrupted after the first it goes on."""
    speed = ParameterFound(SPEED_FREE, 0.7, 0.02, 0.66, 0.74, (math.nan, math.nan), Trust.IDENTIFIED)
    before = identification(planted(parameters=(speed, planted().parameters[1]), covariance=np.diag([9e-4, 1e-2])))
    (run,) = task.runs
    two = replace(task, runs=(run, replace(run, name="later")),
                  request=replace(task.request, train=(ANY.train[0], Selection("later", (1, 2))), test=()))  # fmt: skip
    kept = Kept(stop_after=1)
    with pytest.raises(KeyboardInterrupt):
        found_by(two, checkpoint=kept, iterations=3, online=True, before=before)
    made = found_by(two, checkpoint=kept, iterations=3, online=True, before=before)
    whole = found_by(two, iterations=3, online=True, before=before)
    assert same(identification(made), identification(whole))
    assert {step.stage.split(",")[0] for step in made.trace} == {"gait", "later"}
    first, second = (one.value[0] for one in made.updates)
    assert first > 0.7 and abs(second - SPEED) < 0.05 * SPEED
    assert made.parameters[0].free.start == first
    assert made.parameters[0].free.prior_sd >= 0.05
    assert identification(made).groups["history"]["run"].tolist() == [b"gait", b"later"]
