"""Fits of probes from products of columns: planted numbers come out, freedom alone gains nothing, beginnings are found.

Columns are random numbers here: no engine has a part in them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.where.channels import _free, _normal, _part, _squares, fitted, gains, held_out, sizes
from r2s2r_cli.stages.diagnose.where.columns import Column, Design
from r2s2r_cli.stages.diagnose.where.found import SegmentGap
from r2s2r_cli.stages.diagnose.where.onset import onset
from r2s2r_cli.stages.diagnose.which.mixture import FACTORS

STRETCHES, ROWS = 18, 120
COLUMNS = (
    *(Column("rate", "motor", Element("motor", k), "1", 0.1) for k in range(3)),
    *(Column("force", "cable", Element("cable", k), "N", 0.5) for k in range(4)),
)
MOTOR, CABLE = np.arange(3), np.arange(3, 7)
GAIT = np.repeat(np.arange(3), STRETCHES // 3)


def _design(seed: int, truth: np.ndarray, *, nuisance: float = 0.0) -> Design:
    """Innovations of white noise and of probes `truth` (stretch, 7) in their units, one nuisance that is off."""
    rng = np.random.default_rng(seed)
    grams, kinds = [], np.array(FACTORS)
    for one in truth:
        columns = rng.standard_normal((8, ROWS)) / np.sqrt(ROWS) * np.array([6.0, *[4.0] * 7])[:, None]
        scale = np.array([column.scale for column in COLUMNS])
        r = rng.standard_normal(ROWS) + nuisance * columns[0] + (one / scale) @ columns[1:]
        joined = np.concatenate([columns, r[None]])
        grams.append(joined @ joined.T / kinds[:, None, None] ** 2)
    size = np.full(STRETCHES, float(ROWS))
    logdet = np.tile(2.0 * ROWS * np.log(kinds), (STRETCHES, 1))
    return Design(np.array(grams), logdet, COLUMNS, size, GAIT, np.eye(1), (), ())


def test_a_constant_rate_error_comes_out() -> None:
    """Motor 1 turns 30 per cent too fast in all intervals, while a nuisance is off by one sd: found to a tenth, in its
    channel, by its element, in gaits that were left out."""
    truth = np.zeros((STRETCHES, 7))
    truth[:, 1] = 0.3
    made = _design(0, truth, nuisance=1.0)
    spread = fitted(made, MOTOR, np.arange(STRETCHES))
    found, sd = sizes(made, MOTOR, spread)
    assert np.abs(found[:, 1].mean() - 0.3) < 0.03
    assert np.abs(np.delete(found, 1, axis=1).mean(axis=0)).max() < 0.03
    assert (sd > 0).all()
    plain = held_out(made, np.zeros(0, int), GAIT)
    motor, cable = (gains(made, places, GAIT, plain).sum() for places in (MOTOR, CABLE))
    assert motor > 50
    assert motor > 3 * cable
    alone = [gains(made, np.array([k]), GAIT, plain).sum() for k in MOTOR]
    assert int(np.argmax(alone)) == 1


def test_an_error_that_changes_its_sign_is_found_too() -> None:
    """A force of cable 2 that is drawn anew in every interval, sd 1 N: no mean, and a gain in gaits that were left out;
    intervals are told apart."""
    truth = np.zeros((STRETCHES, 7))
    truth[:, 5] = np.random.default_rng(4).standard_normal(STRETCHES)
    made = _design(1, truth)
    spread = fitted(made, CABLE, np.arange(STRETCHES))
    found, _ = sizes(made, CABLE, spread)
    assert np.corrcoef(found[:, 2], truth[:, 5])[0, 1] > 0.95
    assert int(np.argmax(spread.variance)) == 2
    plain = held_out(made, np.zeros(0, int), GAIT)
    assert gains(made, CABLE, GAIT, plain).sum() > 30


def test_free_probes_are_part_of_the_covariance() -> None:
    """Squares, log determinants and weighed products as of the covariance 1 + C' variance C itself, row by row."""
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((STRETCHES, len(FACTORS), 9, ROWS))
    variance = np.array([0.3, 1e-4, 2.0])
    C = columns[:, :, 1:4]
    covariance = np.eye(ROWS) + np.einsum("scki,k,sckj->scij", C, variance, C)
    kept = np.concatenate([columns[:, :, :4], columns[:, :, 8:]], axis=2)
    precise = kept @ np.linalg.solve(covariance, kept.swapaxes(-1, -2))
    design = replace(_design(0, np.zeros((STRETCHES, 7))), gram=columns @ columns.swapaxes(-1, -2))
    T = _part(design, MOTOR)
    free, b = _free(T, design.q, variance), rng.standard_normal(5)
    w = rng.uniform(size=T.shape[:2])
    w[3] = 0.0
    np.testing.assert_allclose(_squares(T, free, b), (precise @ b) @ b, rtol=1e-10)
    np.testing.assert_allclose(free.logdet, np.linalg.slogdet(covariance)[1], rtol=1e-10)
    np.testing.assert_allclose(_normal(T, free, w), np.tensordot(w, precise, 2), rtol=1e-9, atol=1e-9)


def test_freedom_alone_gains_nothing() -> None:
    """Of pure noise, in 20 sets, probes gain less than 5 nats, and on average they lose."""
    gained = []
    for seed in range(20):
        made = _design(100 + seed, np.zeros((STRETCHES, 7)))
        plain = held_out(made, np.zeros(0, int), GAIT)
        gained += [gains(made, places, GAIT, plain).sum() for places in (MOTOR, CABLE)]
    assert max(gained) < 5
    assert np.mean(gained) < 0


def test_one_interval_does_not_decide() -> None:
    """An interval that a probe explains by 1000 nats, a robot that tipped over, counts 15 at most."""
    truth = np.zeros((STRETCHES, 7))
    truth[4, 0] = 20.0
    made = _design(2, truth)
    plain = held_out(made, np.zeros(0, int), GAIT)
    assert gains(made, MOTOR, GAIT, plain).max() <= 15.0


def test_a_fall_is_no_evidence_for_a_channel() -> None:
    """Two intervals that err 50 times as much as the floor says, in directions of no probe's own: no channel gains 10
    nats by them."""
    made = _design(3, np.zeros((STRETCHES, 7)))
    gram = made.gram.copy()
    gram[[4, 13], :, -1, :] *= 50.0
    gram[[4, 13], :, :, -1] *= 50.0
    fallen = Design(gram, made.logdet, COLUMNS, made.size, GAIT, made.known, (), ())
    plain = held_out(fallen, np.zeros(0, int), GAIT)
    assert max(gains(fallen, places, GAIT, plain).sum() for places in (MOTOR, CABLE)) < 10


def _segments() -> tuple[SegmentGap, ...]:
    return tuple(
        SegmentGap("g", "g", k + 1, k, (k, k + 1.0), 1.0, 100.0, 0.5, False, 0.01, (0.0, 0.0)) for k in range(STRETCHES)
    )


def test_pieces_of_an_interval_begin_together() -> None:
    """Each interval in two pieces, the second of which says all: the beginning is that of the interval."""
    whole = _segments()
    pieces = tuple(one for one in whole for _ in range(2))
    rng = np.random.default_rng(2)
    gain = np.zeros(2 * STRETCHES)
    gain[1::2] = rng.normal(-0.5, 0.5, STRETCHES)
    gain[2 * 11 + 1 :: 2] += 6.0
    found = onset(pieces, gain, 0)
    assert found is not None
    assert (found.order, found.interval) == (11, 12)


def test_a_beginning_is_found_and_none_is_invented() -> None:
    """Gains from the 12th interval on: exactly that one. Gains everywhere, nowhere, and in 100 random orders: at most
    6 per cent are said to begin."""
    rng = np.random.default_rng(0)
    gain = rng.normal(-0.5, 0.5, STRETCHES)
    gain[11:] += 6.0
    found = onset(_segments(), gain, 0)
    assert found is not None
    assert found.order == 11
    assert found.interval == 12
    assert onset(_segments(), np.full(STRETCHES, 6.0), 0) is None
    assert onset(_segments(), np.full(STRETCHES, -0.5), 0) is None
    orders = np.random.default_rng(5)
    drawn = [onset(_segments(), orders.permutation(gain), k) is not None for k in range(100)]
    assert np.mean(drawn) <= 0.06
