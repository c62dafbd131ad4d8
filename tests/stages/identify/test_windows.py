"""Windows on a hand-made run: where they begin and end, what they compare, and where a fall cuts them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.identify.data import RunData, Selection
from r2s2r_cli.stages.identify.windows import begins_after_tip, selected, spans, tips, window
from r2s2r_cli.stages.segments import segments
from tests.stages.measures.gait import FRAMES, run as gait

STATE: Any = object()
"""No window looks into its start state."""
INTERVALS = 4
HALF = (0, 2, 5)


def still(*jumps: tuple[int, tuple[int, ...], float], intervals: int = INTERVALS, period: float = 0.1) -> RunData:
    """Caps at rest; each jump (frame, caps, way) carries these caps `way` [m] along x from the frame before to it."""
    path = np.zeros((intervals * FRAMES, 6, 3))
    for frame, caps, way in jumps:
        path[frame:, list(caps), 0] += way
    made = gait(intervals, observed=path)
    return replace(made, t=made.t * period / 0.1)


@pytest.mark.parametrize(
    ("numbers", "length", "begins", "found"),
    [
        ((1, 2, 3, 4, 5), 2, (), [(1, 2), (3, 4), (5,)]),
        ((1, 2, 3, 4, 5), 9, (), [(1, 2, 3, 4, 5)]),
        ((1, 2, 4, 5, 7), 9, (), [(1, 2), (4, 5), (7,)]),
        ((1, 2, 3, 4, 5), 9, (3,), [(1, 2), (3, 4, 5)]),
        ((3, 4, 5, 6), 2, (3, 4), [(3,), (4, 5), (6,)]),
        ((2, 4), 1, (), [(2,), (4,)]),
        ((), 3, (), []),
    ],
)
def test_spans_are_consecutive_and_no_longer_than_asked(
    numbers: tuple[int, ...], length: int, begins: tuple[int, ...], found: list[tuple[int, ...]]
) -> None:
    """Cut at gaps, at the length, and before numbers that must begin one; every number once."""
    assert spans(numbers, length, frozenset(begins)) == found


def test_half_of_the_caps_carried_away_is_a_tip() -> None:
    """Three of six caps 5 cm in a frame: the first frame after it; two caps are the tracker; nothing is nothing."""
    assert tips(still((8, HALF, 0.05))) == (8,)
    assert tips(still((8, (0, 2), 0.05))) == ()
    assert tips(still((8, (0,), 0.5))) == ()
    assert tips(still()) == ()


def test_a_tip_is_far_and_fast() -> None:
    """2 cm is no tip however fast; 5 cm is none in a second: a robot that walks between two rare frames."""
    assert tips(still((8, HALF, 0.02), period=0.01)) == ()
    assert tips(still((8, HALF, 0.05), period=1.0)) == ()
    assert tips(still((8, HALF, 0.05), period=0.2)) == (8,)


def test_a_fall_over_several_frames_counts_once() -> None:
    """Frames 8, 9 and 10 fall together, another fall at 14 is another."""
    falls = [(frame, HALF, 0.05) for frame in (8, 9, 10, 14)]
    assert tips(still(*falls)) == (8, 14)


@pytest.mark.parametrize(
    ("frame", "begins"),
    [(8, {3}), (FRAMES, {2}), (FRAMES + 1, {3}), (2 * FRAMES, {3}), (3 * FRAMES + 1, set())],
    ids=["inside 2", "first of 2", "second of 2", "first of 3", "inside the last"],
)
def test_windows_begin_after_a_tip(frame: int, begins: set[int]) -> None:
    """The next interval that starts with a frame after the fall began; none where the run ends before."""
    assert begins_after_tip(still((frame, HALF, 0.05))) == begins


def test_a_window_compares_all_frames_after_its_start() -> None:
    """Of intervals 2 and 3: all but the first frame, each with its place; key frames are the segments' last."""
    run = still()
    one = window(run, (2, 3), STATE)
    assert one.first == FRAMES
    assert one.frames.tolist() == list(range(FRAMES + 1, 3 * FRAMES))
    assert one.place.tolist() == [0] * (FRAMES - 1) + [1] * FRAMES
    assert one.frames[one.key].tolist() == [2 * FRAMES - 1, 3 * FRAMES - 1]
    assert one.start == pytest.approx(run.t[FRAMES])
    assert one.duration == pytest.approx(run.t[3 * FRAMES - 1] - run.t[FRAMES])
    assert (one.state, one.known) == (STATE, False)


def test_segments_inside_an_interval_have_key_frames() -> None:
    """A control that reverses in frame 3 of interval 2 makes the frame before it a key frame."""
    run = still()
    control = run.control.copy()
    control[FRAMES : FRAMES + 3, 0], control[FRAMES + 3 : 2 * FRAMES, 0] = 1.0, -1.0
    run = replace(run, control=control, segments=segments(run.intervals, run.t, control))
    one = window(run, (2,), STATE)
    assert one.frames[one.key].tolist() == [FRAMES + 2, 2 * FRAMES - 1]


def test_until_is_the_window_of_its_first_intervals() -> None:
    """A horizon of 1 and 2 of 3 intervals compares what windows of these would; a longer one changes nothing."""
    run = still()
    whole = window(run, (2, 3, 4), STATE)
    for length in (1, 2, 3, 5):
        cut, own = whole.until(length), window(run, (2, 3, 4)[:length], STATE)
        assert cut.intervals == own.intervals
        assert cut.first == own.first
        for name in ("frames", "key", "place"):
            np.testing.assert_array_equal(getattr(cut, name), getattr(own, name))


def test_windows_end_at_tips() -> None:
    """Frames from the fall on are left out, of later intervals all; `whole` keeps them; a fall before the window's
    second frame leaves none, one on the way to its first frame all."""
    run = still((FRAMES + 3, HALF, 0.05))
    one = window(run, (2, 3), STATE)
    assert one.frames.tolist() == [FRAMES + 1, FRAMES + 2]
    assert one.place.tolist() == [0, 0]
    assert not one.key.any()
    assert len(window(run, (2, 3), STATE, whole=True).frames) == 2 * FRAMES - 1
    assert len(window(run, (3, 4), STATE).frames) == 2 * FRAMES - 1
    assert len(window(still((FRAMES + 1, HALF, 0.05)), (2,), STATE).frames) == 0
    assert len(window(still((FRAMES, HALF, 0.05)), (2,), STATE).frames) == FRAMES - 1


def test_selected_windows_go_over_no_tip() -> None:
    """Two runs, one with a fall inside interval 2: its windows break before 3, the other's at the length only."""
    falls, walks = still((8, HALF, 0.05)), replace(still(), name="other")
    chosen = selected([falls, walks], [Selection("other", (1, 2, 3)), Selection("walk", (1, 2, 3, 4))], 3)
    assert [(run.name, numbers) for run, numbers in chosen] == [
        ("other", (1, 2, 3)), ("walk", (1, 2)), ("walk", (3, 4)),
    ]  # fmt: skip
    assert chosen[0][0] is walks
