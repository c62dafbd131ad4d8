"""Evidence: what is refused before any work, and the negative control that shuffles commands."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.diagnose.evidence import Evidence, FloorGiven, Run, require_enough
from r2s2r_cli.stages.diagnose.floors import KEPT, USUAL, floor_for, healthy_floor
from r2s2r_cli.stages.estimate.smooth import MISSING
from r2s2r_cli.stages.identified import nominal
from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.segments import Intervals, Segments
from tests.support.builders import robot

STEPS, FRAMES, ROWS = 4, 40, 200


def run_data(name: str = "walk", caps: int = 6) -> RunData:
    """Four intervals of 1 s; the command of interval k is k / 10 in every winch, its target k / 5."""
    t, t_command = np.arange(FRAMES) / 10.0, np.arange(ROWS) / 50.0
    numbers = np.arange(STEPS)
    intervals = Intervals(
        numbers * 10, numbers * 10 + 9, numbers * 1.0, numbers + 1.0, np.tile(numbers[:, None] / 5, 6),
        np.ones(STEPS, bool),
    )  # fmt: skip
    segments = Segments(
        numbers + 1, numbers * 10, numbers * 10 + 9, numbers * 1.0, numbers + 1.0, None, np.ones(STEPS, bool)
    )
    place = np.minimum(t_command.astype(int), STEPS - 1)
    caps_W = np.zeros((FRAMES, caps, 3))
    return RunData(
        name, t, caps_W, np.full((caps, 3), 1e-3), caps_W, caps_W, caps_W, caps_W, np.zeros((FRAMES, caps), np.uint8),
        t_command, np.tile(place[:, None] / 10, 6), np.tile(place[:, None] / 5, 6), intervals, segments,
    )  # fmt: skip


def evidence(*runs: RunData, fit: tuple[Selection, ...], judge: tuple[Selection, ...] = ()) -> Evidence:
    """Of the example robot, nothing identified."""
    return Evidence(robot(), nominal(robot()), tuple(Run(run) for run in runs), fit, judge)


def test_a_split_through_a_run_is_marked() -> None:
    """What is constant over a run helps both sides of such a split."""
    one = evidence(run_data(), fit=(Selection("walk", (1, 2)),), judge=(Selection("walk", (3, 4)),))
    assert one.within_run
    two = evidence(run_data(), run_data("b"), fit=(Selection("walk", (1, 2)),), judge=(Selection("b", (3, 4)),))
    assert not two.within_run
    assert [run.name for run in two.only(two.judge)] == ["b"]
    require_enough(two)


def test_a_cap_that_was_never_seen_is_where_the_estimate_has_it() -> None:
    """Hidden for the first 15 frames: until it is seen a filter that knows nothing later would have it anywhere. From
    then on it is where it is seen, and so are the others all along."""
    one = run_data()
    rng = np.random.default_rng(0)
    seen = rng.uniform(-0.2, 0.2, (6, 3)) + 1e-3 * rng.standard_normal((FRAMES, 6, 3))
    quality = one.quality.copy()
    quality[:15, 4] = MISSING
    inferred, sd = seen + 0.03, np.full(seen.shape, 0.02)
    observed = np.where(quality[..., None] == MISSING, 9.0, seen)
    known = Run(replace(one, observed=observed, quality=quality, p_WE=inferred, sd_p=sd, sd_v=sd)).known
    assert known.p_WE[:15, 4] == pytest.approx(inferred[:15, 4]) and known.sd_p[:15, 4] == pytest.approx(0.02)
    assert known.p_WE[20:, 4] == pytest.approx(seen[20:, 4], abs=4e-3)
    assert known.p_WE[:, 0] == pytest.approx(seen[:, 0], abs=4e-3) and (known.sd_p[:, 0] < 2e-3).all()
    assert np.isfinite(known.v_WE).all() and np.isfinite(known.sd_v).all()


def test_too_little_is_refused() -> None:
    """No run, one interval, another robot: before any work."""
    with pytest.raises(InputError, match="no run"):
        require_enough(evidence(fit=()))
    with pytest.raises(InputError, match="all of them are given as healthy") as only:
        require_enough(replace(evidence(fit=()), healthy=(Run(run_data()),)))
    assert only.value.received == "walk" and only.value.hint.startswith("r2s2r record")
    with pytest.raises(InputError, match="too few") as caught:
        require_enough(evidence(run_data(), fit=(Selection("walk", (1,)),)))
    assert caught.value.received == "walk:1"
    assert caught.value.hint == "r2s2r diagnose --train walk:1-3 --test walk:4"
    with pytest.raises(InputError, match="another robot"):
        require_enough(evidence(run_data(caps=12), fit=(Selection("walk", (1, 2)),)))


def test_without_a_floor_it_is_estimated_and_said() -> None:
    """From the noise of the caps and what two engines differ by: sqrt(3 * 1 mm^2 + 3^2 mm^2) at 1 mm of noise; a floor
    that was given is taken as it is."""
    one = evidence(run_data(), fit=(Selection("walk", (1, 2)),))
    floor, said = floor_for(one)
    assert floor.rmse == pytest.approx(np.sqrt(12.0) * 1e-3) and not floor.given
    assert said == ["no floor was given: taken from the noise of the caps and 3 mm for the numerics of engines, 3.5 mm"]
    given = FloorGiven(0.008, 0.002, "floor.h5")
    assert floor_for(replace(one, floor=given)) == (given, [])
    assert given.equivalence == (0.008, 1.0)  # of all intervals, against it


def test_one_fall_of_a_healthy_robot_does_not_decide_what_no_gap_is() -> None:
    """Of eleven intervals with 10 mm two that end 80 and 90 mm off: the floor of nine tenths has one of them, that
    of three quarters, which the equivalence test looks at, none."""
    squared = np.full(11, 1e-4)
    squared[[3, 7]] = 64e-4, 81e-4
    floor = healthy_floor(_healthy(squared, np.zeros((11, 6, 3))))
    assert floor.equivalence == (pytest.approx(0.010), USUAL) and floor.kept == KEPT
    assert floor.rmse == pytest.approx(np.sqrt((9 * 1e-4 + 64e-4) / 10)) and floor.sensor == pytest.approx(
        np.sqrt(12e-6)
    )


def test_a_healthy_robot_that_is_lost_is_no_floor() -> None:
    """Three of eleven intervals with 10 mm end with a cap more than 25 cm off: they count so in the share that the
    equivalence test looks at, where they are among the worst, and not in the floor."""
    squared, key = np.full(11, 1e-4), np.zeros((11, 6, 3))
    squared[:3], key[:3] = 0.25**2, np.nan
    floor = healthy_floor(_healthy(squared, key))
    assert floor.rmse == pytest.approx(0.010)
    assert floor.equivalence == (pytest.approx(0.010), USUAL)
    everywhere = healthy_floor(_healthy(np.full(4, 0.25**2), np.full((4, 6, 3), np.nan)))
    assert everywhere.rmse == pytest.approx(0.25)  # there is no other


def _healthy(squared: np.ndarray, key: np.ndarray) -> Any:
    """Healthy runs whose intervals end with squared errors (interval,) [m^2]; key (interval, cap, 3) [m]."""
    caps = SimpleNamespace(noise=np.full((1, 6, 3), 2e-3))
    return SimpleNamespace(arena=SimpleNamespace(whole=(caps,)), score=SimpleNamespace(squared=squared, key=key))


def test_shuffled_commands_belong_to_other_intervals() -> None:
    """Each interval gets the whole command of exactly one interval; what was observed stays."""
    before = evidence(run_data(), fit=(Selection("walk", (1, 2, 3)),))
    after = before.shuffled(3)
    run, own = after.runs[0].caps, before.runs[0].caps
    assert np.array_equal(run.observed, own.observed)
    given = run.control[:, 0].reshape(STEPS, -1)
    assert (np.ptp(given, axis=1) == 0).all()
    assert sorted((10 * given[:, 0]).round().tolist()) == list(range(STEPS))
    assert (10 * given[:, 0]).round().tolist() != list(range(STEPS))
    assert np.array_equal(run.target[:, 0], 2 * run.control[:, 0])


def test_a_longer_interval_is_filled() -> None:
    """Commands are stretched with their interval: no row of another one is left in it."""
    run = run_data()
    uneven = replace(
        run,
        intervals=replace(run.intervals, t_first=np.array([0.0, 0.5, 2.0, 3.5]), t_last=np.array([0.5, 2.0, 3.5, 4.0])),
        control=np.tile(np.searchsorted([0.5, 2.0, 3.5], run.t_command, side="right")[:, None] / 10, 6),
    )
    given = evidence(uneven, fit=()).shuffled(3).runs[0].caps.control[:, 0]
    ends = np.searchsorted(run.t_command, [0.0, 0.5, 2.0, 3.5, 4.0])
    inside = [set(given[a:b].round(3)) for a, b in pairwise(ends)]
    assert all(len(values) == 1 for values in inside)


def test_runs_that_are_judged_have_no_part_in_the_floor() -> None:
    """Ten times the noise there: the floor is that of what is fitted."""
    loud = replace(run_data("b"), noise=np.full((6, 3), 1e-2))
    split = evidence(run_data(), loud, fit=(Selection("walk", (1, 2)),), judge=(Selection("b", (1, 2)),))
    alone = evidence(run_data(), fit=split.fit)
    assert floor_for(split)[0] == floor_for(alone)[0]
