"""Which simulations are the same: whatever one depends on makes another question of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.compare.opening import Opening
from r2s2r_cli.stages.compare.predicted import PredictedRun
from r2s2r_cli.stages.compare.remembered import question
from r2s2r_cli.stages.compare.runs import RealRun, real_runs
from r2s2r_cli.stages.identified import Identified, identified, nominal
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.free.mapping import Mapping
from r2s2r_cli.stages.measures.keyframes import KeyframeErrors
from r2s2r_cli.stages.segments import segments
from schemas.config import SimulateSettings
from tests.support import builders
from tests.support.identified import identification

ROBOT = builders.robot()
Asked = tuple[Identified, RealRun, SimulateSettings]


@pytest.fixture(scope="module")
def asked() -> Asked:
    """An identified simulator and a run with commands."""
    data = builders.estimate()
    data.groups["runs/walk/intervals"]["complete"][:] = True
    data.groups["runs/walk/intervals"]["target"][0, 0] = 0.5
    (run,), _ = real_runs(data, None, ROBOT, iteration=1)
    walk = run.walk
    zero, moved = np.zeros_like(walk.p_WE), np.ones_like(walk.p_WE)
    commands = RunData(
        "walk", walk.t, walk.p_WE, zero[0], walk.p_WE, zero, moved, zero, zero[..., 0], walk.t, zero[:, :, 0],
        moved[:, :, 0], walk.intervals, segments(walk.intervals, walk.t),
    )  # fmt: skip
    run = replace(run, data=commands)
    return identified(identification(ROBOT), ROBOT), run, SimulateSettings()


def number(values: np.ndarray) -> np.ndarray:
    """The last bit of the first one is another."""
    found = values.copy()
    found.flat[0] = np.nextafter(found.flat[0], np.inf)
    return found


def with_effect(model: Identified) -> Identified:
    """The same numbers, with a law more."""
    return replace(model, mapping=Mapping(ROBOT, model.mapping.frees, ("payload",)))


def held(model: Identified) -> Identified:
    """With a number that was given."""
    return replace(model, mapping=Mapping(ROBOT, model.mapping.frees, fixed={"motor_lag": 0.05}))


def commanded(run: RealRun) -> RealRun:
    """A motor command is another."""
    assert run.data is not None
    return replace(run, data=replace(run.data, control=number(run.data.control)))


MODELS: dict[str, Callable[[Identified], Identified]] = {
    "the robot": lambda m: replace(m, robot=ROBOT.model_copy(update={"name": "other"})),
    "a number": lambda m: replace(m, values=number(m.values)),
    "none of them": lambda m: nominal(ROBOT),
    "an effect": with_effect,
    "a number that is given": held,
    "a sensor": lambda m: replace(m, bias=np.full(6, 1e-3)),
    "the delay": lambda m: replace(m, command_delay=0.02),
}
RUNS: dict[str, Callable[[RealRun], RealRun]] = {
    "its name": lambda r: replace(r, name="crawl"),
    "its start": lambda r: replace(r, walk=replace(r.walk, p_WE=number(r.walk.p_WE))),
    "its targets": lambda r: replace(r, targets=replace(r.targets, target=number(r.targets.target))),
    "its opening": lambda r: replace(r, opening=Opening(1)),
    "no commands": lambda r: replace(r, data=None),
    "a command": commanded,
}
SETTINGS = ({"step_s": 0.002}, {"frame_rate_hz": 25.0}, {"rod_contact": False})


@pytest.mark.parametrize("change", MODELS.values(), ids=MODELS.keys())
def test_another_simulator_is_another_question(asked: Asked, change: Callable[[Identified], Identified]) -> None:
    """To the last bit, and with what is measured beside the fit."""
    model, run, settings = asked
    assert question(change(model), run, settings) != question(model, run, settings)


@pytest.mark.parametrize("change", RUNS.values(), ids=RUNS.keys())
def test_another_run_is_another_question(asked: Asked, change: Callable[[RealRun], RealRun]) -> None:
    """By what was given to the robot and by what was seen of it."""
    model, run, settings = asked
    assert question(model, change(run), settings) != question(model, run, settings)


@pytest.mark.parametrize("changed", SETTINGS, ids=lambda one: next(iter(one)))
def test_other_settings_are_another_question(asked: Asked, changed: dict[str, float]) -> None:
    """All that a comparison borrows of `simulate`."""
    model, run, settings = asked
    assert question(model, run, settings.model_copy(update=changed)) != question(model, run, settings)


def test_read_anew_it_is_the_same_question(asked: Asked) -> None:
    """Also under another name: where its numbers come from does not change them."""
    model, run, settings = asked
    other = identified(identification(ROBOT), ROBOT, words="elsewhere/30-identify.h5")
    assert question(other, replace(run), SimulateSettings()) == question(model, run, settings)


KEY = KeyframeErrors(np.array([[1e-4, 2e-4], [np.nan, np.nan]]))


@pytest.mark.parametrize("walked", [True, False])
@pytest.mark.parametrize("key", [KEY, None])
@pytest.mark.parametrize("warnings", [(), ("the simulation gave up targets 2", "α: not replayed")])
def test_whatever_became_of_a_run_comes_back(
    asked: Asked, walked: bool, key: KeyframeErrors | None, warnings: tuple[str, ...]
) -> None:
    """In part, not at all, and in words."""
    run = asked[1]
    walk = run.walk.first(1) if walked else None
    found = PredictedRun(run.name, walk, walk, key, warnings)
    again = PredictedRun.from_arrays(run, found.to_arrays())
    assert (again.run, again.warnings) == (run.name, warnings)
    assert (again.walk is None, again.real is None, again.keyframes is None) == (not walked, not walked, key is None)
    if key is not None and again.keyframes is not None:
        assert again.keyframes.squared.tobytes() == key.squared.tobytes()
    if walk is not None and again.walk is not None and again.real is not None:
        for one in (again.walk, again.real):
            assert one.p_WE.tobytes() == walk.p_WE.tobytes() and len(one.intervals) == 1
