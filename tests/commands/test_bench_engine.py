"""`r2s2r bench engine`: both simulators get the same robot, motion and parameters; the document is complete."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.commands import bench_gait
from r2s2r_cli.commands.bench_engine import _compared
from r2s2r_cli.commands.bench_sides import MujocoSide, OurSide
from r2s2r_cli.rig.model import body_of
from r2s2r_cli.rig.model.mjcf_text import winch_speed
from tests.commands.conftest import document, invoke
from tests.guards.listing import ROOT
from tests.support.rig_robots import known

ROBOT = known()
SPEED = winch_speed(ROBOT)


def test_the_gait_is_binary_and_keeps_to_the_winches() -> None:
    """Commands stay in [-1, 1]; at the end of every second each cable is where it was told: at rest or half its range
    shorter; gaits of different seeds differ, and equal seeds give equal gaits."""
    u = bench_gait.commands(ROBOT, SPEED, 6.0, range(8))
    assert u.shape == (8, 300, 6)
    assert np.abs(u).max() == 1.0
    reeled = bench_gait.reeled_in(u, SPEED, 0.02)
    assert reeled.shape == u.shape
    ends = reeled[:, 49::50] + u[:, 49::50] * SPEED * 0.02
    np.testing.assert_allclose(np.minimum(np.abs(ends), np.abs(ends - 0.05)), 0.0, atol=1e-12)
    assert 0.3 < np.mean(ends > 0.025) < 0.7
    assert not np.array_equal(u[0], u[1])
    np.testing.assert_array_equal(u, bench_gait.commands(ROBOT, SPEED, 6.0, range(8)))


def test_reeled_in_is_the_sum_of_what_was_wound() -> None:
    """At 1 ms: nothing at the start, then one step of winding after each step, whatever the tick."""
    u = bench_gait.commands(ROBOT, SPEED, 2.0, range(1))
    fine = bench_gait.reeled_in(u, SPEED, 0.001)
    np.testing.assert_array_equal(fine[:, 0], 0.0)
    np.testing.assert_allclose(np.diff(fine, axis=1), np.repeat(u, 20, axis=1)[:, :-1] * SPEED * 0.001, atol=1e-15)


@pytest.mark.parametrize("name", bench_gait.parameters())
def test_each_parameter_changes_what_its_name_says(name: str) -> None:
    """A quarter more of the parameter is another robot, that differs in one family of numbers, each by the factor."""
    before, after = ROBOT.model_dump(), bench_gait.varied(ROBOT, name, 1.25).model_dump()
    pairs = [(a, b) for a, b in zip(_leaves(before), _leaves(after), strict=True) if a != b]
    assert pairs
    for (key, old), (same, new) in pairs:
        assert key == same
        assert new == pytest.approx(1.25 * old)
    assert len({key for (key, _), _ in pairs}) <= 2
    assert known() == ROBOT


def _leaves(value: Any, key: str = "") -> list[tuple[str, Any]]:
    if isinstance(value, dict):
        return [leaf for name, inner in value.items() for leaf in _leaves(inner, name)]
    if isinstance(value, tuple | list):
        return [leaf for inner in value for leaf in _leaves(inner, key)]
    return [(key, value)]


def test_parameters_reach_mujoco() -> None:
    """A changed mass, friction and motor speed are in the models and controls of the difference quotient."""
    side = MujocoSide(ROBOT, 0.001)
    u = bench_gait.commands(ROBOT, SPEED, 1.0, range(1))
    faster = side.controls(u, bench_gait.varied(ROBOT, "motor speed", 1.1))
    np.testing.assert_allclose(faster[..., :6], 1.1 * side.controls(u, ROBOT)[..., :6], atol=1e-12)
    np.testing.assert_array_equal(faster[..., 6:], 0.0)
    wider = bench_gait.varied(ROBOT, "attachment radius", 1.2)
    rest = side.rest_lengths(u, ROBOT)
    np.testing.assert_allclose(side.rest_lengths(u, wider), rest, atol=1e-12)
    heavy = bench_gait.varied(ROBOT, "mass of spheres", 2.0)
    assert body_of(heavy.rods[0]).mass == pytest.approx(0.1334 + 2 * 0.0105)


@pytest.mark.slow
def test_both_sides_wind_the_same_rest_lengths() -> None:
    """What the engine's winches do with the commands is what MuJoCo is told to do, at every frame."""
    ours, theirs = OurSide(ROBOT, 0.001), MujocoSide(ROBOT, 0.001)
    u = bench_gait.commands(ROBOT, SPEED, 3.0, range(1))
    wound = ours.run(u).states.rest[0].numpy()
    told = theirs.rest_lengths(u, ROBOT)[0, ::20]
    np.testing.assert_allclose(wound[:-1], told, atol=1e-9)


@pytest.mark.slow
def test_the_document_has_what_it_promises() -> None:
    """--quick --json: four comparisons with rates above 0, ratios that fit them, times of the start, memory."""
    found = document("bench", "engine", "--quick", "--repeats", "1")
    for name in ("forward_1", "forward_64", "forward_1024"):
        one = found[name]
        assert one["unit"] == "steps/s"
        assert one["ratio"] == pytest.approx(one["ours"] / one["mujoco"])
    gradient = found["gradient_10"]
    assert gradient["ratio"] == pytest.approx(gradient["mujoco"] / gradient["ours"])
    assert len(found["parameters"]) == 10
    assert found["quick"] is True
    assert 0 < found["cached_start_s"] < found["compile_s"]
    assert min(found["peak_memory_bytes"].values()) > 2**24


def test_the_best_turn_counts() -> None:
    """Work that takes processor time is found slower than work that takes none; rates count the steps."""

    def idle() -> None:
        sum(range(1000))

    def busy() -> None:
        sum(range(1_000_000))

    seen: list[int] = []
    faster = _compared(idle, busy, 3, seen.append, steps=10, what="x")
    assert faster.ratio > 10
    assert faster.ratio == pytest.approx(faster.ours / faster.mujoco)
    assert faster.spread[0] <= faster.spread[1]
    assert _compared(busy, idle, 3, seen.append, steps=None, what="x").ratio < 0.1
    assert sum(seen) == 12


def test_without_mujoco_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra is named in the hint."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "mujoco" else find(name))
    result = invoke("bench", "engine")
    assert result.exit_code == 4
    assert f"hint: pip install -e '{ROOT}[rig]'" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [(("--robot", "fourbar"), "unknown robot"), (("--step", "0.003"), "20 ms divided by a whole number")],
)
def test_wrong_requests_are_refused(arguments: tuple[str, ...], says: str) -> None:
    """An unknown robot, a step that does not fit the motor commands."""
    result = invoke("bench", "engine", *arguments)
    assert result.exit_code == 2
    assert says in result.stderr
