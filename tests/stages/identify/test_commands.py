"""Recorded commands on the grid of the engine: nothing of them is lost, wherever the delay puts their switches."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.data import RunData
from tests.stages.measures.gait import run as gait

ROWS, WINCHES = 9, 3


def logged(seed: int, *, sampled: bool = False) -> RunData:
    """Random commands -1, 0, 1 at random stamps between 1 s and 2 s, the first 1."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(1.0, 2.0, ROWS))
    control = rng.integers(-1, 2, (ROWS, WINCHES)).astype(float)
    control[0] = 1.0
    return replace(gait(2), t_command=t, control=control, sampled=sampled)


def wound(run: RunData, start: float, end: float) -> np.ndarray:
    """Integral of the commands from start to end [s], summed row by row over what of each lies between the two."""
    t = run.t_command
    begins = np.append(t[0], (t[1:] + t[:-1]) / 2) if run.sampled else t
    ends = np.append(begins[1:], np.inf)
    inside = np.clip(np.minimum(ends, end) - np.maximum(begins, start), 0.0, None)
    return np.asarray(inside @ run.control)


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("delay", [0.0, 0.0137, 0.4, -0.3])
def test_rows_wind_what_the_log_winds(delay: float, sampled: bool) -> None:
    """The rows' integral is that of the delayed log over their span, each row's the same over its step."""
    run = logged(1, sampled=sampled)
    rows = CommandLog(run).means(0.9, 150, step=0.01, delay=delay)
    assert rows.shape == (150, WINCHES)
    whole = wound(run, 0.9 - delay, 2.4 - delay)
    np.testing.assert_allclose(0.01 * rows.sum(axis=0), whole, atol=1e-12)
    edges = 0.9 + 0.01 * np.arange(151) - delay
    each = np.array([wound(run, a, b) for a, b in pairwise(edges)])
    np.testing.assert_allclose(0.01 * rows, each, atol=1e-12)


def test_before_the_first_row_nothing_moves() -> None:
    """0 until the first stamp, half-way or not; from it on the first row; the last row holds for ever."""
    for sampled in (False, True):
        run = logged(2, sampled=sampled)
        first, last = run.t_command[0], run.t_command[-1]
        found = CommandLog(run).at(np.array([-5.0, first - 1e-9, first, last, last + 9.0]))
        np.testing.assert_array_equal(
            found, np.stack([0 * run.control[0]] * 2 + [run.control[0]] + [run.control[-1]] * 2)
        )
        where = {"start": first - 0.5, "count": 40, "step": 0.01, "delay": 0.05}
        assert not CommandLog(run).means(**where).any()
        assert not CommandLog(run).by_delay(**where).any()


def test_sent_commands_hold_and_sampled_ones_switch_half_way() -> None:
    """A command that a frame at 0.2 s shows first, after one at 0.1 s without it: from 0.2 s as sent, from 0.15 s as
    sampled."""
    run = replace(gait(2), t_command=np.array([0.1, 0.2, 0.4]), control=np.array([[0.0], [1.0], [-1.0]]))
    at = np.array([0.149, 0.151, 0.199, 0.2, 0.299, 0.301, 0.399, 0.4])
    sent, sampled = (CommandLog(replace(run, sampled=how)).at(at)[:, 0].tolist() for how in (False, True))
    assert sent == [0, 0, 0, 1, 1, 1, 1, -1]
    assert sampled == [0, 1, 1, 1, 1, -1, -1, -1]


def test_rows_on_the_stamps_are_the_log() -> None:
    """Where every switch is an edge of the grid, the rows are the commands themselves; elsewhere the row that a switch
    falls into is the mean."""
    t = 0.25 * np.arange(8)
    control = np.random.default_rng(3).integers(-1, 2, (8, WINCHES)).astype(float)
    log = CommandLog(replace(gait(2), t_command=t, control=control))
    np.testing.assert_array_equal(log.means(0.0, 8, step=0.25, delay=0.0), control)
    np.testing.assert_array_equal(log.means(0.25, 8, step=0.25, delay=0.25), control)
    late = log.means(0.25, 7, step=0.25, delay=0.0625)
    np.testing.assert_allclose(late, 0.25 * control[:-1] + 0.75 * control[1:], atol=1e-12)


def test_what_was_not_logged_is_no_command() -> None:
    """NaN counts as 0."""
    run = replace(gait(2), t_command=np.array([0.0, 1.0]), control=np.array([[np.nan], [1.0]]))
    assert CommandLog(run).means(0.0, 4, step=0.5, delay=0.0)[:, 0].tolist() == [0, 0, 1, 1]


@pytest.mark.parametrize("sampled", [False, True])
def test_the_derivative_by_the_delay_is_the_difference(sampled: bool) -> None:
    """Central differences wherever no edge comes to a switch, and it is not 0 where a switch falls into a row; all rows
    together change by what leaves at the end and enters at the start."""
    run, eps, step, delay = logged(4, sampled=sampled), 1e-6, 0.01, 0.0331
    log = CommandLog(run)
    by_delay = log.by_delay(0.9, 130, step=step, delay=delay)
    up, down = (log.means(0.9, 130, step=step, delay=delay + d) for d in (eps, -eps))
    np.testing.assert_allclose(by_delay, (up - down) / (2 * eps), atol=1e-5)
    switches = int((np.diff(np.vstack([np.zeros(WINCHES), run.control]), axis=0) != 0).sum())
    assert 0 < int((by_delay != 0).sum()) <= switches
    ends = log.at(np.array([0.9, 0.9 + 130 * step]) - delay)
    np.testing.assert_allclose(step * by_delay.sum(axis=0), ends[0] - ends[1], atol=1e-12)


def test_several_starts_and_delays_at_once() -> None:
    """Bit by bit the rows of each start and delay alone, before the first stamp and after the last one too."""
    log = CommandLog(logged(3))
    starts, delays = np.array([0.2, 0.9, 1.7, 5.0]), np.array([-0.3, 0.0, 0.0137])
    found = log.all_means(starts, 70, step=0.01, delays=delays)
    for d, delay in enumerate(delays.tolist()):
        for k, start in enumerate(starts.tolist()):
            np.testing.assert_array_equal(found[d, k], log.means(start, 70, step=0.01, delay=delay))
