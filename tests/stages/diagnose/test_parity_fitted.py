"""Nothing of a judged interval reaches the parity stage, wherever in its run it lies."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.evidence import Evidence, Run
from r2s2r_cli.stages.diagnose.parity import parity
from r2s2r_cli.stages.diagnose.parity.fitted import fitted_runs, unheard
from r2s2r_cli.stages.diagnose.parity.lengths import late_readings
from r2s2r_cli.stages.diagnose.sensor_noise import noise_of
from r2s2r_cli.stages.identify.data import Selection
from tests.support.parity_log import INTERVALS, evidence_of, swaying, with_caps

EVERY = tuple(range(1, INTERVALS + 1))
SPLITS = [judged for count in range(1, INTERVALS) for judged in combinations(EVERY, count)]


def split(run: Run, judged: tuple[int, ...]) -> Evidence:
    """All other intervals are fitted."""
    fit = tuple(k for k in EVERY if k not in judged)
    return replace(evidence_of((run,)), fit=(Selection(run.name, fit),), judge=(Selection(run.name, judged),))


def of_judged(run: Run, judged: tuple[int, ...], t: np.ndarray) -> np.ndarray:
    """Which stamps lie between the first frame of a judged interval and that of the next one."""
    begins = run.caps.intervals.t_first
    return np.isin(np.searchsorted(begins, t, side="right"), judged)


@pytest.fixture(scope="module")
def swayed() -> Run:
    """Six intervals, which sensors have in samples of their own."""
    run = swaying("g", 3)
    assert run.lengths is not None
    t, table = run.lengths.t, run.caps.intervals
    first = np.searchsorted(t, table.t_first)
    last = np.append(first[1:], len(t)) - 1
    own = replace(table, first=first, last=last, t_first=t[first], t_last=t[last])
    return replace(run, lengths=replace(run.lengths, intervals=own))


@pytest.mark.parametrize("judged", SPLITS)
def test_no_sample_of_a_judged_interval_is_left(swayed: Run, judged: tuple[int, ...]) -> None:
    """Of every split of six intervals: no frame, reading or command lies in the time of a judged one, and tables count
    what is there. The block is as long as any without a judged one."""
    (cut,) = fitted_runs(split(swayed, judged))
    caps, lengths = cut.caps, cut.lengths
    assert lengths is not None
    for t in (caps.t, caps.t_command, lengths.t, caps.intervals.t_first, caps.intervals.t_last, caps.segments.t_first,
              lengths.intervals.t_first, lengths.intervals.t_last):  # fmt: skip
        assert len(t) and not of_judged(swayed, judged, t).any()
    gaps = np.diff([0, *judged, INTERVALS + 1]) - 1
    assert len(caps.intervals) == len(caps.segments) == len(lengths.intervals) == gaps.max()
    assert caps.segments.interval.tolist() == list(range(1, len(caps.intervals) + 1))
    assert np.array_equal(caps.t[caps.intervals.first], caps.intervals.t_first)
    assert np.array_equal(caps.t[caps.intervals.last], caps.intervals.t_last)
    assert np.array_equal(lengths.t[lengths.intervals.first], lengths.intervals.t_first)
    whole = np.searchsorted(swayed.caps.t, caps.t)
    assert np.array_equal(caps.observed, swayed.caps.observed[whole])
    row = np.searchsorted(swayed.caps.t_command, caps.t_command, side="right") - 1
    assert np.array_equal(caps.control, swayed.caps.control[row])
    assert len(caps.target) == len(caps.t_command) and len(lengths.length) == len(lengths.t)


def smoothed(run: Run, observed: np.ndarray) -> dict[str, np.ndarray]:
    """Caps that were observed, with states that know half a second of later and earlier frames."""
    near = np.abs(run.caps.t[:, None] - run.caps.t[None]) < 0.5
    p = np.einsum("fg,gcx->fcx", near / near.sum(axis=1, keepdims=True), observed)
    return {"observed": observed, "p_WE": p, "v_WE": np.gradient(p, run.caps.t, axis=0)}


@pytest.mark.parametrize("judged", [(1, 2), (3,), (1, 6), (5, 6)])
def test_absurd_numbers_of_judged_intervals_change_nothing(swayed: Run, judged: tuple[int, ...]) -> None:
    """First in the run, in its middle, at both ends or last: caps seven times as far, commands the wrong way and
    lengths of 10 m there change no finding, nor where the fit begins."""
    lengths = swayed.lengths
    assert lengths is not None
    frame, row, read = (of_judged(swayed, judged, t) for t in (swayed.caps.t, swayed.caps.t_command, lengths.t))
    observed, control, length = swayed.caps.observed.copy(), swayed.caps.control.copy(), lengths.length.copy()
    observed[frame] *= 7.0
    control[row] *= -1.0
    length[read] = 9.9
    spoiled = replace(
        with_caps(swayed, **smoothed(swayed, observed), control=control), lengths=replace(lengths, length=length)
    )
    seen = with_caps(swayed, **smoothed(swayed, swayed.caps.observed))
    mine, other = split(seen, judged), split(spoiled, judged)
    found = parity(mine)
    assert found.findings
    assert found == parity(other)
    assert late_readings(mine) == late_readings(other)


def test_a_command_that_was_sent_between_two_frames_is_that_of_its_interval(swayed: Run) -> None:
    """Ticks lie between frames: the command of interval 3 is sent 10 ms before its first frame. Judged, it is not
    there; fitted, it is, from that frame on."""
    caps = swayed.caps
    frame = int(caps.intervals.first[2])
    t_command = caps.t_command.copy()
    row = int(np.searchsorted(t_command, caps.t[frame]))
    t_command[row] = caps.t[frame] - 0.01
    early = with_caps(swayed, t_command=t_command)
    (before,) = fitted_runs(split(early, (3, 5)))
    (after,) = fitted_runs(split(early, (1, 2)))
    assert before.caps.t_command[-1] < t_command[row]
    assert after.caps.t_command[0] == caps.t[frame]
    assert np.array_equal(after.caps.control[0], caps.control[row])


def test_a_camera_of_which_every_frame_is_known_to_be_as_good_is_cut_alike(swayed: Run) -> None:
    """What is said of each frame belongs to it, and what was learned of the whole run to none of its parts."""
    sd = np.random.default_rng(0).uniform(1e-3, 2e-3, swayed.caps.observed.shape)
    known = with_caps(swayed, observed_sd=sd, sensor_bias=np.zeros(9))
    (cut,) = fitted_runs(split(known, (1, 2)))
    assert cut.caps.observed_sd is not None
    assert np.array_equal(cut.caps.observed_sd, sd[int(swayed.caps.intervals.first[2]) :])
    assert cut.caps.sensor_bias is None and np.isfinite(cut.known.p_WE).all()


def test_a_run_that_is_judged_whole_is_not_there(swayed: Run) -> None:
    """And one of which nothing is judged is there as it is."""
    both = replace(evidence_of((swayed, swaying("h", 4))), fit=(Selection("h", EVERY),), judge=(Selection("g", EVERY),))
    (only,) = fitted_runs(both)
    assert only is both.runs[1]


@pytest.mark.parametrize("judged", SPLITS[::5])
def test_sensors_are_not_heard_in_judged_intervals(swayed: Run, judged: tuple[int, ...]) -> None:
    """Where the simulator is refitted readings of judged intervals are not there, all others are, and the caps, which
    start states go through, stay."""
    (run,) = unheard(split(swayed, judged))
    assert run.caps is swayed.caps and run.lengths is not None and swayed.lengths is not None
    kept = ~of_judged(swayed, judged, swayed.lengths.t)
    assert np.array_equal(run.lengths.t, swayed.lengths.t[kept])
    assert np.array_equal(run.lengths.length, swayed.lengths.length[kept])


def test_how_much_a_sensor_scatters_is_not_learned_from_judged_intervals(swayed: Run) -> None:
    """Twenty times the noise in the last three of six intervals: that of a sensor is what it was."""
    lengths = swayed.lengths
    assert lengths is not None
    loud, later = lengths.length.copy(), of_judged(swayed, (4, 5, 6), lengths.t)
    loud[later] += 0.01 * np.random.default_rng(0).standard_normal(loud[later].shape)
    (run,) = unheard(split(replace(swayed, lengths=replace(lengths, length=loud)), (4, 5, 6)))
    assert run.lengths is not None
    assert noise_of(run.lengths.length) == pytest.approx(noise_of(lengths.length[~later]))
    assert (noise_of(loud) > 2 * noise_of(run.lengths.length)).all()
