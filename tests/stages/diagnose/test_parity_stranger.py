"""Offsets of all sensors together: what a law of the catalogue has, and what none has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity import parity
from r2s2r_cli.stages.diagnose.parity.finding import Element, Finding
from r2s2r_cli.stages.diagnose.parity.stranger import FEWEST, stranger
from tests.support.parity_log import Faults, evidence_of, swaying

ABOUT = np.array([0.18, 0.20, 0.16, 0.22, 0.19, 0.21, 0.34, 0.35, 0.36])
"""[m]"""
SD = 1.5e-3
NEAR = np.random.default_rng(0).normal(0.0, SD, len(ABOUT))
"""Errors of the offsets [m]."""


def offsets(size: np.ndarray) -> list[Finding]:
    """Findings of sensors that read `size` (sensor,) [m] too much, which healthy runs did not."""
    return [
        Finding("sensor_bias", Element("sensor", k), float(by), SD, "m", 0.0, 0.0, True, float(by / SD), 0.0, "")
        for k, by in enumerate(size)
    ]


def one(k: int, by: float) -> np.ndarray:
    """Sensor k alone."""
    return by * (np.arange(len(ABOUT)) == k)


@pytest.mark.parametrize(
    "size",
    [
        0.0 * ABOUT,
        one(2, 0.03),
        0.02 + 0.0 * ABOUT,
        0.12 * ABOUT,
        one(2, 0.03) + one(7, -0.02),
        one(1, 0.02) - 0.1 * ABOUT,
    ],
    ids=["nothing", "one", "all alike", "a gain of all", "two", "one and a gain of all"],
)
def test_what_laws_of_the_catalogue_explain_is_no_stranger(size: np.ndarray) -> None:
    """One effect or a pair, whatever their sizes: errors alone are left."""
    assert stranger(offsets(size + NEAR), ABOUT) is None


def test_neighbours_that_talk_across_are() -> None:
    """Three of nine are off by the same; the words name them and nobody else."""
    found = stranger(offsets(one(0, 0.02) + one(7, 0.021) + one(8, 0.019) + NEAR), ABOUT)
    assert found is not None
    assert (found.channel, found.element) == ("sensing", Element("sensor"))
    assert found.left > 36.0
    assert [k for k in range(9) if f"sensor {k} by" in found.what] == [0, 7, 8]


def test_many_small_offsets_are_no_stranger() -> None:
    """Each of three sd: the camera sees all cables a little wrong; their squares alone would be enough."""
    sign = np.array([1, -1, 1, 1, -1, -1, 1, -1, 1])
    assert stranger(offsets(3.0 * SD * sign), ABOUT) is None


def test_what_is_told_is_never_empty() -> None:
    """The three largest, though none is loud by itself."""
    sign = np.array([1, -1, 1, 1, -1, -1, 1, -1, 1])
    found = stranger(offsets(4.6 * SD * sign + 0.1 * SD * np.arange(9)), ABOUT)
    assert found is not None and found.what.count("sensor ") == 3


def test_what_no_healthy_run_was_compared_with_does_not_count() -> None:
    """Sensors that nobody calibrated are each off by their own."""
    size = one(0, 0.02) + one(7, 0.021) + one(8, 0.019) + NEAR
    assert stranger([replace(each, differential=False) for each in offsets(size)], ABOUT) is None


def test_more_sensors_may_leave_more() -> None:
    """Errors of 24 sensors that are half as large again as they are said to be leave as much as three wrong ones."""
    rng = np.random.default_rng(0)
    about = rng.uniform(0.15, 0.4, 24)
    for _ in range(20):
        errors = 1.5 * rng.normal(0.0, SD, 24)
        assert stranger(offsets(errors), about) is None
    three = np.where(np.arange(24) < 3, 12.0 * SD, 0.0)
    assert stranger(offsets(three + rng.normal(0.0, SD, 24)), about) is not None


@pytest.mark.parametrize("commissioned", [True, False])
def test_the_parity_stage_hears_them(commissioned: bool) -> None:
    """Logs of three sensors that read 20 mm more than they did; of the same robot without healthy runs nothing is known
    of before."""
    wrong = Faults(bias=np.where(np.isin(np.arange(9), [0, 7, 8]), 0.02, 0.0))
    runs = tuple(swaying(f"g{k}", k, wrong) for k in range(2))
    found = parity(evidence_of(runs, (swaying("c", 10),) if commissioned else ()))
    assert (found.stranger is not None) == commissioned
    if found.stranger is not None:
        assert [k for k in range(9) if f"sensor {k} by" in found.stranger.what] == [0, 7, 8]


def test_few_sensors_say_nothing() -> None:
    """Too little is left beside two laws."""
    size = np.array([0.02, -0.03, 0.05])
    assert len(size) < FEWEST and stranger(offsets(size), ABOUT) is None
