"""What a robot does in the rest before its policy is none of the policy's errors, ends or floors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.compare.errors import run_errors
from r2s2r_cli.stages.compare.opening import Opening, opening_of, policy_part, without_opening
from r2s2r_cli.stages.compare.repeats import ended, floors, turned
from r2s2r_cli.stages.compare.runs import real_runs
from r2s2r_cli.stages.compare.walk import Walk
from r2s2r_cli.stages.measures.align import PlanarMove
from r2s2r_cli.stages.segments import Intervals
from r2s2r_cli.stages.simulate.policies import Sequence
from tests.support import builders

PRISM = np.array([[-0.15, 0.0, 0.02], [0.15, 0.02, 0.1], [-0.16, 0.1, 0.02], [0.14, 0.12, 0.02], [-0.14, 0.05, 0.12],
                  [0.16, 0.04, 0.11]])  # fmt: skip
SHARE = np.full(6, 1 / 6)
REST = 1.0
"""Time in the rest shape before the policy [s]."""


def policy(speed: float, begin: float = 0.0, move: PlanarMove | None = None) -> Walk:
    """Two intervals of a robot that goes along x; move: where it stands and looks."""
    t = begin + np.linspace(0.0, 2.0, 201)
    p = PRISM + speed * (t - begin)[:, None, None] * np.array([1.0, 0.0, 0.0])
    first, last = np.array([0, 100]), np.array([99, 200])
    target = np.array([[0.0] * 6, [1.0] * 6])
    p = p if move is None else move.move(p)
    return Walk(t, p, SHARE, Intervals(first, last, t[first], t[last], target, np.array([True, True])))


def recorded(speed: float, slide: np.ndarray, turn: float, lift: float = 0.0) -> Walk:
    """The same after a rest in which the robot slid and turned over the ground, and its first cap sank by `lift`."""
    after = policy(speed, REST, PlanarMove(turn, np.array([*slide, 0.0])))
    t = np.linspace(0.0, REST, 50, endpoint=False)
    share = (t / t[-1])[:, None, None]
    high = PRISM + np.array([[0.0, 0.0, lift]] + 5 * [[0.0, 0.0, 0.0]])
    rest = (1 - share) * high + share * after.p_WE[0]
    n = len(t)
    of = after.intervals
    spans = Intervals(
        np.append(0, of.first + n), np.append(n - 1, of.last + n), np.append(0.0, of.t_first),
        np.append(t[-1], of.t_last), np.vstack([np.ones(6), of.target]), np.append(True, of.complete),
    )  # fmt: skip
    return Walk(np.append(t, after.t), np.concatenate([rest, after.p_WE]), SHARE, spans)


def test_what_moved_before_the_policy_is_no_error_of_it() -> None:
    """A robot that slid 80 mm and turned by 40 degrees in the rest ends and lasts as the policy alone."""
    whole = recorded(0.1, np.array([0.08, 0.0]), 0.7)
    begun = without_opening(whole, opening_of(whole))
    assert begun.t[0] == pytest.approx(whole.t[49])
    assert ended(begun) == pytest.approx(ended(policy(0.1)))
    assert turned(begun) == pytest.approx(0.0, abs=1e-12)
    assert begun.durations == pytest.approx(policy(0.1).durations)
    errors = run_errors(begun, policy(0.1))
    assert errors.com_end == pytest.approx(0.0, abs=1e-12)
    assert errors.gait == pytest.approx(0.0, abs=1e-12)
    assert run_errors(begun, policy(0.08)).com_end == pytest.approx(0.04)


def test_runs_that_settled_otherwise_repeat_each_other() -> None:
    """One lay still, one slid and turned: their policies ended 20 mm apart, and that is the floor."""
    walks = {"run-1": recorded(0.1, np.zeros(2), 0.0), "run-2": recorded(0.11, np.array([0.3, -0.2]), 1.0)}
    begun = {name: without_opening(walk, opening_of(walk)) for name, walk in walks.items()}
    assert floors(begun, dict.fromkeys(begun, "run")).com == pytest.approx(0.02 / np.sqrt(2))


def test_how_far_it_settled_is_told() -> None:
    """A cap that sinks by d moves d / sqrt 6 in the mean of six; a move over the ground changes no shape."""
    slid = opening_of(recorded(0.1, np.array([0.03, 0.04]), 0.0))
    assert (slid.intervals, slid.moved, slid.travel) == (1, pytest.approx(0.0, abs=1e-9), pytest.approx(0.05))
    assert slid.duration == pytest.approx(REST, abs=0.03)
    sank = opening_of(recorded(0.1, np.zeros(2), 0.0, lift=0.06))
    assert sank.moved == pytest.approx(0.06 / np.sqrt(6))
    unseen = recorded(0.1, np.zeros(2), 0.0)
    unseen.p_WE[:50, 2] = np.nan
    assert np.isnan(opening_of(unseen).moved)


def test_a_run_that_opens_with_its_policy_stays_as_it_is() -> None:
    """A log from elsewhere may begin with a gait."""
    whole = policy(0.1)
    assert opening_of(whole) == Opening()
    assert without_opening(whole, Opening()) is whole


def test_the_simulated_policy_has_no_opening_rest_either() -> None:
    """Rest shapes at the front go, with their holds; those within it and at the end stay."""
    target = np.array([[1.0, 1.0], [1.0, 1.0], [0.0, 1.0], [1.0, 1.0], [0.5, 0.0], [1.0, 1.0]])
    whole = Sequence(target, np.arange(6.0), 10 + np.arange(6.0))
    part = policy_part(whole, Opening(intervals=1))
    assert np.array_equal(part.target, target[2:])
    assert part.hold.tolist() == [2, 3, 4, 5]
    assert part.timeout.tolist() == [12, 13, 14, 15]
    assert policy_part(whole, Opening()) is whole


def test_an_estimate_that_opens_in_the_rest_shape_is_compared_from_its_end() -> None:
    """Frames, intervals and targets of the run that is compared; its commands stay those of the whole run."""
    groups = dict(builders.estimate(90).groups)
    spans = groups["runs/walk/intervals"]
    spans["complete"][:] = True
    first, target = spans["first"], spans["target"]
    third = {name: np.concatenate([spans[name], spans[name][-1:]]) for name in spans.datasets}
    cut = int(first[-1]) + 5  # the last interval in two, the second of them with a target of its own
    third["last"][-2], third["first"][-1] = cut - 1, cut
    t = groups["runs/walk/frames"]["t"]
    third["t_last"][-2], third["t_first"][-1] = t[cut - 1], t[cut]
    third["target"] = np.vstack([np.ones_like(target[0]), target[1], 0.5 * target[1] + 0.1])
    groups["runs/walk/intervals"] = replace(spans, datasets=third)
    del groups["runs/walk/policy"]
    (run,), _ = real_runs(builders.ArtifactData("estimate", groups), None, builders.robot(), iteration=1)
    assert run.walk.t[-1] == t[third["last"][-1]]
    begin = int(third["last"][0])
    assert run.opening.intervals == 1
    assert run.walk.t[0] == t[begin]
    assert run.walk.intervals.first.tolist() == [1, cut - begin]
    assert run.intervals == len(run.walk.intervals) == len(run.targets.target) == 2
    assert np.array_equal(run.targets.target, third["target"][1:])


def test_a_run_that_is_cut_off_ends_where_its_last_whole_interval_does() -> None:
    """What came of the interval that broke off is no end to compare with, nor one that repeats could differ by."""
    groups = dict(builders.estimate(90).groups)
    spans = groups["runs/walk/intervals"]
    third = {name: np.concatenate([spans[name], spans[name][-1:]]) for name in spans.datasets}
    cut = int(spans["first"][-1]) + 5
    t = groups["runs/walk/frames"]["t"]
    third["last"][-2], third["first"][-1] = cut - 1, cut
    third["t_last"][-2], third["t_first"][-1] = t[cut - 1], t[cut]
    third["target"] = np.vstack([spans["target"][1], 0.5 * spans["target"][1] + 0.1, spans["target"][1]])
    third["complete"] = np.array([True, True, False])
    groups["runs/walk/intervals"] = replace(spans, datasets=third)
    del groups["runs/walk/policy"]
    (run,), said = real_runs(builders.ArtifactData("estimate", groups), None, builders.robot(), iteration=1)
    assert run.intervals == 3 and len(run.walk.intervals) == 2 and "the next is not complete" in said[0]
    assert run.walk.t[-1] == t[cut - 1] and len(run.walk.p_WE) == cut
