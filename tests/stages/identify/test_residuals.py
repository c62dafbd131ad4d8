"""The default fit as a least-squares problem: what each residual is, and by what it is divided."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.identify.free import Mapping, select
from r2s2r_cli.stages.identify.offsets import StartSpread, count
from r2s2r_cli.stages.identify.prediction import Prediction
from r2s2r_cli.stages.identify.residuals import FIXED_SD, CapResiduals
from r2s2r_cli.stages.identify.windows import Window, window
from r2s2r_cli.stages.model import structure_of
from tests.stages.identify.replayed import predictor_of, start, walk
from tests.stages.measures.gait import run as gait
from tests.support.engine import threebar

NOISE = 2e-3
STATE: Any = object()
"""No residual looks into a start state."""


class Linear:
    """In place of the simulator: end caps that are linear in values and offsets, of each run and frame its own."""

    def __init__(self) -> None:
        self.mapping = Mapping(
            threebar(), select(["motor_speed=0.7,~0.2", "restitution", "rest_length.6,~0.01"], threebar())
        )
        self.structure = structure_of(threebar())

    def predict(
        self,
        windows: Sequence[Window],
        values: np.ndarray,
        offsets: np.ndarray | None = None,
        *,
        jacobian: bool = False,
    ) -> Prediction:
        """p = base + by_value values + by_offset offsets."""
        index = np.repeat(np.arange(len(windows)), [len(one.frames) for one in windows])
        rng = np.random.default_rng(0)
        table = rng.normal(size=(100, 6, 3, 1 + len(values) + count(self.structure)))
        rows = table[np.concatenate([one.frames for one in windows])]
        base, by_value, by_offset = rows[..., 0], rows[..., 1 : 1 + len(values)], rows[..., 1 + len(values) :]
        p_WE = base + by_value @ values
        if offsets is not None:
            p_WE = p_WE + np.einsum("fcad,fd->fca", by_offset, offsets[index])
        if not jacobian:
            return Prediction(p_WE, index)
        return Prediction(p_WE, index, by_value, None if offsets is None else by_offset)


@lru_cache
def linear() -> Any:
    """A logarithm, a share and a number as coordinates; two priors of the user."""
    return Linear()


@lru_cache
def windows(*, known: bool = False) -> tuple[Window, ...]:
    """Intervals 1 and 2, and 2 and 3, of a run whose caps are not equally noisy."""
    run = replace(
        gait(3, observed=np.random.default_rng(1).normal(size=(18, 6, 3))),
        noise=np.linspace(1e-3, 6e-3, 18).reshape(6, 3),
    )
    return window(run, (1, 2), STATE, known=known, whole=True), window(run, (2, 3), STATE, known=known, whole=True)


def problem(*, known: bool = False, noise: float = 1e-9, key_only: bool = False) -> CapResiduals:
    """Both windows; noise: the least sd."""
    return CapResiduals(linear(), windows(known=known), noise=noise, key_only=key_only)


@pytest.mark.parametrize("least", [1e-9, 3e-3])
def test_residuals_are_simulated_less_observed_over_the_noise(least: float) -> None:
    """Frame by frame, cap by cap, axis by axis; an sd below the least is the least."""
    made = problem(noise=least)
    found = made.evaluate(made.z0, jacobian=False)
    assert found.jacobian is None
    expected = []
    for one in windows():
        p_WE = linear().predict([one], np.array([0.7, 0.03, 0.165])).p_WE
        for row, frame in enumerate(one.frames):
            for cap in range(6):
                for axis in range(3):
                    off = p_WE[row, cap, axis] - one.run.observed[frame, cap, axis]
                    expected.append(off / max(one.run.noise[cap, axis], least))
    np.testing.assert_allclose(found.residual, expected, atol=1e-8)


def test_a_frame_that_is_known_less_weighs_less() -> None:
    """Where a cap was hidden its own sd divides, with key frames alone as well; elsewhere the noise of the run does."""
    sd = np.zeros((18, 6, 3))
    sd[windows()[0].frames[-1], 2] = 0.1  # the key frame of interval 2
    hidden = tuple(replace(one, run=replace(one.run, observed_sd=sd)) for one in windows())
    for key_only in (False, True):
        plain = problem(key_only=key_only)
        made = CapResiduals(linear(), hidden, noise=1e-9, key_only=key_only)
        ratio = made.evaluate(plain.z0, jacobian=False).residual / plain.evaluate(plain.z0, jacobian=False).residual
        changed = ratio.reshape(-1, 6, 3)
        frames = np.concatenate([one.frames[one.key] if key_only else one.frames for one in windows()])
        at = frames == windows()[0].frames[-1]
        np.testing.assert_allclose(changed[at][:, 2], np.tile(windows()[0].run.noise[2] / 0.1, (at.sum(), 1)))
        changed[at, 2] = 1.0
        np.testing.assert_allclose(changed, 1.0)


def test_key_frames_alone_are_those_of_all() -> None:
    """key_only leaves the rows of the key frames, in their order; blocks and clusters follow."""
    everything, keys = problem(), problem(key_only=True)
    key = np.repeat(np.concatenate([one.key for one in windows()]), 18)
    assert 0 < key.sum() < len(key)
    z = everything.z0
    np.testing.assert_allclose(
        keys.evaluate(z, jacobian=False).residual, everything.evaluate(z, jacobian=False).residual[key], atol=1e-12
    )
    np.testing.assert_array_equal(keys.cluster, everything.cluster[key])
    assert len(keys.block) == key.sum()


def test_blocks_are_caps_and_clusters_are_intervals() -> None:
    """Three residuals of one cap at one frame share a block; all of one interval a cluster, also where windows overlap,
    and intervals of another run have others."""
    made = problem()
    frames = sum(len(one.frames) for one in windows())
    assert made.block.tolist() == np.repeat(np.arange(6 * frames), 3).tolist()
    first, second = windows()
    split = 18 * len(first.frames)
    of_first, of_second = made.cluster[:split].reshape(-1, 18), made.cluster[split:].reshape(-1, 18)
    for clusters, one in ((of_first, first), (of_second, second)):
        assert (clusters == clusters[:, :1]).all()
        assert len(np.unique(clusters)) == len(one.intervals)
    assert set(of_first[first.place == 1, 0]) == set(of_second[second.place == 0, 0])
    other = window(replace(first.run, name="other"), (1, 2, 3), STATE, whole=True)
    both = CapResiduals(linear(), [first, other])
    assert len(np.unique(both.cluster)) == 5


def test_unknowns_are_coordinates_then_offsets_with_their_priors() -> None:
    """Values in their coordinates with the priors of their specs; offsets about 0 with the spread, unbounded."""
    made, n = problem(), count(linear().structure)
    assert made.names == ("motor_speed", "restitution", "rest_length.6")
    assert len(made.z0) == 3 + 2 * n
    np.testing.assert_allclose(made.z0[:3], [np.log(0.7), np.log(0.03 / 0.97), 0.165])
    assert not made.z0[3:].any()
    np.testing.assert_array_equal(made.prior_mean, made.z0)
    assert made.prior_sd[[0, 2]].tolist() == [0.2, 0.01]
    assert made.prior_sd[1] == linear().mapping.frees[1].prior_sd
    np.testing.assert_array_equal(made.prior_sd[3:], np.tile(StartSpread().sd(linear().structure), 2))
    np.testing.assert_allclose([made.lower[0], made.upper[0]], np.log([0.16, 4.0]))
    np.testing.assert_array_equal([made.lower[1], made.upper[1]], [-np.inf, np.inf])
    np.testing.assert_array_equal([made.lower[2], made.upper[2]], [0.0825, 0.2475])
    assert np.isneginf(made.lower[3:]).all()
    assert np.isposinf(made.upper[3:]).all()
    z = np.concatenate([made.z0[:3], np.arange(2.0 * n)])
    values, offsets = made.split(z)
    np.testing.assert_allclose(values, [0.7, 0.03, 0.165])
    assert offsets is not None
    assert offsets[1].tolist() == np.arange(n, 2.0 * n).tolist()


def test_an_offset_that_is_not_free_stays() -> None:
    """A spread of 0 becomes a prior that holds it."""
    made = CapResiduals(linear(), windows(), spread=StartSpread(roll=0.0))
    held = made.prior_sd[3 : 3 + count(linear().structure)] == FIXED_SD
    assert np.flatnonzero(held).tolist() == [11, 14, 17]


@pytest.mark.parametrize("key_only", [False, True])
def test_derivatives_are_differences(key_only: bool) -> None:
    """Central differences of the residuals by every unknown: logarithm, share, number, and the offsets of both windows,
    which act on their own window only."""
    made = problem(key_only=key_only)
    z = made.z0 + 0.1 * np.random.default_rng(2).normal(size=len(made.z0))
    found = made.evaluate(z)
    assert found.jacobian is not None
    assert found.jacobian.shape == (len(found.residual), len(z))
    eps = 1e-5
    for k in range(len(z)):
        up, down = (made.evaluate(z + sign * eps * np.eye(len(z))[k], jacobian=False).residual for sign in (1, -1))
        np.testing.assert_allclose(found.jacobian[:, k], (up - down) / (2 * eps), rtol=1e-6, atol=1e-3)
    n, first = count(linear().structure), windows()[0]
    split = 18 * int(first.key.sum() if key_only else len(first.frames))
    assert not found.jacobian[:split, 3 + n :].any()
    assert not found.jacobian[split:, 3 : 3 + n].any()


def test_known_starts_have_no_offsets() -> None:
    """Where all are known there are none; where one is, its own are held, the other's are free."""
    known = problem(known=True)
    assert (known.offsets, len(known.z0)) == (0, 3)
    assert known.split(known.z0)[1] is None
    mixed = CapResiduals(linear(), [windows(known=True)[0], windows()[1]])
    n = count(linear().structure)
    assert (mixed.prior_sd[3 : 3 + n] == FIXED_SD).all()
    assert (mixed.prior_sd[3 + n :] > FIXED_SD).all()
    np.testing.assert_allclose(
        mixed.evaluate(mixed.z0, jacobian=False).residual,
        CapResiduals(linear(), windows(known=True)).evaluate(mixed.z0[:3], jacobian=False).residual, atol=1e-9,
    )  # fmt: skip


def test_at_the_truth_what_is_left_is_the_noise() -> None:
    """The walk's own numbers leave residuals of sd 1, an eighth slower motors more."""
    one = window(walk(noise=NOISE, seed=3), (1, 2, 3), start(), known=True)
    made = CapResiduals(predictor_of("motor_speed"), [one], noise=NOISE)
    at_truth, beside = (made.evaluate(np.log([v]), jacobian=False).residual for v in (0.8, 0.7))
    assert np.sqrt(np.mean(at_truth**2)) == pytest.approx(1.0, abs=4 / np.sqrt(2 * len(at_truth)))
    assert np.mean(beside**2) > 1.5
