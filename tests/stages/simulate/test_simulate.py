"""Runs through the real engine: what they obey, how they start and end, and how errors are told."""

from __future__ import annotations

import math
from importlib import import_module
from typing import NamedTuple

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.engine import EngineInputError, NonFiniteError
from r2s2r_cli.errors import InputError, NumericalError, UsageError
from r2s2r_cli.stages.simulate import Request, Start, parts, simulate
from r2s2r_cli.stages.simulate.drive import Driver
from r2s2r_cli.stages.simulate.frames import stored_rows
from r2s2r_cli.stages.simulate.replay import Replay
from schemas.config import SimulateSettings
from schemas.policy import PolicyFile
from schemas.results_simulate import SimulateReport
from tests.support import builders

STEPS = ({"target": (1.0, 0.5, 1.0, 1.0, 1.0, 0.5)}, {"target": (1.0,) * 6, "hold_s": 0.1},
         {"target": (0.3, 1.0, 1.0, 1.0, 1.0, 1.0), "timeout_s": 0.2})  # fmt: skip
POLICY = PolicyFile.model_validate({"schema_version": 1, "robot": "threebar", "name": "bend", "steps": STEPS})


class Made(NamedTuple):
    """A policy in closed loop and the replay of its own commands from the same start."""

    data: ArtifactData
    report: SimulateReport
    seen: dict[str, list[int]]


@pytest.fixture(scope="module")
def made() -> Made:
    """Two runs for all tests here."""
    robot, settings = builders.robot(), SimulateSettings()
    first, _ = simulate(robot, [Request(POLICY)], settings)
    commands = first.groups["runs/bend/commands"]
    t = commands["t"]
    replay = Replay("bend", t, commands["target"], commands["control"], 0.0, float(t[-1]) + 0.02, 0)
    seen: dict[str, list[int]] = {}

    def progress(name: str, done: int) -> None:
        seen.setdefault(name, []).append(done)

    data, report = simulate(robot, [Request(POLICY), Request(replay)], settings, progress=progress)
    return Made(data, report, seen)


def test_the_controller_brings_every_cable_to_its_target(made: Made) -> None:
    """At the end of each target that was not given up all cables were within the tolerance when they stopped."""
    intervals, commands = made.data.groups["runs/bend/intervals"], made.data.groups["runs/bend/commands"]
    robot = builders.robot()
    for last in intervals["last"][:2]:
        assert commands["done"][last].all()
    k = intervals["last"][0]
    position = (made.data.groups["runs/bend/frames"]["length"][k, :6] - robot.pid.min_length_m) / robot.pid.range_m
    assert abs(position - np.array(STEPS[0]["target"])).max() < robot.pid.tolerance + 0.05


def test_targets_follow_the_policy(made: Made) -> None:
    """The intervals have the targets of the policy in order, and the one that timed out is named."""
    intervals = made.data.groups["runs/bend/intervals"]
    assert intervals["target"].tolist() == [list(step["target"]) for step in STEPS]  # type: ignore[call-overload]
    run = made.report.runs[0]
    assert (run.targets, run.timed_out) == (3, (3,))
    assert "given up" in run.warnings[0]
    assert intervals["t_last"][2] - intervals["t_first"][2] == pytest.approx(0.2)


def test_commands_reel_in_what_is_too_long(made: Made) -> None:
    """While a motor runs at +1 its cable gets shorter; the rest length follows at the winding speed."""
    frames, commands = made.data.groups["runs/bend/frames"], made.data.groups["runs/bend/commands"]
    motor = builders.robot().motors[1]
    speed = motor.no_load_rad_per_s * motor.speed * motor.winch_radius_m
    full = np.flatnonzero(commands["control"][:, 1] == 1)
    assert len(full) > 5
    change = frames["rest_length"][full + 1, 1] - frames["rest_length"][full, 1]
    assert change == pytest.approx(-speed * 0.02, rel=1e-9)


def test_a_replay_of_the_commands_repeats_the_run(made: Made) -> None:
    """The commands of the closed loop, replayed from the same start, give the same states."""
    closed, replayed = (made.data.groups[f"runs/{run}/frames"] for run in ("bend", "bend-replay"))
    n = min(len(closed["t"]), len(replayed["t"]))
    assert n == len(closed["t"])
    for name in ("p_WE", "length", "tension"):
        assert replayed[name][:n] == pytest.approx(closed[name][:n], abs=1e-9)
    assert made.report.runs[1].control == "command replay"
    assert made.report.runs[1].targets == 0


def test_states_are_states_of_the_robot(made: Made) -> None:
    """Rods keep their length, no cable pushes, no cap is in the ground, the start rests on three caps."""
    frames = made.data.groups["runs/bend/frames"]
    robot = builders.robot()
    rods = np.linalg.norm(frames["p_WE"][:, 1::2] - frames["p_WE"][:, 0::2], axis=-1)
    assert rods == pytest.approx(np.broadcast_to([rod.length_m for rod in robot.rods], rods.shape), abs=1e-9)
    assert (frames["tension"] >= 0).all()
    assert made.report.runs[0].penetration_max_m < 1e-4
    assert frames["contact"][0].sum() == 3
    assert abs(frames["v_WR"][0]).max() < 1e-3
    assert made.report.runs[0].start_shift_m < 0.02


def test_poses_caps_and_lengths_agree(made: Made) -> None:
    """Middles of rods lie between their caps, and lengths are between the caps of each cable."""
    frames = made.data.groups["runs/bend/frames"]
    p_WE, ends = frames["p_WE"], np.array([cable.caps for cable in builders.robot().cables])
    assert frames["p_WR"] == pytest.approx((p_WE[:, 0::2] + p_WE[:, 1::2]) / 2, abs=1e-12)
    length = np.linalg.norm(p_WE[:, ends[:, 1]] - p_WE[:, ends[:, 0]], axis=-1)
    assert frames["length"] == pytest.approx(length, abs=1e-12)
    assert frames["v_WR"][1:-1] == pytest.approx((frames["p_WR"][2:] - frames["p_WR"][:-2]) / 0.04, abs=0.05)


def test_progress_goes_through_all_parts(made: Made) -> None:
    """Targets of the policy, seconds of the replay: reported in order, to the last."""
    for run, last in (("bend", parts(Request(POLICY))), ("bend-replay", math.ceil(made.report.runs[1].duration_s))):
        assert made.seen[run] == sorted(made.seen[run])
        assert made.seen[run][-1] == last
    assert parts(Request(POLICY)) == 3


def test_the_report_recomputes(made: Made) -> None:
    """Displacement, path and highest cap follow from the stored frames."""
    run, frames = made.report.runs[0], made.data.groups["runs/bend/frames"]
    com = frames["p_WR"].mean(axis=1)  # equal rods with their masses in the middle
    assert run.com_displacement_m == pytest.approx(tuple(com[-1] - com[0]), abs=1e-4)
    assert run.frames == len(frames["t"])
    assert run.cap_height_max_m == frames["p_WE"][..., 2].max()
    assert run.tension_max_n == frames["tension"][:, run.tension_max_cable].max()


def test_fewer_frames_and_a_tail(made: Made) -> None:
    """At 10 Hz every fifth tick is stored, and the last; after the last target the motors rest for the tail."""
    settings = SimulateSettings(frame_rate_hz=10.0, tail_s=0.3)
    data, report = simulate(builders.robot(), [Request(POLICY)], settings)
    t, whole = data.groups["runs/bend/frames"]["t"], made.data.groups["runs/bend/frames"]
    assert np.diff(t)[:-1] == pytest.approx(0.1)
    assert report.runs[0].duration_s == pytest.approx(made.report.runs[0].duration_s + 0.3, abs=0.021)
    assert data.groups["runs/bend/frames"]["p_WE"][3] == pytest.approx(whole["p_WE"][15], abs=1e-12)
    assert not data.groups["runs/bend/commands"]["control"][-10:].any()


def test_a_start_is_brought_to_rest_where_it_was(made: Made) -> None:
    """A start somewhere else on the floor and turned stays there, with the same shape as the rest state."""
    rest = np.array(builders.robot().rest_caps_m)
    c, s = np.cos(0.7), np.sin(0.7)
    moved = rest @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [1.0, -2.0, 0.0]
    driver = Driver(builders.robot(), SimulateSettings(), None)
    _, shift = driver.settled(Start("there", moved))
    assert shift == pytest.approx(made.report.runs[0].start_shift_m, abs=1e-3)


def test_two_runs_of_one_name_are_refused() -> None:
    """One of them would be lost."""
    with pytest.raises(UsageError, match="the same name"):
        simulate(builders.robot(), [Request(POLICY), Request(POLICY)], SimulateSettings())


def test_an_engine_step_that_does_not_fit_is_refused() -> None:
    """The control period must be a whole number of engine steps; the hint names one that fits."""
    with pytest.raises(InputError) as caught:
        Driver(builders.robot(), SimulateSettings(step_s=0.003), None)
    assert caught.value.hint == "--set simulate.step_s=0.001"


@pytest.mark.parametrize(
    ("raised", "expected"),
    [
        (NonFiniteError(step=17, time=0.017, environment=0, body="cable 3", term="tension"), NumericalError),
        (EngineInputError("mass", "out of its range", expected="above 0", received="-1"), InputError),
    ],
)
def test_errors_of_the_engine_become_ours(
    raised: Exception, expected: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Run, time, step, body and term are named; the exit codes are those of the project."""

    def fail(*_: object, **__: object) -> None:
        raise raised

    monkeypatch.setattr(Driver, "settled", lambda *_: (None, 0.0))
    monkeypatch.setattr(import_module("r2s2r_cli.engine.closed_loop"), "closed_loop", fail)
    with pytest.raises(expected) as caught:
        simulate(builders.robot(), [Request(POLICY)], SimulateSettings())
    text = str(caught.value)
    assert "bend" in text
    named = ("0.017 s", "step 17", "cable 3", "tension") if expected is NumericalError else ("mass", "above 0", "-1")
    assert all(word in text for word in named)


def test_the_last_state_is_always_stored() -> None:
    """Every `stride`-th state, and the end where the stride misses it."""
    assert stored_rows(10, 5).tolist() == [0, 5, 10]
    assert stored_rows(11, 5).tolist() == [0, 5, 10, 11]
