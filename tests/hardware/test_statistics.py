"""What a link counts: planted losses, repeats and clocks are found again."""

from __future__ import annotations

import math

import numpy as np
import pytest

from r2s2r_cli.hardware.statistics import Clocks, Numbers, Tally


def test_losses_repeats_and_late_lines_are_told_apart() -> None:
    """5,000 numbers over the wrap, some lost, some twice, some late by up to 20: each counted as what it is."""
    draw = np.random.default_rng(3)
    sent = [(65000 + i) % 65536 for i in range(5000)]
    fate = draw.choice(["good", "lost", "twice", "late"], len(sent), p=[0.85, 0.05, 0.05, 0.05])
    fate[:30], fate[-30:] = "good", "good"
    when = [i + (20.5 if f == "late" else 0) for i, f in enumerate(fate)]
    line = sorted((w, s) for w, s, f in zip(when, sent, fate, strict=True) if f != "lost")
    line += [(w + 0.1, s) for w, s, f in zip(when, sent, fate, strict=True) if f == "twice"]
    numbers = Numbers()
    fresh = [seq for _, seq in sorted(line) if numbers.new(seq)]
    assert numbers.repeated == (fate == "twice").sum()
    assert numbers.lost == (fate == "lost").sum()
    assert numbers.reordered == (fate == "late").sum()
    assert fresh == [s for s, f in zip(sent, fate, strict=True) if f in ("good", "twice")]


def test_numbers_remember_a_bounded_past() -> None:
    """A day of lines takes no more memory than a minute of them."""
    numbers = Numbers()
    for i in range(200_000):
        assert numbers.new(i % 65536)
    assert len(numbers._seen) == len(numbers._order) <= 1024 and numbers.lost == 0


def test_offset_and_drift_of_the_board_clock() -> None:
    """An hour of answers, most of them late on one way: the quickest tell the clock to 0.1 ms, its drift to 1e-6."""
    draw = np.random.default_rng(4)
    clocks, drift = Clocks(), 40e-6
    for sent in np.arange(0.0, 3600.0, 0.1):
        there, back = 3e-4 + draw.exponential(2e-3, 2)
        clocks.answer(sent, sent + there + back, (sent + there) * (1 - drift) - 123.0)
    offset, slope = clocks.fit()
    assert offset == pytest.approx(123.0 + 3600 * drift, abs=1e-3)
    assert slope == pytest.approx(drift, abs=1e-6)
    assert len(clocks._points) <= 2048


def test_a_jump_of_nothing_is_nothing() -> None:
    """No answers: no offset, no latency; None where the protocol has no numbers."""
    empty = Tally(numbered=False).snapshot(0)
    assert (empty.lost, empty.repeated, empty.refused, empty.held) == (None, None, None, None)
    assert (empty.latency_median, empty.clock_offset, empty.clock_drift) == (None, None, None)
    assert empty.gap_max == 0


def test_latency_and_silence() -> None:
    """From a line to its answer; the longest gap, also one that has not ended; unanswered lines are forgotten."""
    tally = Tally(numbered=True)
    for i in range(2000):
        tally.asked(i % 65536, 0.01 * i)
        if i < 100:
            tally.heard(0.01 * i + 0.004)
            tally.answered(i, 0.01 * i + 0.004, 0.0)
    assert len(tally._pending) <= 512
    assert tally.silent(3.0) == pytest.approx(3.0 - 0.994)
    found = tally.snapshot(2)
    assert found.latency_median == pytest.approx(0.004) and found.sent == 2000 and found.overlong == 2
    assert found.gap_max == pytest.approx(2.006) and math.isfinite(found.clock_offset or math.nan)


def test_boards_may_overtake_each_other() -> None:
    """A late line is used where it is the newest of its board, and counted as late all the same."""
    numbers = Numbers()
    arrivals = [(65535, 0), (1, 1), (0, 0), (3, 0), (2, 0), (4, 1)]
    assert [numbers.new(seq, board) for seq, board in arrivals] == [True, True, True, True, False, True]
    assert (numbers.lost, numbers.reordered) == (0, 2)
    assert not numbers.new(0, 0) and numbers.repeated == 1


def test_a_clock_that_jumps_is_counted_and_its_past_forgotten() -> None:
    """Forwards, and back to 0 as after a restart; a host that is held up for half a second is no jump."""
    tally = Tally(numbered=True)
    t_board = 50.0
    for i in range(3000):
        t = 0.02 * i + (0.5 if 1000 <= i < 1010 else 0)
        t_board += 0.02 * (1 + 1e-4) + {500: 7.0, 2000: -t_board}.get(i, 0.0)
        tally.stamped(0, t, t_board)
        tally.stamped(1, t, 0.02 * i)
        tally.stamped(2, t, math.nan)
        tally.asked(i, t - 0.002)
        tally.answered(i, t, t_board)
    found = tally.snapshot(0)
    assert found.clock_jumps == 2
    assert found.clock_drift == pytest.approx(-1e-4, abs=2e-5)
    assert found.clock_offset == pytest.approx(t - 0.001 - t_board, abs=1e-3)
