"""Key-frame and free-run errors of known offsets; gap, own share and 'no gap' by their definitions."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.measures.gap import corrected_gap, no_gap, own_share
from r2s2r_cli.stages.measures.keyframes import free_run, keyframe_errors

ZERO = np.zeros((2, 3, 3))


def test_an_equal_offset_of_all_caps_is_the_rmse() -> None:
    """(3, 4, 12) mm everywhere is 13 mm: overall and by segment."""
    errors = keyframe_errors(ZERO, ZERO + np.array([0.003, 0.004, 0.012]))
    assert errors.rmse_m == pytest.approx(0.013)
    assert errors.per_segment_m == pytest.approx([0.013] * 2)


def test_squares_are_averaged_over_caps_and_segments() -> None:
    """One cap of six off by 6 mm: 6 / sqrt(6) overall, 6 / sqrt(3) in its segment."""
    simulated = ZERO.copy()
    simulated[1, 2, 0] = 0.006
    errors = keyframe_errors(ZERO, simulated)
    assert errors.rmse_m == pytest.approx(0.006 / 6**0.5)
    assert errors.per_segment_m == pytest.approx([0.0, 0.006 / 3**0.5])


def test_a_segment_without_prediction_is_left_out_and_said() -> None:
    """The RMSE is that of the other segment; without any prediction there is none."""
    simulated = ZERO + np.array([0.005, 0.0, 0.0])
    simulated[0, 1, 2] = np.nan
    errors = keyframe_errors(ZERO, simulated)
    assert errors.judged.tolist() == [False, True]
    assert errors.rmse_m == pytest.approx(0.005)
    assert np.isnan(errors.per_segment_m[0])
    assert keyframe_errors(ZERO, np.full_like(ZERO, np.nan)).rmse_m is None


@pytest.mark.parametrize("observed", [np.zeros((2, 4, 3)), np.full((2, 3, 3), np.nan)])
def test_wrong_observations_are_refused(observed: np.ndarray) -> None:
    """Another number of caps, or an observation that is not finite."""
    with pytest.raises(ValueError, match=r"expected|finite"):
        keyframe_errors(observed, ZERO)


def test_a_free_run_is_averaged_over_frames_not_over_squares() -> None:
    """Frames 2 mm and 8 mm off have a mean of 5 mm, not a root mean square of 5.8 mm."""
    assert free_run(ZERO, ZERO + np.array([0.002, 0.008])[:, None, None] * np.array([0, 1, 0])) == pytest.approx(0.005)


def test_the_gap_is_what_is_left_above_the_floor() -> None:
    """13^2 = 5^2 + 12^2, and nothing below the floor."""
    assert corrected_gap(0.013**2, 0.005) == pytest.approx(0.012)
    assert corrected_gap(0.004**2, 0.005) == 0.0


def test_own_share_pools_squares_before_the_ratio() -> None:
    """Segments of 6 and 16 mm^2, floor 1 mm: G falls from sqrt(10) to sqrt(4 - 1); the mean of ratios is another."""
    share = own_share(1e-6 * np.array([6.0, 16.0]), 1e-6 * np.array([2.0, 6.0]), 1e-3)
    assert share == pytest.approx(1 - 3**0.5 / 10**0.5)


def test_own_share_is_null_at_the_floor_and_negative_where_the_effect_harms() -> None:
    """G_refit of 0.49 floors is at the floor, of 0.51 is not; an effect that makes it worse has a negative share."""
    floor = 2e-3
    at, above = (np.array([floor**2 * (1 + g**2)]) for g in (0.49, 0.51))
    assert own_share(at, np.array([0.0]), floor) is None
    assert own_share(above, np.array([0.0]), floor) == pytest.approx(1.0)
    assert own_share(above, 4 * above, floor) < 0  # type: ignore[operator]
    assert own_share(np.zeros(2), np.zeros(2), 0.0) is None


def test_no_gap_needs_the_bound_below_a_quarter_above_the_floor() -> None:
    """Floor 8 mm: 9.9 mm is no gap, 10.1 mm may be one."""
    assert no_gap(0.0099, 0.008)
    assert not no_gap(0.0101, 0.008)
