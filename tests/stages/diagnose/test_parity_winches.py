"""Winches in one dimension: planted laws are recovered, and told from each other. The laws are integrated here anew."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity.quantities import Quantities, quantities
from tests.support.engine import threebar
from tests.support.parity_log import SPEED, wound


def _plain(u: np.ndarray, h: float) -> np.ndarray:
    return np.asarray(np.cumsum(SPEED * h * u, axis=0))


def _late(u: np.ndarray, h: float) -> np.ndarray:
    rows = round(0.12 / h)
    return _plain(np.concatenate([np.zeros((rows, 6)), u[:-rows]]), h)


def _lagged(u: np.ndarray, h: float) -> np.ndarray:
    speed, found = np.zeros(6), np.empty_like(u)
    for k, now in enumerate(u):
        speed = speed + (now - speed) * h / (0.15 + h)
        found[k] = speed
    return _plain(found, h)


def _with_play(u: np.ndarray, h: float) -> np.ndarray:
    asked, out = _plain(u, h), np.empty_like(u)
    now = asked[0] - 0.006
    for k, row in enumerate(asked):
        now = np.where(row - now > 0.006, row - 0.006, np.where(row < now, row, now))
        out[k] = now
    return np.asarray(out - out[0])


def _measured(law: object, **how: object) -> Quantities:
    runs = [wound(f"g{k}", k, law, **how) for k in range(2)]  # type: ignore[arg-type]
    return quantities(runs, threebar(), SPEED, lag=0.0)


@pytest.mark.parametrize(
    ("law", "name", "size", "near"),
    [(_late, "latency", 0.12, 0.01), (_lagged, "lag", 0.15, 0.015), (_with_play, "play", 0.006, 6e-4)],
)
def test_a_law_is_recovered_and_explains_most(law: object, name: str, size: float, near: float) -> None:
    """0.12 s of latency, 0.15 s of lag, 6 mm of play: their sizes come out, and no other law explains as much."""
    found = _measured(law)
    one = found.of[name, "motor", None]
    assert abs(one.value - size) < near
    assert max(found.gain, key=lambda key: found.gain[key]) == name


def test_plain_winches_have_no_law() -> None:
    """Without any law, latency, lag and play are at most 10 ms, 10 ms, 0.6 mm, and all rates the nominal to 1 %."""
    found = _measured(_plain)
    assert abs(found.of["latency", "motor", None].value) < 0.01
    assert found.of["lag", "motor", None].value < 0.01
    assert found.of["play", "motor", None].value < 6e-4
    assert abs(found.of["winch_speed", "motor", None].value) < 0.01


def test_one_slow_motor_is_named() -> None:
    """Motor 4 turns at 0.75 of the speed: its rate against the others is that, theirs is 1."""
    factors = np.ones(6)
    factors[4] = 0.75
    found = _measured(_plain, factors=factors)
    rates = np.array([found.of["winch_rate", "motor", k].value for k in range(6)])
    assert abs(rates[4] - np.log(0.75)) < 0.02
    assert np.abs(np.delete(rates, 4)).max() < 0.02
