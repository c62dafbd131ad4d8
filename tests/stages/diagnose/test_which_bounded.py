"""What counts of what pieces say: many of them, not one."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH, bounded, gains_over_first, over_first


def test_what_many_pieces_say_a_little_counts_in_full() -> None:
    """A nat in each of 40 pieces is 40 nats but for what is lost to smoothness."""
    table = np.stack([np.zeros(40), np.ones(40)])
    assert gains_over_first(table) == pytest.approx([40.0], rel=0.01)


@pytest.mark.parametrize("size", [20.0, 80.0, 500.0])
def test_one_fall_says_no_more_than_enough(size: float) -> None:
    """However well one hypothesis explains one piece, no other loses more than ENOUGH there."""
    table = np.zeros((4, 30))
    table[2, 7] = size
    lucky = gains_over_first(table)
    assert lucky[1] == pytest.approx(ENOUGH, abs=0.05)
    assert lucky[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_many_pieces_outvote_one() -> None:
    """A fall that was hit is worth 80 nats in full, and 20 pieces with 2 nats 40: bounded it is the other way round."""
    table = np.zeros((3, 20))
    table[1, 0], table[2] = 80.0, 2.0
    fallen, spread = gains_over_first(table)
    assert spread > 30 > 2 * ENOUGH > fallen
    whole = (table[1:] - table[0]).sum(axis=1)
    assert whole[0] > whole[1]


def test_the_order_of_a_piece_stays() -> None:
    """Bounding turns no two hypotheses round, and moves none by more than ln 2 that is within ENOUGH of the best."""
    table = np.random.default_rng(0).normal(0.0, 8.0, (6, 50))
    found = bounded(table)
    steps = np.diff(np.take_along_axis(found, np.argsort(table, axis=0), axis=0), axis=0)
    assert (steps >= 0).all()
    near = table > table.max(axis=0) - ENOUGH
    assert (np.abs(found - table)[near] <= np.log(2.0) + 1e-12).all()
    assert (found >= table.max(axis=0) - ENOUGH).all()


def test_pieces_one_by_one_add_up_to_what_is_ranked() -> None:
    """And a piece at which every hypothesis breaks off says nothing of any."""
    table = np.random.default_rng(1).normal(0.0, 8.0, (5, 40))
    assert over_first(table).sum(axis=1) == pytest.approx(gains_over_first(table))
    broken = np.concatenate([table, np.full((5, 1), -np.inf)], axis=1)
    assert over_first(broken)[:, :-1] == pytest.approx(over_first(table)) and not over_first(broken)[:, -1].any()
