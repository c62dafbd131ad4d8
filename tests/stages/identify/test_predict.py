"""Windows through the engine: the run that was simulated comes out again, and derivatives are differences."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import State
from r2s2r_cli.errors import NumericalError
from r2s2r_cli.stages.identify.offsets import StartSpread, count
from r2s2r_cli.stages.identify.predict import STRIDE, Predictor
from r2s2r_cli.stages.identify.windows import Window, window
from tests.stages.identify.replayed import PERIOD, STEP, predictor_of, start, values_at, walk
from tests.support.engine import simulate

NAMES = ("motor_speed", "friction", "stiffness_passive", "rest_length.6", "command_delay", "camera_delay",
         "ground_height")  # fmt: skip
DELAY = 0.0123
"""No edge of the engine's grid comes to a switch of the commands, where the derivative by the delay has a kink."""
WIDTHS = (1e-5, 1e-6)
"""Of central differences, relative: contacts that begin or slip leave kinks, one of both is narrow enough."""


@lru_cache
def plain() -> Predictor:
    """Free numbers of every kind but effects."""
    return predictor_of(*NAMES)


def windows(*numbers: tuple[int, ...]) -> list[Window]:
    """Windows of the noiseless walk, all from rest."""
    return [window(walk(), one, start()) for one in numbers or ((1, 2),)]


def error_of(found: np.ndarray, quotients: list[np.ndarray]) -> float:
    """Largest difference to the nearest of the quotients, as a share of the largest derivative."""
    assert np.abs(found).max() > 0
    return min(float(np.abs(found - one).max() / np.abs(found).max()) for one in quotients)


def by_value(predictor: Predictor, x: np.ndarray, k: int) -> list[np.ndarray]:
    """Difference quotients of the end caps by the k-th value."""
    found = []
    for width in WIDTHS:
        step = width * max(abs(x[k]), 0.01) * np.eye(len(x))[k]
        up, down = (predictor.predict(windows(), x + sign * step).p_WE for sign in (1, -1))
        found.append((up - down) / (2 * step[k]))
    return found


def test_the_run_that_was_simulated_comes_out() -> None:
    """At the values it was simulated with, a window that starts where the run did predicts its frames, and counts."""
    predictor = predictor_of("motor_speed")
    run, before = walk(values=(("motor_speed", 0.7),)), predictor.rollouts
    seen = predictor.predict([window(run, (1, 2, 3), start())], np.array([0.7]))
    np.testing.assert_allclose(seen.p_WE, run.observed[1:], atol=1e-9)
    assert np.linalg.norm(run.observed[-1] - run.observed[0], axis=-1).max() > 0.02
    other = predictor.predict([window(run, (1, 2, 3), start())], np.array([0.8])).p_WE
    assert np.abs(other - seen.p_WE).max() > 1e-3
    assert predictor.rollouts == before + 2
    assert seen.by_value is None
    assert seen.by_offset is None


def test_frames_between_stored_states_are_interpolated() -> None:
    """Frames 1 to 4 ms after a stored state lie within 0.03 mm of the simulation at their own times."""
    run = walk()
    late = replace(run, t=run.t + STEP * (np.arange(len(run.t)) % STRIDE) * (np.arange(len(run.t)) > 0))
    seen = predictor_of().predict([window(late, (1, 2), start())], np.zeros(0)).p_WE
    rows = torch.as_tensor(np.repeat(run.control[:-1], round(PERIOD / STEP), axis=0))[None]
    predictor = predictor_of()
    theta = predictor.mapping.theta(np.zeros(0))
    fine = predictor.simulator.rollout(theta, start(), rows, step=STEP).end_caps()[0].numpy()
    at = np.round(late.t / STEP).astype(int)[1 : len(seen) + 1]
    assert len(set(at % STRIDE)) == STRIDE
    np.testing.assert_allclose(seen, fine[at], atol=3e-5)


def test_windows_side_by_side_are_what_they_are_alone() -> None:
    """Windows of different starts and lengths in one batch; `window` says which frame is whose."""
    x, some = values_at(plain(), command_delay=DELAY), windows((1, 2), (2,), (3,))
    seen = plain().predict(some, x)
    assert np.bincount(seen.window).tolist() == [len(one.frames) for one in some]
    for k, one in enumerate(some):
        np.testing.assert_allclose(seen.p_WE[seen.window == k], plain().predict([one], x).p_WE, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_by_values_are_differences(name: str) -> None:
    """1.2 s on the ground, per unit of each number, to 1e-5 of the largest."""
    x = values_at(plain(), command_delay=DELAY)
    found, k = jacobian(plain()), NAMES.index(name)
    assert error_of(found[..., k], by_value(plain(), x, k)) < 1e-5


@lru_cache
def jacobian(predictor: Predictor) -> np.ndarray:
    """Derivatives by all values, (F, cap, 3, n), of a window from rest."""
    found = predictor.predict(windows(), values_at(predictor, command_delay=DELAY), jacobian=True)
    assert found.by_offset is None
    assert found.by_value is not None
    return found.by_value


@pytest.mark.slow
def test_derivatives_by_an_effect_are_differences() -> None:
    """The same of a number that puts an effect into the step."""
    predictor = predictor_of("motor_speed", "ground_slope.angle_x_rad")
    x = values_at(predictor)
    found = predictor.predict(windows(), x, jacobian=True).by_value
    assert found is not None
    assert error_of(found[..., 1], by_value(predictor, x, 1)) < 1e-4


def lifted() -> State:
    """The robot at rest, 0.3 m over the ground: for 0.2 s no contact has a kink."""
    return replace(start(), p_WB=start().p_WB + torch.tensor([0.0, 0.0, 0.3], dtype=torch.float64))


@pytest.mark.slow
def test_derivatives_by_offsets_are_differences() -> None:
    """Falling for 0.2 s with winches at work, by place, turn, velocity, rate and rest length; two windows, whose own
    offsets are what each depends on."""
    one = window(walk(seconds=0.2), (1,), lifted())
    x, n = values_at(plain()), count(plain().structure)
    sd = StartSpread().sd(plain().structure)
    offsets = 0.3 * sd * np.random.default_rng(5).normal(size=(2, n))
    found = plain().predict([one, one], x, offsets, jacobian=True)
    assert found.by_offset is not None
    assert found.by_offset.shape == (2 * len(one.frames), 6, 3, n)
    assert np.abs(found.p_WE[: len(one.frames)] - plain().predict([one], x).p_WE).max() > 1e-3
    errors = []
    for width in (1e-6, 1e-7):
        steps = width * np.eye(n)
        moved = np.concatenate([own + sign * steps for own in offsets for sign in (1, -1)])
        up_down = plain().predict([one] * len(moved), x, moved).p_WE.reshape(2, 2, n, len(one.frames), 6, 3)
        quotients = np.moveaxis((up_down[:, 0] - up_down[:, 1]) / (2 * width), 1, -1)
        errors.append(np.abs(found.by_offset - quotients.reshape(found.by_offset.shape)).max(axis=(0, 1, 2)))
    assert (np.minimum(*errors) < 1e-4 * np.maximum(np.abs(found.by_offset).max(axis=(0, 1, 2)), 1e-3)).all()


@pytest.mark.slow
def test_without_offsets_states_stay_and_zero_offsets_are_none() -> None:
    """Offsets of 0 predict the same, and do not change the derivatives by the values."""
    x = values_at(plain(), command_delay=DELAY)
    zero = plain().predict(windows(), x, np.zeros((1, count(plain().structure))), jacobian=True)
    np.testing.assert_allclose(zero.p_WE, plain().predict(windows(), x).p_WE, atol=1e-12)
    assert zero.by_value is not None
    np.testing.assert_allclose(zero.by_value, jacobian(plain()), atol=1e-9)


def test_the_height_of_the_ground_is_added() -> None:
    """Observed caps lie so much over the simulated ones: 1 per unit in z, 0 in x and y, nothing else."""
    low, high = (plain().predict(windows(), values_at(plain(), ground_height=h)).p_WE for h in (0.0, 0.02))
    np.testing.assert_allclose(high - low, np.broadcast_to([0.0, 0.0, 0.02], low.shape), atol=1e-15)
    found = jacobian(plain())[..., NAMES.index("ground_height")]
    np.testing.assert_array_equal(found, np.broadcast_to([0.0, 0.0, 1.0], found.shape))


def test_camera_and_command_delay_act_alike() -> None:
    """Only their sum counts, and both have its derivative."""
    sums = [
        plain().predict(windows(), values_at(plain(), command_delay=a, camera_delay=b)).p_WE
        for a, b in ((0.05, 0.0), (0.02, 0.03), (0.15, -0.1))
    ]
    np.testing.assert_allclose(sums[0], sums[1], atol=1e-9)
    np.testing.assert_allclose(sums[0], sums[2], atol=1e-9)
    command, camera = (jacobian(plain())[..., NAMES.index(name)] for name in ("command_delay", "camera_delay"))
    np.testing.assert_array_equal(command, camera)


def test_a_late_command_is_a_late_motion() -> None:
    """With commands delayed by the whole window nothing is wound: the robot stays at rest."""
    late = plain().predict(windows((1,)), values_at(plain(), command_delay=0.5)).p_WE
    fast = plain().predict(windows((1,)), values_at(plain(), command_delay=0.0)).p_WE
    moved = walk().t[1 : len(late) + 1] > 0.5
    still = simulate(plain().structure, plain().mapping.theta(values_at(plain())), start(), 500, STEP, every=50)
    np.testing.assert_allclose(late[~moved], still.end_caps()[0, 1:].numpy()[: (~moved).sum()], atol=1e-9)
    assert np.abs(fast - late).max() > 1e-3


def test_what_cannot_be_simulated_is_a_step_to_be_refused() -> None:
    """A start that flies off to infinity, and a robot with a negative mass: NumericalError, that says which and what to
    do."""
    wild = replace(start(), v_WB=torch.full_like(start().v_WB, 1e300))
    with pytest.raises(NumericalError, match="finite") as caught:
        plain().predict([window(walk(), (1,), wild)], values_at(plain()))
    assert "walk" in str(caught.value.where)
    heavy = predictor_of("mass")
    with pytest.raises(NumericalError, match="a robot that cannot be") as caught:
        heavy.predict(windows(), np.array([-1.0]))
    assert "--free" in str(caught.value.hint)
