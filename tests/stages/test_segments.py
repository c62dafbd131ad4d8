"""Target intervals and segments on hand-made runs whose cuts are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.stages.segments import Intervals, Segments, hidden_targets, segments, target_intervals
from schemas.segments import INTERVALS, SEGMENTS

A, B = [0.0, 1.0], [1.0, 0.0]


def run(*parts: tuple[list[float], int]) -> tuple[np.ndarray, np.ndarray]:
    """Stamps at 10 Hz and targets held for given numbers of frames."""
    target = np.concatenate([np.tile(vector, (count, 1)) for vector, count in parts])
    return np.arange(len(target)) * 0.1, target


def test_intervals_are_maximal_spans_of_one_target() -> None:
    """Cuts lie where the vector changes, a repeated vector is a new interval, and every frame belongs to one."""
    t, target = run((A, 3), (B, 4), (A, 1), (B, 2))
    found = target_intervals(t, target)
    assert found.first.tolist() == [0, 3, 7, 8]
    assert found.last.tolist() == [2, 6, 7, 9]
    assert found.t_first == pytest.approx(t[[0, 3, 7, 8]])
    assert found.t_last == pytest.approx(t[[2, 6, 7, 9]])
    assert found.target.tolist() == [A, B, A, B]


def test_a_run_of_one_target_is_one_interval() -> None:
    """No change, one interval over all frames; one frame is an interval too."""
    for count in (1, 5):
        found = target_intervals(*run((A, count)))
        assert (found.first.tolist(), found.last.tolist()) == ([0], [count - 1])


def test_frames_without_a_target_belong_to_no_interval() -> None:
    """NaN ends the interval before it, and the one before a pause is complete: its end was seen."""
    t, target = run((A, 2), ([np.nan, 1.0], 3), (A, 2), ([np.nan, np.nan], 1))
    found = target_intervals(t, target)
    assert found.first.tolist() == [0, 5]
    assert found.last.tolist() == [1, 6]
    assert found.complete.tolist() == [True, True]


def test_no_target_at_all_gives_no_interval() -> None:
    """A run without any target has neither intervals nor segments."""
    t, target = run(([np.nan, np.nan], 4))
    found = target_intervals(t, target)
    assert len(found) == len(segments(found, t, np.zeros((4, 2)))) == 0
    assert found.target.shape == (0, 2)


def test_targets_that_no_frame_shows_end_an_interval() -> None:
    """A, B, A with all of B left out: two intervals of A, the first one's end unseen. A few frames of B left out, or
    a target that is over before the next frame of an even series (rows stamped twice have such), change nothing."""
    t, target = run((A, 8), (B, 8), (A, 8))
    for kept, first, complete in (
        (np.r_[0:6, 18:24], [0, 6], [False, False]),
        (np.r_[0:8, 10:24], [0, 8, 14], [True, True, False]),
    ):
        hidden = hidden_targets(t[kept], t, target)
        found = target_intervals(t[kept], target[kept], hidden=hidden)
        assert (found.first.tolist(), found.complete.tolist()) == (first, complete)
    brief = target.copy()
    brief[9:] = A
    kept = np.delete(np.arange(24), 8)
    found = target_intervals(t[kept], brief[kept], hidden=hidden_targets(t[kept], t, brief))
    assert found.first.tolist() == [0]


def test_the_last_interval_is_cut_off_unless_it_can_be_seen_to_end() -> None:
    """With nothing but targets the last interval is not complete; all others are."""
    found = target_intervals(*run((A, 3), (B, 3), (A, 3)))
    assert found.complete.tolist() == [True, True, False]


def test_the_last_interval_ends_when_all_controls_are_zero() -> None:
    """The controller has stopped every cable: the interval has moved to its end; one still moving: it has not."""
    t, target = run((A, 3), (B, 3))
    control = np.ones((6, 2))
    control[-1] = 0
    assert target_intervals(t, target, control=control).complete[-1]
    control[-1, 1] = -1
    assert not target_intervals(t, target, control=control).complete[-1]


@pytest.mark.parametrize(("error", "complete"), [(0.05, True), (0.15, False)])
def test_the_last_interval_ends_within_the_tolerance(error: float, complete: bool) -> None:
    """A cable within the controller's tolerance of its target has arrived although its motor still turns."""
    t, target = run((A, 3), (B, 3))
    position = target + error
    found = target_intervals(t, target, control=np.ones((6, 2)), position=position, tolerance=0.1)
    assert found.complete[-1] == complete


@pytest.mark.parametrize(("error", "complete"), [(0.25, True), (0.35, False)])
def test_the_last_interval_is_measured_by_earlier_ones_of_its_target(error: float, complete: bool) -> None:
    """Where the gait always went on at 0.3 from the target, 0.25 is an end and 0.35 is not."""
    t, target = run((A, 3), (B, 3), (A, 3))
    position = target.copy()
    position[2] += 0.3
    position[8] -= error
    found = target_intervals(t, target, control=np.ones((9, 2)), position=position, tolerance=0.1)
    assert found.complete.tolist() == [True, True, complete]


def test_segments_without_control_are_the_intervals() -> None:
    """Nothing is known about the direction, and nothing is made up."""
    t, target = run((A, 3), (B, 3))
    intervals = target_intervals(t, target)
    found = segments(intervals, t)
    assert found.interval.tolist() == [1, 2]
    assert (found.first.tolist(), found.last.tolist()) == (intervals.first.tolist(), intervals.last.tolist())
    assert found.direction is None
    assert "direction" not in found.to_group()


def test_a_reversal_cuts_a_segment() -> None:
    """The frame that first shows the new sign starts the new segment, the one before it is the old one's key frame."""
    t, target = run((A, 6), (B, 3))
    control = np.zeros((9, 2))
    control[:, 0] = [1, 1, 0, -1, -1, 0, 0, 0, 0]
    found = segments(target_intervals(t, target, control=control), t, control)
    assert found.interval.tolist() == [1, 1, 2]
    assert found.first.tolist() == [0, 3, 6]
    assert found.last.tolist() == [2, 5, 8]
    assert found.t_last == pytest.approx(t[[2, 5, 8]])
    assert found.direction is not None
    assert found.direction.tolist() == [[1, 0], [-1, 0], [0, 0]]


def test_a_pause_is_no_reversal() -> None:
    """+1, 0, +1 and a value that was not logged leave one segment; +1, 0, -1 cuts once."""
    t, target = run((A, 5))
    for column, count in (
        ([1, 0, 1, 0, 0.2], 1),
        ([1, np.nan, 1, 0, 1], 1),
        ([1, 0, -1, 0, -1], 2),
        ([0, 0, 0, 0, 0], 1),
    ):
        control = np.stack([np.array(column, dtype=float), np.zeros(5)], axis=1)
        assert len(segments(target_intervals(t, target), t, control)) == count


def test_a_cut_by_one_cable_lets_the_others_start_afresh() -> None:
    """Segments are the fewest: after cable 0 has cut, the old sign of cable 1 does not cut again."""
    t, target = run((A, 6))
    control = np.array([[1, 1], [1, 1], [-1, 0], [-1, -1], [-1, -1], [-1, -1]], dtype=float)
    found = segments(target_intervals(t, target), t, control)
    assert found.first.tolist() == [0, 2]
    assert found.direction is not None
    assert found.direction.tolist() == [[1, 1], [-1, -1]]


def test_every_cable_moves_one_way_in_every_segment() -> None:
    """Random controls: segments tile their intervals, and no cable changes its sign within one."""
    rng = np.random.default_rng(0)
    t, target = run((A, 40), (B, 35), (A, 25))
    control = rng.integers(-1, 2, size=(100, 2)).astype(float)
    found = segments(target_intervals(t, target), t, control)
    assert np.concatenate([np.arange(a, b + 1) for a, b in zip(found.first, found.last, strict=True)]).tolist() == list(
        range(100)
    )
    for a, b in zip(found.first, found.last, strict=True):
        span = control[a : b + 1]
        assert not ((span.max(axis=0) > 0) & (span.min(axis=0) < 0)).any()


def test_only_the_last_segment_of_a_cut_off_interval_is_incomplete() -> None:
    """A reversal was seen, so the segment before it has ended."""
    t, target = run((A, 6))
    control = np.stack([np.array([1, 1, 1, -1, -1, -1.0]), np.zeros(6)], axis=1)
    found = segments(target_intervals(t, target, control=control), t, control)
    assert found.complete.tolist() == [False, True][::-1]


def test_groups_follow_the_schema_and_come_back() -> None:
    """to_group writes exactly the datasets of the layout, with its types, and from_group reads them back."""
    t, target = run((A, 3), (B, 3))
    intervals = target_intervals(t, target)
    cuts = segments(intervals, t, np.zeros((6, 2)))
    for group, spec in ((intervals.to_group(), INTERVALS), (cuts.to_group(), SEGMENTS)):
        assert {d.path: d.dtype for d in spec.datasets} == {k: str(group[k].dtype) for k in group.datasets}
    assert Intervals.from_group(intervals.to_group()).target.tolist() == intervals.target.tolist()
    back = Segments.from_group(cuts.to_group())
    assert back.direction is not None
    assert Segments.from_group(segments(intervals, t).to_group()).direction is None


def test_real_crawl_has_eleven_complete_intervals(real_dir: Path) -> None:
    """Kept frames of the real crawl fall into 11 intervals in cycles of three targets; no control reverses."""
    from r2s2r_cli.stages.frames import KEPT, keep_frames

    table = np.loadtxt(real_dir / "tribar_crawl" / "crawl.csv", delimiter=",", skiprows=1)
    rows = table[keep_frames(table[:, 0], table[:, 1:19].reshape(-1, 6, 3)) == KEPT]
    found = target_intervals(rows[:, 0], rows[:, 19:25], control=rows[:, 25:])
    assert len(found) == len(segments(found, rows[:, 0], rows[:, 25:])) == 11
    assert found.target[3:].tolist() == found.target[:-3].tolist()
