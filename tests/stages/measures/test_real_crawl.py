"""The figures of docs/concepts/measures.md on the real crawl."""

from __future__ import annotations

from pathlib import Path

import pytest

from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.stages.identify.data import RunData
from r2s2r_cli.stages.identify.load import run_data
from r2s2r_cli.stages.measures.baselines import LAST_CYCLE, NOTHING_MOVES, SAME_PHASE
from r2s2r_cli.stages.measures.floor import floor_of
from r2s2r_cli.stages.measures.steps import steps_of
from r2s2r_cli.stages.measures.table import baselines_of, judge
from schemas.estimate import EstimateSettings
from tests.stages.estimate.builders import real_crawl, threebar


@pytest.fixture(scope="module")
def crawl(real_dir: Path) -> RunData:
    """The published part of the crawl."""
    recording = real_crawl(real_dir)
    return run_data(recording, estimate(recording, threebar(), EstimateSettings())[0], "crawl")


def test_baselines_of_the_published_part(crawl: RunData) -> None:
    """Trained on 1-7, tested on 8-11: key frames and free run in mm, as the page prints them."""
    test = steps_of(crawl, range(8, 12))
    rows = judge(test, baselines_of(test, steps_of(crawl, range(1, 8))))
    keys = [round(1e3 * (rows[name].key.rmse_m or 0), 1) for name in (NOTHING_MOVES, SAME_PHASE, LAST_CYCLE)]
    free = [round(1e3 * (rows[name].free_m or 0), 1) for name in (NOTHING_MOVES, SAME_PHASE, LAST_CYCLE)]
    assert keys == pytest.approx([45.0, 10.9, 11.2], abs=0.15)
    assert free == pytest.approx([40.3, 11.3, 10.9], abs=0.15)


def test_nothing_repeats_the_tip_over(crawl: RunData) -> None:
    """Trained on 5-11, tested on 1-4: intervals 1 and 2 are silent, and so is the free run."""
    test = steps_of(crawl, range(1, 5))
    row = judge(test, baselines_of(test, steps_of(crawl, range(5, 12))))[SAME_PHASE]
    assert row.key.judged.tolist() == [False, False, True, True]
    assert row.free_m is None


def test_floor_of_the_published_part(crawl: RunData) -> None:
    """8.0 mm from 5 contrasts; interval 3 is faulty, 2 stands on other caps, 1 has no previous target."""
    found = floor_of(steps_of(crawl, range(1, 12)))
    assert found is not None
    assert 1e3 * found.floor_m == pytest.approx(8.0, abs=0.15)
    assert 1e3 * found.sensor_m == pytest.approx(3.6, abs=0.15)
    assert sorted(tuple(number for _, number in phase) for phase in found.phases) == [(4, 7, 10), (5, 8, 11), (6, 9)]
