"""Key frames, remapping and the mask on trajectories made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.identify.paper import KeyFrames, Spans, direction_mask, key_frames, spans
from r2s2r_cli.stages.segments import segments, target_intervals


def back_to_back(*took: float, interval: list[int] | None = None) -> Spans:
    """Segments that follow each other without a gap, from t = 0; one an interval unless said otherwise."""
    ends = np.cumsum(took)
    return Spans(np.array(interval or range(1, len(took) + 1)), ends - took, ends, ends)


def paper_figure() -> KeyFrames:
    """The paper's figure of the Key Frame Loss: the simulation takes less time in gaits 0 and 2, more in gait 1, and
    less altogether. Real frames every 0.1 s."""
    return key_frames(np.arange(0, 60) / 10, back_to_back(2.0, 1.5, 2.0), back_to_back(1.4, 1.8, 1.5))


def test_key_frames_of_the_papers_figure() -> None:
    """KF0 and KF2 lie where the simulated gait ends, KF1 where the real one does, each after its own start."""
    keys = paper_figure()
    assert keys.tau == pytest.approx([1.4, 1.5, 1.5])
    assert keys.frame.tolist() == [14, 35, 50]
    assert keys.first.tolist() == [0, 20, 35]
    assert keys.start_sim == pytest.approx([0.0, 1.4, 3.2])
    assert (keys.whole_real, keys.whole_sim) == pytest.approx((5.5, 4.7))


def test_the_mask_keeps_gaits_0_and_2_of_the_papers_figure() -> None:
    """The whole simulation takes less time: only gaits that slow it down count."""
    mask = direction_mask(paper_figure())
    assert mask.kept.tolist() == [True, False, True]
    assert "0.80 s less long" in mask.words


def test_the_mask_the_other_way_round() -> None:
    """A simulation that takes longer: gaits in which it was faster are left out; equal times contradict nothing."""
    t = np.arange(0, 80) / 10
    keys = key_frames(t, back_to_back(1.0, 1.0, 1.0), back_to_back(2.0, 0.8, 1.0))
    assert direction_mask(keys).kept.tolist() == [True, False, True]
    same = key_frames(t, back_to_back(1.0, 1.0), back_to_back(1.2, 0.8))
    assert direction_mask(same).kept.all()


def test_the_mask_does_not_apply_to_command_replay() -> None:
    """Durations are given with the commands: everything is kept, and the words say why."""
    mask = direction_mask(paper_figure(), closed_loop=False)
    assert mask.kept.all()
    assert "not applicable" in mask.words


def test_nothing_left_keeps_everything() -> None:
    """Where the missing time lies in no segment of its own, all count, and the words say so."""
    keys = paper_figure()
    odd = KeyFrames(**{**vars(keys), "took_sim": keys.took_real + 0.1})
    mask = direction_mask(odd)
    assert mask.kept.all()
    assert "no segment does" in mask.words


def test_irregular_stamps_take_the_last_frame_within_the_intersection() -> None:
    """Real frames at odd times, with a late first one: the key frame is the last at or before the common duration, and
    its time counts from the segment's own first frame, not from the clock."""
    t = np.array([0.0, 0.107, 0.19, 0.36, 0.41, 0.52, 0.703, 0.81, 0.95])
    target = np.repeat([[0.0], [1.0]], [4, 5], axis=0)
    own = segments(target_intervals(t, target, control=np.zeros((9, 1))), t, np.zeros((9, 1)))
    real = spans(own, [1, 2])
    assert (real.t_first.tolist(), real.t_last.tolist()) == ([0.0, 0.41], [0.36, 0.95])
    assert real.t_next.tolist() == [0.41, 0.95]
    keys = key_frames(t, real, back_to_back(0.20, 0.40))
    assert keys.frame.tolist() == [2, 7]
    assert keys.tau == pytest.approx([0.19, 0.40])
    # The real segment's time runs until the next begins, so that the frame rate does not make it look short.
    assert keys.took_real == pytest.approx([0.41, 0.54])


def test_a_simulation_lasts_until_the_next_segment() -> None:
    """Ticks of 20 ms: the exact segment ends where the next begins, one tick after its own last."""
    t = np.arange(10) * 0.02
    target = np.repeat([[0.0], [1.0]], [6, 4], axis=0)
    own = segments(target_intervals(t, target, control=np.zeros((10, 1))), t, np.zeros((10, 1)))
    assert spans(own, [1, 2], exact=True).t_last == pytest.approx([0.12, 0.18])
    assert spans(own, [1, 2]).t_last == pytest.approx([0.10, 0.18])


def test_intervals_of_a_later_stretch() -> None:
    """Intervals 3 and 4 of the run are the simulation's 1 and 2."""
    t = np.arange(0, 40) / 10
    real = back_to_back(1.0, 1.0, interval=[3, 4])
    keys = key_frames(t, real, back_to_back(0.8, 1.2), offset=2)
    assert keys.interval.tolist() == [3, 4]
    assert len(key_frames(t, real, back_to_back(0.8, 1.2))) == 0


def test_reversals_that_only_one_side_saw() -> None:
    """Equal numbers of segments are paired in order; else the interval is one segment, from its start to its end."""
    t = np.arange(0, 40) / 10
    both = key_frames(t, back_to_back(0.5, 0.7, interval=[1, 1]), back_to_back(0.6, 0.5, interval=[1, 1]))
    assert both.tau == pytest.approx([0.5, 0.5])
    one = key_frames(t, back_to_back(0.5, 0.7, interval=[1, 1]), back_to_back(1.0))
    assert (one.tau.tolist(), one.took_real.tolist()) == ([1.0], [1.2])


def test_a_start_alone_is_no_key_frame() -> None:
    """A segment over before the second real frame says nothing and is left out."""
    keys = key_frames(np.arange(0, 40) / 10, back_to_back(1.0, 1.0), back_to_back(0.05, 1.0))
    assert keys.interval.tolist() == [2]
