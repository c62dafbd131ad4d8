"""The floor of runs: planted repeatability of caps and lengths comes back, with what it rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.floor import Numerics, SeenRun, SensedRun, floor, sensed_run
from r2s2r_cli.stages.floor.lengths import length_repeats
from r2s2r_cli.stages.segments import target_intervals
from r2s2r_cli.stages.sensed import sensed_lengths
from schemas.results_floor import FloorReport
from tests.stages.measures.gait import FRAMES, path, run
from tests.support.fake_robot import calibrated

RATE = 50.0
HOLD_S = 2.0
SENSORS = 3


def sensed(name: str, cycles: int, *, spread: float, noise: float, seed: int, lost: float = 0.0) -> SensedRun:
    """Targets A, B, A, B ...: each interval ends at its target plus a normal deviation of `spread` [m]."""
    generator = np.random.default_rng(seed)
    n = round(HOLD_S * RATE)
    t = np.arange(2 * cycles * n) / RATE
    target = np.repeat(np.tile([[0.0], [1.0]], (cycles, 1)), n, axis=0)
    ends = 0.1 + 0.1 * target[::n] + generator.normal(0.0, spread, (2 * cycles, SENSORS))
    ramp = np.minimum(np.arange(n) / (0.5 * n), 1.0)[:, None]
    before = np.vstack([ends[:1], ends[:-1]])
    length = np.concatenate([b + ramp * (e - b) for b, e in zip(before, ends, strict=True)])
    length += generator.normal(0.0, noise, length.shape)
    length[generator.random(length.shape) < lost] = np.nan
    table = target_intervals(t, target, control=np.zeros_like(target))
    return SensedRun(name, t, length, np.arange(SENSORS), table)


@pytest.mark.parametrize("lost", [0.0, 2 / 3])
def test_planted_repeatability_of_lengths_is_recovered(lost: float) -> None:
    """3 mm at the end of 600 intervals come back within their sampling error, also where boards take turns."""
    found = length_repeats([sensed("a", 300, spread=0.003, noise=1e-4, seed=1, lost=lost)])
    assert found is not None and found.contrasts == 597
    assert np.allclose(found.sd, 0.003, rtol=4 / np.sqrt(2 * found.contrasts))
    assert found.floor == pytest.approx(0.003, rel=4 / np.sqrt(2 * 3 * found.contrasts))


def test_noise_of_a_reading_is_told_from_motion() -> None:
    """0.5 mm white noise on ramps of 100 mm in a second comes back within 5 %."""
    found = length_repeats([sensed("a", 20, spread=0.003, noise=5e-4, seed=2)])
    assert found is not None
    assert np.allclose(found.noise, 5e-4, rtol=0.05)


def test_a_silent_sensor_has_no_number() -> None:
    """NaN, not zero, and the others are not touched by it."""
    one = sensed("a", 10, spread=0.003, noise=1e-4, seed=3)
    one.length[:, 1] = np.nan
    found = length_repeats([one])
    assert found is not None and np.isnan(found.sd[1]) and np.isnan(found.noise[1])
    assert np.isfinite(found.floor) and np.isfinite(found.sd[[0, 2]]).all()


def test_runs_without_repeats_have_no_floor() -> None:
    """Two intervals of two phases: nothing to compare."""
    assert length_repeats([sensed("a", 1, spread=0.003, noise=1e-4, seed=4)]) is None
    with pytest.raises(InputError, match="nothing repeats"):
        floor([], [sensed("a", 1, spread=0.003, noise=1e-4, seed=4)], policies={})


def test_what_it_rests_on_is_said() -> None:
    """Three runs of a policy, runs of excitation sets, or one run: each by its name, and the last with a warning."""
    runs = [sensed(f"1:walk-{i}", 3, spread=0.003, noise=1e-4, seed=i) for i in (1, 2, 3)]

    def told(names: dict[str, str], count: int) -> tuple[str, tuple[str, ...]]:
        _, report = floor([], runs[:count], policies=names)
        assert report.lengths is not None
        return report.lengths.basis, report.warnings

    walk = {run.name: "walk" for run in runs}
    assert told(walk, 3)[0] == "repeats of a policy"
    basis, warnings = told(walk, 1)
    assert basis == "same phase within a run" and any("slow drift" in text for text in warnings)
    assert told({runs[0].name: "ramps"}, 1)[0] == "commissioning runs"


def test_the_floor_of_caps_is_that_of_the_measures() -> None:
    """A gait whose key frames scatter by 5 mm per axis, in three runs: floor, interval and deviations by phase."""
    cycles = 13
    seen, keys = [], np.arange(1, cycles + 1) * FRAMES - 1
    for i in range(3):
        observed = path(cycles)
        observed[keys] += np.random.default_rng(i).normal(0.0, 0.005, (cycles, 6, 3))
        seen.append(replace_name(run(cycles, observed=observed, noise=0.0), f"1:gait-{i + 1}"))
    data, report = floor(seen, [], policies={one.name: "gait" for one in seen})
    assert report.caps is not None and report.caps.basis == "repeats of a policy"
    relative = (0.5 / (report.caps.contrasts * 18)) ** 0.5
    assert report.caps.floor_m == pytest.approx(0.005 * 3**0.5, rel=5 * relative)
    group = data.groups["caps"]
    assert len(group["run"]) == report.caps.repeats == len(group["deviation_cap"])
    n = np.bincount(group["phase"])[group["phase"]]
    scaled = np.sqrt(np.mean(group["deviation"] ** 2 * n / (n - 1)))
    assert scaled == pytest.approx(report.caps.floor_m, rel=0.05)


def test_numerics_are_kept_as_they_are() -> None:
    """Two gait steps off by 1 and 7 mm: 5 mm in root mean square."""
    numerics = Numerics(np.arange(2), np.array([0.001, 0.007]), np.array([0.03, 0.05]), 2.5e-4, 2.5e-4)
    data, report = floor([], [], policies={}, numerics=numerics)
    assert report.numerics is not None and report.numerics.floor_m == pytest.approx(0.005)
    assert (report.numerics.worst_m, report.numerics.moved_m) == (0.007, 0.04)
    assert list(data.groups) == ["numerics"]


def replace_name(one: object, name: str) -> SeenRun:
    """The run of the measures' tests as one of the floor."""
    keys = ("t", "observed", "noise", "quality", "intervals")
    made = SeenRun(name, *(getattr(one, key) for key in keys))
    return replace(made, name=name)


def test_iterations_that_lie_apart_are_told_from_repeats() -> None:
    """Two iterations that repeat to 1 mm each and are 10 mm apart: the floor has both, and the warning each of them."""
    first, second = (sensed(f"{i}:a", 40, spread=0.001, noise=1e-4, seed=i) for i in (1, 2))
    second.length[:] += 0.01
    _, report = floor([], [first, second], policies={})
    assert report.lengths is not None and report.lengths.within_m is not None
    assert report.lengths.within_m == pytest.approx(0.001, rel=0.15)
    assert report.lengths.floor_m == pytest.approx(np.hypot(0.001, 0.005), rel=0.1)
    assert any("--iteration N" in text for text in report.warnings)
    assert report.used == report.runs == ("1:a", "2:a")
    _, alone = floor([], [first], policies={})
    assert alone.lengths is not None and alone.lengths.within_m is None
    assert not any("--iteration N" in text for text in alone.warnings)


def test_where_a_target_was_given_up_the_robot_is_not_judged() -> None:
    """A recording of ten targets, the fifth given up 50 mm off: without its done flags it counts, with them it does
    not, nor does the step after it, and the report says so."""
    robot, n = calibrated(), 50
    motors = len(robot.actuated)
    t = np.arange(10 * n) / RATE
    level = np.repeat(np.tile([0.0, 1.0], 5), n)
    target = np.repeat(level[:, None], motors, axis=1)
    done = np.tile(np.arange(n) > 30, 10)
    lost = (t >= 4 * n / RATE) & (t < 5 * n / RATE)
    length = 0.1 + 0.1 * np.repeat(level[:, None], len(robot.sensors), axis=1) + np.where(lost, 0.05, 0.0)[:, None]
    table = target_intervals(t, target, control=np.zeros_like(target)).to_group()

    def measured(flags: np.ndarray) -> FloorReport:
        commands = Group({"t": t, "target": target, "done": np.repeat(flags[:, None], motors, axis=1)})
        groups = {"sensors": Group({"t": t, "length": length}), "intervals": table, "commands": commands}
        recording = ArtifactData("recording", {f"runs/a/{name}": group for name, group in groups.items()})
        found = sensed_run("1:a", recording, "a", robot)
        assert found is not None
        return floor([], [found], policies={})[1]

    fooled, report = measured(done), measured(done & ~lost)
    assert fooled.lengths is not None and fooled.lengths.floor_m > 0.01 and fooled.given_up == 0
    assert report.lengths is not None and report.lengths.floor_m < 1e-9 and report.given_up == 1
    assert fooled.lengths.contrasts - report.lengths.contrasts == 2
    assert "intervals left out since their target was given up: 1" in report.warnings


def test_the_step_after_a_target_that_was_given_up_is_no_repeat_of_caps() -> None:
    """The fifth of thirteen was given up, so the sixth starts from another shape: neither is compared, and though
    that shape is 50 mm off, its floor stays at nothing."""
    observed = path(13)
    observed[5 * FRAMES : 6 * FRAMES - 1, 3:] += [0.05, 0.0, 0.0]
    whole = replace_name(run(13, observed=observed, noise=0.0), "1:gait")
    complete = whole.intervals.complete.copy()
    complete[4] = False
    seen = replace(whole, intervals=replace(whole.intervals, complete=complete))
    data, report = floor([seen], [], policies={})
    assert not {5, 6} & set(data.groups["caps"]["interval"].tolist())
    assert report.caps is not None and report.caps.floor_m < 1e-9
    _, fooled = floor([whole], [], policies={})
    assert fooled.caps is not None and fooled.caps.floor_m > 1e-3


def test_lengths_of_a_log_stand_under_the_sensor_of_their_cable() -> None:
    """A log of three cables in an order of its own: each column comes to the sensor of robot.toml that measures it,
    the others are empty, and the floor of one cable is that cable's."""
    robot, n = calibrated(), 50
    cables = [robot.sensors[k].cable for k in (5, 0, 3)]
    t = np.arange(10 * n) / RATE
    level = np.repeat(np.tile([0.0, 1.0], 5), n)
    target = np.repeat(level[:, None], len(robot.actuated), axis=1)
    off = np.repeat(np.arange(10) // 2 % 2, n)[:, None] * np.array([[4e-3, 0.0, 0.0]])
    length = 0.1 + 0.1 * level[:, None] + np.array([[0.0, 0.01, 0.02]]) + off
    slope = {s.cable: (s.slope_f_per_m or np.nan, s.offset_f or 0.0) for s in robot.sensors}
    raw = np.column_stack([slope[c][1] + slope[c][0] * length[:, k] for k, c in enumerate(cables)])
    table = target_intervals(t, target, control=np.zeros_like(target)).to_group()
    for name, values in (("length", length), ("capacitance", raw)):
        sensors = Group({"t": t, name: values, "cable": np.array(cables, dtype=np.int64)})
        recording = ArtifactData("recording", {"runs/a/sensors": sensors, "runs/a/intervals": table})
        found = sensed_run("1:a", recording, "a", robot)
        assert found is not None and found.cable.tolist() == [s.cable for s in robot.sensors]
        assert np.allclose(found.length[:, [5, 0, 3]], length, atol=1e-12)
        assert np.isnan(np.delete(found.length, [5, 0, 3], axis=1)).all()
        repeats = length_repeats([found])
        assert repeats is not None and repeats.sd[5] > 1e-3 and repeats.sd[[0, 3]].max() < 1e-9


def test_a_target_that_is_met_at_once_does_not_count_for_the_one_given_up() -> None:
    """Camera frames come after the first ticks of the next target, which lie in the span of the one before."""
    robot = calibrated()
    motors = len(robot.actuated)
    t, frames = np.arange(0, 9, 0.02), np.arange(0, 9, 1 / 30) + 0.013
    target, seen = (np.where(stamps < 6, 0.0, 0.5)[:, None] + np.zeros(motors) for stamps in (t, frames))
    done = (t >= 6)[:, None] & np.ones(motors, dtype=bool)
    commands = Group({"t": t, "target": target, "control": np.zeros_like(target), "done": done})
    table = target_intervals(frames, seen, control=np.zeros_like(seen)).to_group()
    length = 0.1 + 1e-4 * np.sin(t)[:, None] + np.zeros(len(robot.sensors))
    groups = {"sensors": Group({"t": t, "length": length}), "intervals": table, "commands": commands}
    found = sensed_run("1:a", ArtifactData("recording", {f"runs/a/{k}": v for k, v in groups.items()}), "a", robot)
    assert found is not None and found.given_up == 1 and found.intervals.complete.tolist() == [False, True]


def test_a_sensor_that_hangs_is_left_out_and_named() -> None:
    """One value in every sample repeats itself perfectly: it would lower the floor of all."""
    robot, n = calibrated(), 50
    t = np.arange(10 * n) / RATE
    level = np.repeat(np.tile([0.0, 1.0], 5), n)
    target = np.repeat(level[:, None], len(robot.actuated), axis=1)
    noise = np.random.default_rng(0).normal(0, 1e-3, (len(t), len(robot.sensors)))
    length = 0.1 + 0.1 * level[:, None] + noise
    table = target_intervals(t, target, control=np.zeros_like(target)).to_group()
    floors = []
    for hanging in ([], [2, 7]):
        length[:, hanging] = 0.17
        groups = {"runs/a/sensors": Group({"t": t, "length": length}), "runs/a/intervals": table}
        found = sensed_run("1:a", ArtifactData("recording", groups), "a", robot)
        assert found is not None
        data, report = floor([], [found], policies={})
        assert report.lengths is not None
        floors.append(report.lengths.floor_m)
        assert np.flatnonzero(np.isnan(data.groups["lengths"]["sd"])).tolist() == hanging
        cables = ", ".join(str(robot.sensors[k].cable) for k in hanging)
        said = [text for text in report.warnings if "one value throughout" in text]
        assert said == ([f"1:a: one value throughout from the sensors of cables {cables}: left out"] if hanging else [])
    assert floors[1] == pytest.approx(floors[0], rel=0.3)


def test_a_sensor_without_lengths_has_those_of_its_capacitances() -> None:
    """Each sensor by itself; what a board sends before its chip is initialised is no reading."""
    robot = calibrated()
    t = np.arange(30) * 0.1
    truth = 0.15 + 0.01 * np.sin(t)[:, None] + 0.002 * np.arange(len(robot.sensors))
    slope, offset = np.array([[s.slope_f_per_m, s.offset_f] for s in robot.sensors], dtype=float).T
    raw, length = truth * slope + offset, truth + 0.05
    raw[4, 3] = 0.2e-12
    length[:, [3, 8]] = np.nan
    for own, expected in ((length, np.where(np.isnan(length), truth, length)), (None, truth)):
        sensors = {"t": t, "capacitance": raw} | ({} if own is None else {"length": own})
        found = sensed_lengths(Group(sensors), robot)
        assert found is not None and np.isnan(found[0][4, 3])
        there = np.delete(np.arange(30), 4)
        assert np.allclose(found[0][there], expected[there], atol=1e-12)
