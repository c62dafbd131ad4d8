"""`r2s2r bench identify`: both tools get the same problem, each of its own simulator, and what is counted is right."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.commands.bench_identify import _rms, _tried
from r2s2r_cli.commands.bench_identify_case import BOUNDS, NOISE_M, NUMBERS, OFF, SPREAD, Case, Fit, make_case
from r2s2r_cli.commands.bench_identify_mujoco import SysidSide
from r2s2r_cli.commands.bench_identify_ours import PHASE, OurSide, predictor_of
from r2s2r_cli.commands.bench_identify_tally import judged, share, summed_up
from r2s2r_cli.stages.identify.growing import problem_of
from r2s2r_cli.stages.identify.solve.population import HELD
from tests.commands.conftest import document, invoke
from tests.guards.listing import ROOT
from tests.support.rig_robots import known

ROBOT = known()


def _case(seed: int = 0, run_s: float = 1.0) -> Case:
    return make_case(ROBOT, seed, run_s=run_s)


def test_cases_are_as_described() -> None:
    """Planted values, starts, bounds and noise lie where the constants say; the robot of a case reads back its values;
    a seed gives its case again."""
    cases = [_case(seed) for seed in range(40)]
    nominal = np.array([number.read(ROBOT) for number in NUMBERS.values()])
    truth, start = np.array([one.truth for one in cases]), np.array([one.start for one in cases])
    assert np.abs(truth / nominal - 1).max() <= SPREAD
    off = np.abs(start / truth - 1)
    assert off.min() >= OFF[0]
    assert off.max() <= OFF[1]
    assert 0 < np.mean(start > truth) < 1
    for one in cases:
        assert (one.lower < one.start).all()
        assert (one.start < one.upper).all()
        np.testing.assert_allclose(one.lower, BOUNDS[0] * nominal)
        planted = [number.read(one.robot(one.truth)) for number in NUMBERS.values()]
        np.testing.assert_allclose(planted, one.truth, rtol=1e-12)
    noise = np.concatenate([one.noise.ravel() for one in cases])
    assert noise.std() == pytest.approx(NOISE_M, rel=4 / np.sqrt(2 * noise.size))
    np.testing.assert_array_equal(_case(3).u, cases[3].u)
    np.testing.assert_array_equal(_case(3).noise, cases[3].noise)


def test_at_the_planted_values_each_tool_sees_its_noise() -> None:
    """What both simulators leave at the planted values is the noise of the case, to the last bit of it; at the start it
    is more."""
    case = _case()
    theirs = SysidSide(case, 0.002)
    size = float(np.sqrt(np.mean(case.noise**2)))
    assert theirs.rms(case.truth) == pytest.approx(size, rel=1e-9)
    assert theirs.rms(case.start) > 1.5 * size
    ours = OurSide(case, predictor_of(ROBOT))
    problem = problem_of(ours.predictor, [ours.window], ours.recipe())
    found = problem.evaluate(_coordinates(ours, ours.truth), jacobian=False).residual
    np.testing.assert_allclose(-found * NOISE_M, case.noise.ravel(), atol=1e-12)
    far = problem.evaluate(_coordinates(ours, case.start), jacobian=False).residual
    assert np.sqrt(np.mean(far**2)) > 1.5


def _coordinates(ours: OurSide, values: np.ndarray) -> np.ndarray:
    return np.array([free.to_z(float(value)) for free, value in zip(ours.frees, values, strict=True)])


@pytest.mark.parametrize("name", NUMBERS)
def test_each_number_reaches_mujoco(name: str) -> None:
    """A number edited in the toolbox's specification simulates the robot that robot.toml would describe with it."""
    case = _case()
    changed = case.truth.copy()
    changed[list(NUMBERS).index(name)] *= 0.9
    other = replace(case, nominal=case.robot(changed))
    edited, written = SysidSide(case, 0.002), SysidSide(other, 0.002)
    np.testing.assert_allclose(_model(edited, changed), _model(written, changed), rtol=1e-12, atol=1e-15)
    assert not np.allclose(_model(edited, case.truth), _model(edited, changed), rtol=1e-6)


def _model(side: SysidSide, values: np.ndarray) -> np.ndarray:
    """Friction of the ground, and the law of every actuator, of the model that the toolbox would simulate; gains times
    the speed for which the controls are made."""
    from mujoco import sysid

    model = sysid.apply_param_modifiers(side._parameters(values), side._spec)
    speed = NUMBERS["motor_speed"].read(side.case.nominal)
    gain = np.asarray(model.actuator_gainprm)[:, 0] * speed
    return np.concatenate([model.geom("ground").friction[:1], gain, np.asarray(model.actuator_biasprm)[:, :3].ravel()])


def _fit(estimate: list[float], half: float, cpu_s: float = 2.0) -> Fit:
    x = np.array(estimate)
    return Fit(estimate=x, low=x - half, high=x + half, cpu_s=cpu_s, rollouts=3.0, rms_m=1e-3)


def test_solved_means_near_or_within_three_standard_deviations() -> None:
    """2 % off is solved with any interval, 4 % with a standard deviation of 1.4 % of it but not of 1.3 %; a fit that
    failed is not solved, and one without an interval is judged by the 2 % alone."""
    case = _case()
    truth = case.truth

    def solved(factor: float, sd: float) -> bool:
        half = 1.959963984540054 * sd * truth
        fit = Fit(estimate=factor * truth, low=factor * truth - half, high=factor * truth + half, cpu_s=1.0,
                  rollouts=1.0, rms_m=0.0)  # fmt: skip
        return judged(case, truth, fit).solved

    assert solved(1.019, 1e-6)
    assert not solved(1.021, 1e-6)
    assert solved(0.96, 0.014)
    assert not solved(0.96, 0.013)
    assert not solved(1.5, np.inf)
    assert solved(1.01, np.inf)
    failed = judged(case, truth, "no finite simulation")
    assert not failed.solved
    assert failed.low == (None,) * 5
    assert failed.failed == "no finite simulation"


def test_covered_counts_values_and_none_is_not_covered() -> None:
    """One case whose intervals hold all five, one without intervals: 5 of 10, 5 without, ratio of processor times."""
    case = _case()
    around = judged(case, case.truth, _fit(list(case.truth * 1.001), 10.0))
    without = judged(case, case.truth, _fit(list(case.truth), np.inf, cpu_s=6.0))
    by = summed_up("x", [around, without], ours_cpu_s=[0.1, 0.4])
    assert (by.covered.count, by.covered.total, by.without_interval) == (5, 10, 5)
    assert by.cpu_ratio == pytest.approx(16.0)
    assert by.cpu_median_ratio == pytest.approx((2.0 / 0.1 + 6.0 / 0.4) / 2)
    assert by.cpu_median_s == pytest.approx(4.0)
    assert by.error_median == pytest.approx(0.0005, abs=1e-9)
    assert (by.solved.count, by.solved.total) == (2, 2)


def test_a_fit_that_failed_spent_its_time_and_leaves_no_residual(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three seconds until an error are three seconds, not none: else who fails is fast, and nobody else's ratio to it
    means anything. The median residual is of the fits that there are."""
    case = _case()
    ticks = iter((1.0, 4.0))
    monkeypatch.setattr("time.process_time", lambda: next(ticks))

    def fails() -> Fit:
        raise ArithmeticError

    failed = judged(case, case.truth, *_tried(fails))
    assert (failed.failed, failed.cpu_s) == ("ArithmeticError", 3.0)
    found = judged(case, case.truth, _fit(list(case.truth), 1.0))
    by = summed_up("x", [failed, found], ours_cpu_s=[failed.cpu_s, found.cpu_s])
    assert (by.cpu_ratio, by.cpu_median_ratio, by.cpu_median_s) == (1.0, 1.0, 2.5)
    assert _rms(by) == "1.00 mm"
    assert _rms(summed_up("x", [failed], ours_cpu_s=[failed.cpu_s])) == "none"


def test_the_interval_of_a_share_solves_wilsons_equation() -> None:
    """Both ends p satisfy |count/n - p| = 1.96 sqrt(p (1 - p) / n); 0 of n and n of n touch 0 and 1."""
    for count, total in ((3, 10), (38, 40), (190, 200)):
        one = share(count, total)
        for p in (one.low, one.high):
            assert abs(count / total - p) == pytest.approx(1.959963984540054 * np.sqrt(p * (1 - p) / total))
    assert share(0, 8).low == 0.0
    assert share(8, 8).high == 1.0


def test_the_hard_problem_hides_phases_and_velocities() -> None:
    """Three phases and 18 velocities more are unknown, planted phases are not where they start, and the problem's
    Jacobian knows them all."""
    ours = OurSide(_case(), predictor_of(ROBOT, hard=True))
    assert len(ours.truth) == 8
    assert 0 < np.abs(ours.truth[5:]).max() <= PHASE
    problem = problem_of(ours.predictor, [ours.window], ours.recipe())
    assert np.count_nonzero(problem.prior_sd > HELD) == 8 + 18
    assert np.isfinite(problem.prior_sd[8:]).all()


def test_without_sysid_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra is named in the hint, and the way that needs none."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    result = invoke("bench", "identify")
    assert result.exit_code == 2
    assert f"hint: pip install -e '{ROOT}[rig]'" in result.stderr


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--hard",), "--hard is for ours alone"), (("--cases", "1", "--robot", "fourbar"), "unknown robot"),
        (("--cases", "1", "--growing"), "--growing is for mujoco.sysid"),
        (("--cases", "1", "--seeds", "2"), "--cases says how many cases there are"),
    ],
)  # fmt: skip
def test_wrong_requests_are_refused(arguments: tuple[str, ...], says: str) -> None:
    """An unknown robot; unknown velocities for a tool that cannot free them; a tool that is not asked for."""
    result = invoke("bench", "identify", *arguments)
    assert result.exit_code == 2
    assert says in result.stderr


def _complete(found: dict[str, Any], tools: set[str], cases: int) -> None:
    assert set(found["tools"]) == tools
    assert found["parameters"][: len(NUMBERS)] == list(NUMBERS)
    for by in found["tools"].values():
        assert len(by["cases"]) == cases
        assert by["solved"]["total"] == cases
        assert by["covered"]["total"] == cases * len(found["parameters"])
        assert all(one["cpu_s"] > 0 for one in by["cases"])


@pytest.mark.slow
def test_both_tools_in_one_document() -> None:
    """Two seconds of gait, --json: ours finds the noise, the ratio is that of the processor times."""
    found = document("bench", "identify", "--seeds", "1", "--seconds", "2")
    _complete(found, {"ours", "mujoco.sysid", "mujoco.sysid jac"}, 1)
    ours, theirs = found["tools"]["ours"], found["tools"]["mujoco.sysid"]
    assert ours["cases"][0]["rms_mm"] == pytest.approx(found["noise_mm"], rel=0.05)
    assert theirs["cpu_ratio"] == pytest.approx(theirs["cases"][0]["cpu_s"] / ours["cases"][0]["cpu_s"])
    assert theirs["cases"][0]["rollouts"] > 10


@pytest.mark.slow
def test_planted_numbers_are_found() -> None:
    """Six cases of 4 s: five are solved at least, and three quarters of all intervals hold what was planted."""
    found = document("bench", "identify", "--cases", "6", "--seconds", "4")
    _complete(found, {"ours"}, 6)
    assert found["tools"]["ours"]["solved"]["count"] >= 5
    assert found["tools"]["ours"]["covered"]["count"] >= 23
