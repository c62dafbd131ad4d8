"""Ticks of lock-step: what a host may ask for, and how a new one is told from the one before."""

from __future__ import annotations

from r2s2r_cli.rig.clock import TickClock


def test_ticks_go_on_one_by_one() -> None:
    """The next tick advances, the last one is answered again, any other is passed over."""
    clock = TickClock(0.02)
    assert [clock.asked(k) for k in (1, 1, 2, 2, 4, 3)] == [True, False, True, False, None, True]


def test_a_host_that_came_back_unseen_begins_again() -> None:
    """A port that was closed and opened between two looks at it brings a host that counts from 1; time goes on."""
    clock = TickClock(0.02)
    for k in (1, 2, 3):
        assert clock.asked(k)
        clock.advance()
    assert clock.asked(1) is True
    clock.advance()
    assert clock.asked(2) is True and clock.t == 4 * 0.02
