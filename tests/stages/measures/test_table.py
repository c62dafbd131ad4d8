"""One table of predictors: figures, free runs step by step, and who is better."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.measures.baselines import LAST_CYCLE, NOTHING_MOVES, SAME_PHASE
from r2s2r_cli.stages.measures.steps import chains, steps_of
from r2s2r_cli.stages.measures.table import Predicted, baselines_of, judge
from tests.stages.measures.gait import FRAMES, run

WALK = run(12)
TEST = (*steps_of(WALK, [8, 9]), *steps_of(WALK, [11, 12]))
TRAIN = steps_of(WALK, range(1, 8))
OFF = np.array([0.0, 0.0, 0.003])


def ours() -> Predicted:
    """3 mm too high at all key frames; free, 1 mm in each interval of the first chain and 5 mm in the second."""
    free = tuple(
        np.concatenate([step.p_WE for step in chain]) + height * OFF / 0.003
        for chain, height in zip(chains(TEST), (0.001, 0.005), strict=True)
    )
    return Predicted(np.array([step.key for step in TEST]) + OFF, free)


def test_rows_hold_the_measures_of_the_design() -> None:
    """3 mm at the key frames, (2 * 1 + 2 * 5) / 4 = 3 mm free, by interval 1, 1, 5, 5 mm of 6 frames each."""
    row = judge(TEST, {"ours": ours()})["ours"]
    assert row.key.rmse_m == pytest.approx(0.003)
    assert row.free_m == pytest.approx(0.003)
    assert row.free_by_step == pytest.approx([0.001, 0.001, 0.005, 0.005])
    assert row.free_frames.tolist() == [FRAMES] * 4


def test_the_baselines_stand_in_the_same_table() -> None:
    """An exact gait is repeated exactly and beats ours; 'nothing moves' does not."""
    rows = judge(TEST, {"ours": ours(), **baselines_of(TEST, TRAIN)})
    assert list(rows) == ["ours", NOTHING_MOVES, SAME_PHASE, LAST_CYCLE]
    assert rows[SAME_PHASE].key.rmse_m == pytest.approx(0.0, abs=1e-12)
    assert rows[LAST_CYCLE].free_m == pytest.approx(0.0, abs=1e-12)
    worse, better = rows["ours"].against(rows[SAME_PHASE]), rows["ours"].against(rows[NOTHING_MOVES])
    assert worse is not None and better is not None
    assert worse.interval.value == pytest.approx(0.003)
    assert (worse.ours_better, better.ours_better) == (0.0, 1.0)
    free = rows["ours"].free_against(rows[NOTHING_MOVES])
    assert free is not None
    assert free.interval.value == pytest.approx(0.003 - (rows[NOTHING_MOVES].free_m or 0.0))


def test_a_chain_that_is_not_predicted_leaves_no_free_run() -> None:
    """One of two chains missing: no figure over all, the other chain still compared; none asked for: nothing at all."""
    key, (one, _) = ours().key, ours().free
    rows = judge(TEST, {"half": Predicted(key, (one, None)), "none": Predicted(key), "ours": ours()})
    assert rows["half"].free_m is None
    assert np.isnan(rows["half"].free_by_step).tolist() == [False, False, True, True]
    difference = rows["half"].free_against(rows["ours"])
    assert difference is not None and difference.interval.n == 2
    assert rows["none"].free_m is None
    assert rows["none"].free_against(rows["ours"]) is None


def test_frames_of_another_run_are_refused() -> None:
    """A free run that is one frame short."""
    short = tuple(None if one is None else one[:-1] for one in ours().free)
    with pytest.raises(ValueError, match="equal shapes"):
        judge(TEST, {"ours": Predicted(ours().key, short)})
