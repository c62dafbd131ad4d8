"""Detectability: what any difference at all would make is nobody's effect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.blind.make import one, oracle
from r2s2r_cli.blind.make.looks import Looks
from r2s2r_cli.blind.make.oracle import MOST, Detectable, _Told
from r2s2r_cli.blind.make.worlds import Hidden, hidden
from r2s2r_cli.blind.split import Bank, Kind

INTERVALS, LOOKS, CAPS, CABLES = 4, 12, 6, 9
Run = list[list[Looks]]


def world() -> Hidden:
    """Whose noise the differences are white under."""
    return hidden(Bank.CALIBRATION, 150_321, Kind.NONE, gaits=1)


def looks(by: dict[int, float] | None = None, *, moved: int | None = None) -> Run:
    """One gait of intervals at rest. by: how far all cables of an interval have changed at its end [m]; moved: seed of
    what moves the caps a little instead."""
    t = np.linspace(0.0, 1.1, LOOKS)
    p = np.random.default_rng(3).normal(0.0, 0.1, (CAPS, 3))
    drawn = np.zeros((INTERVALS, LOOKS, CAPS, 3))
    if moved is not None:
        drawn = np.random.default_rng(moved).normal(0.0, 1e-5, drawn.shape)
    return [[
        Looks(t, p + drawn[k], np.outer(t / t[-1], np.full(CABLES, (by or {}).get(k, 0.0))))
        for k in range(INTERVALS)
    ]]  # fmt: skip


def told(minute: list[Run], pushed: list[Run] | None = None) -> _Told:
    """With friction and speed that move caps alone, and pushes, unless they are given, that do next to nothing."""
    still = looks()
    pushes = pushed or [looks(moved=k) for k in range(6)]
    return _Told(world(), still, (looks(moved=11), looks(moved=12)), pushes, (still, still), minute)


def test_what_a_push_of_micrometres_makes_is_no_effects() -> None:
    """An interval that turns over whatever is done to it tells nothing; the same difference in another one does."""
    there, elsewhere = looks({0: 0.01, 1: 0.01}), looks({2: 0.01, 3: 0.01})
    plain, used = told([looks()] * 4), told([there] * 4)
    assert plain(there)[0] == pytest.approx(plain(elsewhere)[0], rel=1e-3) and plain(there)[0] > oracle.WEAK
    assert used(there)[0] == pytest.approx(0.0, abs=1e-6)
    assert used(elsewhere)[0] == pytest.approx(plain(elsewhere)[0], rel=1e-3)


def test_it_is_taken_off_on_the_average() -> None:
    """Where one push of four does it, a quarter of the square is what nothing makes."""
    there = looks({0: 0.01, 1: 0.01})
    d = told([looks()] * 4)(there)[0]
    assert told([looks()] * 3 + [there])(there)[0] == pytest.approx(d * np.sqrt(0.75), rel=1e-3)


def test_no_interval_counts_for_more_than_the_next() -> None:
    """One that differs alone is nothing, two are worth MOST each at most."""
    plain = told([looks()] * 4)
    assert plain(looks({0: 1.0}))[0] == pytest.approx(0.0, abs=1e-6)
    assert plain(looks({0: 1.0, 1: 1.0}))[0] == pytest.approx(np.sqrt(2.0) * MOST, rel=1e-6)


def test_a_fall_that_pushes_bring_about_is_part_of_the_floor_of_cables_too() -> None:
    """Where pushes change lengths by centimetres, a change by one tells little."""
    still, there = looks(), looks({0: 0.01, 1: 0.01})
    shaken = [looks(dict.fromkeys(range(2), sign * 0.05)) for sign in (1.0, -1.0)] * 3
    assert told([still], shaken)(there)[0] < 0.5 * told([still])(there)[0]


@pytest.mark.parametrize(("gaits", "told"), [(1, [0]), (3, [0, 1]), (5, [0, 1, 2]), (8, [0, 1, 2, 3, 4])])
def test_judged_gaits_do_not_make_a_set_clear(
    gaits: int, told: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever the last third of the gaits shows, d is of those that a diagnosis is given to fit."""
    asked: list[list[int]] = []

    def detectable(robot: object, hidden: Hidden, runs: list[int]) -> Detectable:
        asked.append(runs)
        return Detectable(9.0, (9.0,), 1.0)

    monkeypatch.setattr(one, "drive", lambda robot, world, gait, number, **how: number)
    monkeypatch.setattr(one, "write_seen", lambda *_: None)
    monkeypatch.setattr(one, "detectability", detectable)
    world = hidden(Bank.CALIBRATION, 150_321, Kind.SINGLE, effects=("sensor_bias",), gaits=gaits)
    label = one.make_set(world, tmp_path / "set")
    assert asked == [told] and label["d"] == 9.0 and label["gaits"] == gaits
