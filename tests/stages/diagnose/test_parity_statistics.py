"""False discoveries are as rare as promised, findings of healthy logs too; and poor evidence gives what it can."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity import parity
from r2s2r_cli.stages.diagnose.parity.finding import (
    ABSOLUTE,
    MOST_NATS,
    Element,
    Finding,
    Parity,
    Suspicion,
    discoveries,
)
from r2s2r_cli.stages.diagnose.parity.fitted import fitted_runs
from r2s2r_cli.stages.diagnose.parity.lengths import late_readings
from r2s2r_cli.stages.diagnose.parity.parity import finding_of
from r2s2r_cli.stages.diagnose.parity.quantities import Quantities
from r2s2r_cli.stages.diagnose.parity.series import Measured, combined, regression
from r2s2r_cli.stages.identify.data import Selection
from tests.support.parity_log import evidence_of, foremost, swaying, with_caps


def test_false_discoveries_stay_below_the_level() -> None:
    """50 tests, 10 of them of something, 2000 times: the mean share of false among the discoveries is at most 5 %
    (three standard errors), and of nothing at all it is the chance of any discovery."""
    rng = np.random.default_rng(0)
    shares, found = [], 0
    for _ in range(2000):
        p = rng.random(50)
        p[:10] = rng.random(10) * 1e-3
        kept = discoveries(p, 0.05)
        shares.append(kept[10:].sum() / max(kept.sum(), 1))
        found += kept[:10].sum()
    assert np.mean(shares) < 0.05 + 3 * np.std(shares) / np.sqrt(2000)
    assert found > 0.9 * 2000 * 10
    none = np.mean([discoveries(rng.random(50), 0.05).any() for _ in range(2000)])
    assert none < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 2000)


def test_nan_is_never_a_discovery() -> None:
    """What could not be tested does not count, not even as a test."""
    assert discoveries(np.array([np.nan, 0.04, np.nan]), 0.05).tolist() == [False, True, False]
    assert not discoveries(np.zeros(0), 0.05).any()


@pytest.mark.slow
def test_healthy_logs_have_few_findings() -> None:
    """Ten sets with nothing wrong: at most two have any significant finding."""
    loud = [
        bool(parity(evidence_of(tuple(swaying(f"g{k}", 100 * seed + k) for k in range(3)),
                                tuple(swaying(f"c{k}", 100 * seed + 50 + k) for k in range(2)))).significant)
        for seed in range(1, 11)
    ]  # fmt: skip
    assert sum(loud) <= 2


def test_clusters_widen_the_error() -> None:
    """A mean of 20 groups with an error of their own each: the stated error is that of the groups, not of the rows."""
    rng = np.random.default_rng(3)
    found, said = [], []
    for _ in range(60):
        group = np.repeat(np.arange(20), 30)
        y = rng.standard_normal(20)[group] + 0.1 * rng.standard_normal(600)
        beta, cov = regression(y, np.ones((600, 1)), group)
        found.append(beta[0])
        said.append(np.sqrt(cov[0, 0]))
    assert 0.7 < np.std(found) / np.mean(said) < 1.4


def test_measurements_that_disagree_are_less_sure() -> None:
    """Two numbers five errors apart: the mean between them, and an error that says so."""
    one = combined([Measured(0.0, 1.0), Measured(7.0, 1.0)])
    assert one.value == 3.5
    assert one.sd > 3.0
    assert np.isnan(combined([Measured(np.nan, 1.0)]).value)


def test_one_run_without_lengths_and_healthy_runs_says_what_is_missing() -> None:
    """What is there is used: rods are measured; sensors and healthy runs are named as missing."""
    found = parity(evidence_of((replace(swaying("g", 1), lengths=None),)))
    assert found.of("camera_scale")
    assert not found.of("sensor_bias")
    assert not found.differential
    said = " ".join(found.missing)
    assert "no sensor was logged" in said
    assert "healthy runs" in said


def test_caps_that_were_lost_half_of_the_time_are_counted() -> None:
    """Every second frame of two caps marked as an outlier: a sixth of all is missing, and the lengths are those of the
    rest."""
    run = swaying("g", 1)
    quality = run.caps.quality.copy()
    quality[::2, :2] = 2
    found = parity(evidence_of((with_caps(run, quality=quality),)))
    assert abs(found.of("dropout")[0].value - 1 / 6) < 0.01
    assert found.of("dropout")[0] in found.significant
    assert foremost(found) == ("dropout", None)
    assert abs(found.starts()["dropout"]["lost"] - 1 / 6) < 0.01


def test_nothing_of_judged_intervals_is_looked_at() -> None:
    """A split through a run: numbers of the judged part, even absurd ones, change no finding."""
    run = swaying("g", 3)
    split = replace(
        evidence_of((run,)), fit=(Selection("g", (1, 2, 3)),), judge=(Selection("g", (4, 5, 6)),)
    )  # fmt: skip
    frame, tick = int(run.caps.intervals.first[3]), int(np.searchsorted(run.caps.t_command, 6.0))
    observed, control = run.caps.observed.copy(), run.caps.control.copy()
    observed[frame:] *= 7.0
    control[tick:] = -control[tick:]
    assert run.lengths is not None
    length = run.lengths.length.copy()
    length[tick:] = 9.9
    spoiled = replace(with_caps(run, observed=observed, control=control), lengths=replace(run.lengths, length=length))
    spoiled_split = replace(split, runs=(spoiled,))
    first, second = parity(split), parity(spoiled_split)
    assert first.findings
    assert first == second
    # Nor does the fit begin elsewhere: as the fitted part alone says.
    alone = replace(split, runs=fitted_runs(split), judge=())
    assert late_readings(split) == late_readings(spoiled_split) == late_readings(alone) != 0.0


def test_what_findings_say_in_nats_is_half_their_square_by_effect_and_element() -> None:
    """Lost caps speak for `dropout` with half their squared z, and no element; what two findings say of one element is
    not added, and nothing says more than MOST_NATS."""
    run = swaying("g", 1)
    quality = run.caps.quality.copy()
    quality[::2, :2] = 2
    found = parity(evidence_of((with_caps(run, quality=quality),)))
    z = found.of("dropout")[0].z
    assert found.nats()["dropout"][None] == pytest.approx(min(0.5 * z**2, MOST_NATS))
    by_sensor = {one.element.index: 0.5 * one.z**2 for one in found.of("sensor_drift")}
    for index, nats in found.nats()["sensor_bias"].items():
        assert nats >= 0.8 * min(by_sensor.get(index, 0.0), MOST_NATS)
        assert nats <= MOST_NATS


@pytest.mark.parametrize(("height", "compared"), [(0.0045, False), (-0.0045, False), (0.0025, True)])
def test_a_cap_that_hung_in_healthy_runs_is_not_compared_with_them(height: float, compared: bool) -> None:
    """Millimetres above the ground are no wear: today's cap, which stands, had looked as if it had shrunk."""
    key = ("cap_height", "cap", 2)
    healthy = Quantities({key: Measured(height, 5e-4)}, {}, 0.03, (), np.zeros(9))
    today = Quantities({key: Measured(-3e-4, 4e-4)}, {}, 0.03, (), np.zeros(9))
    found = finding_of(key, today.of[key], healthy, today)
    assert found is not None and found.differential == compared
    assert (abs(found.z) > 2.0) == compared


def test_what_no_healthy_run_confirms_counts_less_beside_them() -> None:
    """Among findings that were compared with healthy runs, one that could not be counts a quarter; without healthy runs
    all are alike, and the calibration sees to it."""

    def finding(index: int, differential: bool) -> Finding:
        return Finding(
            "cap_height", Element("cap", index), 1e-3, 2e-4, "m", 0.0, 0.0, differential, 5.0, 1e-6, "",
            (Suspicion("cap_radius"),),
        )  # fmt: skip

    both = (finding(1, True), finding(2, False))
    nats = Parity(both, differential=True).nats()["cap_radius"]
    assert nats == {1: pytest.approx(12.5), 2: pytest.approx(12.5 * ABSOLUTE)}
    assert Parity(both[1:], differential=False).nats()["cap_radius"] == {2: pytest.approx(12.5)}
