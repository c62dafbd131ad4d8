"""What a comparison measures, on motions whose errors are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.compare.errors import run_errors
from r2s2r_cli.stages.compare.figures import floor_of, in_common, measures
from r2s2r_cli.stages.compare.ranking import LEAST, ranking
from r2s2r_cli.stages.compare.repeats import ended, floors, repeatability, turned
from r2s2r_cli.stages.compare.walk import Walk, same_targets
from r2s2r_cli.stages.measures.align import PlanarMove
from r2s2r_cli.stages.segments import Intervals
from schemas.results_compare import CompareEnd, CompareFloor, CompareRun

PRISM = np.array([[-0.15, 0.0, 0.02], [0.15, 0.02, 0.1], [-0.16, 0.1, 0.02], [0.14, 0.12, 0.02], [-0.14, 0.05, 0.12],
                  [0.16, 0.04, 0.11]])  # fmt: skip
SHARE = np.full(6, 1 / 6)


def walk(speed: float = 0.1, turn: float = 0.0, pace: float = 1.0, move: PlanarMove | None = None) -> Walk:
    """Two intervals of a rigid robot that goes along x at `speed` [m/s] and turns at `turn` [rad/s] about its middle;
    pace: how fast it goes through the same motion; move: where it stands and looks."""
    t = np.linspace(0.0, 2.0 / pace, 201)
    s = t * pace
    middle = PRISM.mean(axis=0)
    p = np.empty((len(t), 6, 3))
    for k, at in enumerate(s):
        p[k] = PlanarMove(turn * at, np.zeros(3)).turn(PRISM - middle) + middle + [speed * at, 0, 0]
    p = p if move is None else move.move(p)
    first, last = np.array([0, 100]), np.array([99, 200])
    target = np.array([[0.0] * 6, [1.0] * 6])
    return Walk(t, p, SHARE, Intervals(first, last, t[first], t[last], target, np.array([True, True])))


def test_a_perfect_simulator_has_no_error_wherever_the_robot_stood() -> None:
    """Place and heading of the start drop out."""
    errors = run_errors(walk(turn=0.3), walk(turn=0.3, move=PlanarMove(1.2, np.array([0.4, -0.3, 0.0]))))
    assert errors.com_end == pytest.approx(0.0, abs=1e-12)
    assert errors.heading_end == pytest.approx(0.0, abs=1e-12)
    assert errors.path == pytest.approx(0.0, abs=1e-12)
    assert errors.cap == pytest.approx(0.0, abs=1e-12)
    assert errors.gait == pytest.approx(0.0, abs=1e-12)


def test_another_pace_is_an_error_of_time_and_of_nothing_else() -> None:
    """Runs are compared at equal shares of each interval, as the key frames of the paper are."""
    errors = run_errors(walk(), walk(pace=0.8))
    assert errors.cap == pytest.approx(0.0, abs=1e-9)
    assert errors.duration_real == pytest.approx([1.0, 1.0])
    assert errors.duration_sim == pytest.approx([1.25, 1.25])


def test_a_slower_walk_is_short_by_what_it_did_not_walk() -> None:
    """0.1 against 0.08 m/s for 2 s: 40 mm at the end, of which each interval adds 20 (its first frame to its end)."""
    errors = run_errors(walk(0.1), walk(0.08))
    assert errors.com_end == pytest.approx(0.04)
    assert errors.segment_end == pytest.approx([0.02, 0.04])
    assert errors.gait == pytest.approx([0.02, 0.02])
    shares = np.arange(1, 41) / 40
    assert errors.path == pytest.approx(0.04 * np.sqrt(np.mean(shares**2)))
    assert errors.heading_end == pytest.approx(0.0, abs=1e-12)


def test_a_turn_counts_whole_turns() -> None:
    """More than one turn apart is more than 2 pi, not its remainder."""
    errors = run_errors(walk(turn=0.5), walk(turn=4.0))
    assert errors.heading_end == pytest.approx(7.0)


def test_runs_with_other_intervals_are_refused() -> None:
    """One would be read for the other."""
    with pytest.raises(ValueError, match="intervals"):
        run_errors(walk(), walk().first(1))


def test_same_targets_counts_from_the_first() -> None:
    """Until the first that differs; a shorter one ends it."""
    one = walk().intervals
    other = Intervals(**{**vars(one), "target": np.array([[0.0] * 6, [0.5] * 6])})
    assert same_targets(one, one) == 2
    assert same_targets(one, other) == 1
    assert same_targets(one, walk().first(1).intervals) == 1


def test_ends_do_not_depend_on_where_the_robot_started() -> None:
    """Along and across its heading at the start."""
    plain = ended(walk(turn=0.2))
    moved = ended(walk(turn=0.2, move=PlanarMove(-2.0, np.array([1.0, 2.0, 0.0]))))
    assert moved == pytest.approx(plain)
    assert turned(walk(turn=0.2)) == pytest.approx(0.4)


def test_repeatability_and_floor_are_those_of_the_scatter() -> None:
    """Speeds 0.09, 0.10, 0.11 m/s: 20 mm apart at the end, so sd 20 mm, and the floor is the sd of a single run."""
    walks = {f"run-{k}": walk(0.1 + 0.01 * k) for k in (-1, 0, 1)}
    policies = dict.fromkeys(walks, "run")
    (one,) = repeatability(walks, policies)
    along = np.linalg.norm(one.com_sd)
    assert along == pytest.approx(0.02)
    assert np.linalg.norm(one.com_mean) == pytest.approx(0.2)
    assert floors(walks, policies).com == pytest.approx(0.02)
    assert floors(walks, policies).heading == pytest.approx(0.0, abs=1e-12)


def test_runs_that_start_on_another_side_repeat_nothing() -> None:
    """Same policy and targets, but the robot lay otherwise: what it did then is no scatter. Two of a kind repeat each
    other."""
    tilted = walk(0.1)
    upside_down = replace(tilted, p_WE=tilted.p_WE * [1, 1, -1] + [0, 0, 0.14])
    walks = {"run-1": walk(0.1), "run-2": upside_down, "run-3": walk(0.12)}
    policies = dict.fromkeys(walks, "run")
    (one,) = repeatability(walks, policies)
    assert one.runs == ("run-1", "run-3")
    assert floors(walks, policies).com == pytest.approx(0.04 / np.sqrt(2))


def test_floors_along_the_run_are_those_of_the_errors() -> None:
    """Two repeats that differ by d in an error measure have a floor of d / sqrt 2 in it: that of one of them."""
    walks = {"run-1": walk(0.1), "run-2": walk(0.12)}
    errors, known = run_errors(*walks.values()), floors(walks, dict.fromkeys(walks, "run"))
    for name in ("path", "cap"):
        assert getattr(known, name) == pytest.approx(getattr(errors, name) / np.sqrt(2))
    assert known.gait == pytest.approx(np.sqrt(np.mean(errors.gait**2) / 2))


def test_key_frames_have_a_floor_where_anything_repeats() -> None:
    """That of the repeats, whose key frames are laid on at their starts too; without any that of floor.h5."""
    walks = {"run-1": walk(0.1), "run-2": walk(0.12)}
    policies = dict.fromkeys(walks, "run")
    alone = {"run-1": walks["run-1"]}
    assert floor_of(walks, policies, 0.004).keyframe_cap_m == floors(walks, policies).gait
    assert floor_of(alone, policies, 0.004).keyframe_cap_m == 0.004
    assert floor_of(alone, policies, None).keyframe_cap_m is None


def test_a_single_run_has_no_floor() -> None:
    """Nothing repeats: nothing is claimed."""
    assert floors({"run": walk()}, {"run": "run"}).com is None
    assert repeatability({"run": walk()}, {"run": "run"}) == ()


def test_ranking_is_of_order_and_not_of_size() -> None:
    """A simulator that doubles every way ranks perfectly; one that turns the order round has -1."""
    speeds = {"a": 0.02, "b": 0.05, "c": 0.08, "d": 0.12}
    policies = {name: name for name in speeds}
    real = {name: walk(v, turn=v) for name, v in speeds.items()}
    doubled = {name: walk(2 * v, turn=2 * v) for name, v in speeds.items()}
    reverse = {name: walk(0.2 - v, turn=-v) for name, v in speeds.items()}
    good, bad = ranking(real, doubled, policies), ranking(real, reverse, policies)
    assert good is not None
    assert bad is not None
    assert (good.com, good.turn) == pytest.approx((1.0, 1.0))
    assert (bad.com, bad.turn) == pytest.approx((-1.0, -1.0))
    backwards = {name: walk(-v, turn=0.0) for name, v in speeds.items()}
    wrong = ranking(real, backwards, policies)
    assert wrong is not None
    assert wrong.com == pytest.approx(-1.0)  # as far, but the other way
    assert wrong.turn is None  # none of them turns: there is no order
    few = dict(list(real.items())[: LEAST - 1])
    assert ranking(few, few, policies) is None


def test_a_rod_that_stands_up_on_the_way_does_not_turn_the_end() -> None:
    """Where it ended is told by how it began: it has no turn then, but the same place."""
    plain = walk(move=PlanarMove(1.2, np.zeros(3)))
    p = plain.p_WE.copy()
    p[120, 1::2] = p[120, 0::2] + [0.0, 0.0, 0.3]
    risen = replace(plain, p_WE=p)
    assert risen.heading is None and turned(risen) is None
    assert ended(risen) == pytest.approx(ended(plain), abs=1e-12)
    upright = replace(plain, p_WE=p[120:])
    assert ended(upright) == pytest.approx((upright.com[-1] - upright.com[0])[:2])  # along the axes of the world


def test_simulators_are_compared_over_the_same_runs() -> None:
    """A run in which one simulator fails counts for none, or the one that gets through would pay for it; a simulator
    that gets through no run takes nothing from the others, and what all have stays."""

    none = CompareFloor.model_validate(dict.fromkeys(CompareFloor.model_fields))
    blank = {
        **dict.fromkeys(CompareRun.model_fields), "policy": "p", "iteration": 1, "trained_on": False,
        "intervals": 1, "of_intervals": 1, "floor": none, "real_end": CompareEnd(com_m=(0.0, 0.0), turn_rad=None),
    }  # fmt: skip

    def row(run: str, model: str, end: float | None, key: float | None = 0.01) -> CompareRun:
        own = {"run": run, "model": model, "com_end_error_m": end, "keyframe_cap_rmse_m": key}
        return CompareRun.model_validate({**blank, **own})

    rows = [
        row("easy", "a", 0.02), row("hard", "a", None), row("easy", "b", 0.03), row("hard", "b", 0.9),
        row("easy", "never", None), row("hard", "never", None),
    ]  # fmt: skip
    even, said = in_common(rows, {})
    assert [one.com_end_error_m for one in even] == [0.02, None, 0.03, None, None, None]
    assert all(one.keyframe_cap_rmse_m == 0.01 for one in even)
    assert len(said) == 1 and "run hard is left out of the figures of the com end" in said[0]
    assert said[0].endswith("for all simulators: a has none in it")
    broken, said = in_common([row("hard", "a", None, None), *rows[:1], *rows[2:]], {})
    assert all(one.com_end_error_m is one.keyframe_cap_rmse_m is None for one in broken if one.run == "hard")
    assert len(said) == 1 and said[0].endswith(
        "figures over several runs for all simulators: a could not be simulated in it"
    )
    lying, said = in_common(rows[::2], {"easy": "cable 1 is long"})
    assert all(one.com_end_error_m is None and one.keyframe_cap_rmse_m is None for one in lying)
    assert len(said) == 1 and "easy" in said[0] and "cable 1 is long" in said[0]
    b = [one for one in even if one.model == "b"]
    assert measures(b, even[:2], none)["com_end_m"].rms == pytest.approx(0.03)
