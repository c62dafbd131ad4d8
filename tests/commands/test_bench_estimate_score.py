"""The scorer of `bench estimate`: planted errors are found, choices of axes are none."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.commands.bench_estimate_score import Errors, errors_of, summed_up
from tests.stages.estimate.builders import threebar

N = 40
ROBOT = threebar()


def turn(angle: float, shift: tuple[float, float, float]) -> np.ndarray:
    """A world turned about z and moved, (4, 4)."""
    X = np.eye(4)
    c, s = np.cos(angle), np.sin(angle)
    X[:2, :2], X[:3, 3] = [[c, -s], [s, c]], shift
    return X


def truth(seed: int = 0) -> SimpleNamespace:
    """A robot that moves; camera 1.44 m above, looking down."""
    rng = np.random.default_rng(seed)
    p_WE = np.array(ROBOT.rest_caps_m) + 0.01 * np.cumsum(rng.standard_normal((N, 1, 3)), axis=0)
    X_WC = np.eye(4)
    X_WC[:3, :3], X_WC[:3, 3] = np.diag([1.0, -1.0, -1.0]), (0.1, -0.2, 1.44)
    force = np.where(np.arange(6) < 3, 2.0, 0.0) * np.ones((N, 1))
    return SimpleNamespace(t=np.arange(N) / 30, p_WE=p_WE, X_WC=X_WC, force=force, weight=10.0, delay_s=0.03,
                           length=np.ones((N, 9)), blind=np.zeros(N, dtype=bool))  # fmt: skip


def scored(
    true: SimpleNamespace, p_WE: np.ndarray, cov: np.ndarray, world: np.ndarray | None = None,
    delay: float | None = None,
) -> Errors:  # fmt: skip
    """An estimate p_WE of `true` in the rig's world, written down in another world. delay: that of the sensors, NaN:
    not known; None: there are none."""
    world = np.eye(4) if world is None else world
    R, p = world[:3, :3], world[:3, 3]
    frames = Group({
        "t": true.t, "source_frame": np.arange(N), "p_WE": p_WE @ R.T + p, "cov_p_WE": R @ cov @ R.T,
        "contact": true.force > 0.5,
    })  # fmt: skip
    groups = {"frames": frames, "camera": Group({"X_WC": world @ true.X_WC})}
    if delay is not None:
        groups["sensor_fit"] = Group({}, {"delay": delay, "delay_known": bool(np.isfinite(delay))})
    case = SimpleNamespace(truth=true, robot=ROBOT, streams={} if delay is None else {"sensors": None})
    return errors_of(case, groups, wall_s=1.0, cpu_s=1.0, memory_mb=0.0)


def cov_of(sd: float) -> np.ndarray:
    """The same in all directions."""
    return np.broadcast_to(sd**2 * np.eye(3), (N, 6, 3, 3))


def test_another_choice_of_axes_and_origin_is_no_error() -> None:
    """Where x points and the origin lies is the estimate's choice; the camera links both worlds."""
    true = truth()
    score = summed_up([scored(true, true.p_WE, cov_of(1e-3), turn(1.1, (0.4, -0.3, 0.0)))])
    assert score.cap_max_mm < 1e-9
    assert score.axis_mean_deg < 1e-6
    assert (score.within, score.lost, score.contact_f1) == (1.0, 0.0, 1.0)


def test_a_wrong_floor_is_an_error() -> None:
    """Floor 5 mm too near and 0.5 degrees off: heights where the robot stands are wrong, x, y, heading not."""
    true, angle = truth(), np.radians(0.5)
    wrong = np.eye(4)
    wrong[:3, :3] = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    high = wrong[:3, :3] @ true.X_WC[:3, 3]
    wrong[2, 3] = true.X_WC[2, 3] - 0.005 - high[2]  # the camera is 5 mm nearer to the floor
    for turned in (0.0, 2.0):
        errors = scored(true, true.p_WE, cov_of(1e-3), turn(turned, (0.3, 0.1, 0.0)) @ wrong)
        score = summed_up([errors])
        assert (score.floor_mm, score.floor_deg) == pytest.approx((5.0, 0.5))
        caps = true.p_WE - true.X_WC[:3, 3]
        height = (caps @ wrong[:3, :3].T)[..., 2] + true.X_WC[2, 3] - 0.005 - true.p_WE[..., 2]
        assert score.cap_mean_mm == pytest.approx(1e3 * np.mean(np.abs(height)), rel=0.15)
        assert score.covered < 0.5


def test_runs_that_failed_and_unknown_delays_are_counted() -> None:
    """One run in four fails: a quarter of all frames is lost. A delay that is not known is no good delay."""
    true = truth()
    runs = [scored(true, true.p_WE, cov_of(1e-3), delay=delay) for delay in (0.031, float("nan"), 0.025)]
    score = summed_up(runs, [N])
    assert (score.runs, score.failed, score.delay_unknown) == (4, 1, 1)
    assert (score.within, score.covered, score.lost) == pytest.approx((0.75, 0.75, 0.25))
    assert score.delay_error_ms == pytest.approx(5.0)


def test_a_planted_shift_is_found_in_every_figure() -> None:
    """All caps 3 mm up: caps, rods and centre of mass 3 mm off, no axis; 5 cm: lost."""
    true = truth()
    score = summed_up([scored(true, true.p_WE + np.array([0.0, 0.0, 0.003]), cov_of(1e-3))])
    assert (score.cap_mean_mm, score.rod_mean_mm, score.com_mean_mm) == pytest.approx((3.0, 3.0, 3.0))
    assert score.axis_mean_deg < 1e-6
    assert summed_up([scored(true, true.p_WE + np.array([0.0, 0.06, 0.0]), cov_of(1e-3))]).lost == 1.0


def test_a_turned_rod_has_its_angle() -> None:
    """One cap of a rod moved across by 10 mm: atan(10 / 325) for that rod, and the published share loses nothing."""
    true = truth()
    p_WE = true.p_WE.copy()
    along = p_WE[:, 1] - p_WE[:, 0]
    across = np.cross(along, (0.0, 0.0, 1.0))
    p_WE[:, 1] += 0.010 * across / np.linalg.norm(across, axis=1, keepdims=True)
    errors = scored(true, p_WE, cov_of(1e-3))
    length = np.linalg.norm(along, axis=1)
    np.testing.assert_allclose(errors.axis[:, 0], np.degrees(np.arctan(0.010 / length)), rtol=1e-9)
    np.testing.assert_allclose(errors.rod[:, 0], 0.005, rtol=1e-9)


def test_ellipsoids_are_judged_by_the_covariance_in_its_own_axes() -> None:
    """Gaussian errors with the stated covariance, narrow in one direction, lie inside 95 % of the time."""
    true, rng = truth(), np.random.default_rng(3)
    sd = np.array([0.001, 0.004, 0.0002])
    cov = np.broadcast_to(np.diag(sd**2), (N, 6, 3, 3))
    runs = [
        scored(true, true.p_WE + sd * rng.standard_normal((N, 6, 3)), cov, turn(rng.uniform(0, 6), (1.0, 2.0, 0.0)))
        for _ in range(10)
    ]
    assert summed_up(runs).covered == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / (10 * N * 6)))


def test_contacts_that_nobody_can_tell_are_left_out() -> None:
    """A flag is wrong on a cap high up and on one that carries, not on one that hovers 0.5 mm above the ground."""
    true = truth()
    radius = ROBOT.rods[0].cap_radius_m
    true.p_WE[:, :3, 2], true.p_WE[:, 3:, 2] = radius, radius + 0.05
    true.force[:] = np.where(np.arange(6) < 3, 2.0, 0.0)
    true.p_WE[:, 5, 2], true.force[:, 5] = radius + 0.0005, 0.0
    errors = scored(true, true.p_WE, cov_of(1e-3))
    assert errors.counted.all(axis=0).tolist() == [True, True, True, True, True, False]
    flags = errors.contact.copy()
    flags[:, 5] = True
    flags[:10, 0] = False
    flags[:5, 3] = True
    object.__setattr__(errors, "contact", flags)
    # Of 120 true contacts 110 are found, 5 are invented: 2 hit / (2 hit + missed + invented).
    assert summed_up([errors]).contact_f1 == pytest.approx(2 * 110 / (2 * 110 + 10 + 5))


def test_recovery_counts_from_the_end_of_blindness() -> None:
    """A cap stays 4 cm off for six frames after the last blind one."""
    true = truth()
    true.blind[10:20] = True
    p_WE = true.p_WE.copy()
    p_WE[12:26, 2, 0] += 0.04
    assert scored(true, p_WE, cov_of(1e-3)).recovery_s == pytest.approx(6 / 30)
    assert scored(true, true.p_WE, cov_of(1e-3)).recovery_s == 0.0
