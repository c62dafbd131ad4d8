"""Where a floor is widened, what comes after it is white under the floor as it is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which import which as module
from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.screen import Response, screen
from tests.support.linear_arena import EACH, STRETCHES, LinearArena, candidate, kinds_of

KNOWN = [candidate("right", 0), candidate("wrong", 1)]


class Floored(LinearArena):
    """The floor grows along a stretch: a floor f times as wide makes rows in its second half f times as unsure."""

    floor_m = 1.0
    model, names = SimpleNamespace(), ("a", "b")

    def whiten(self, *, floor_m: float) -> None:
        """As `Arena`."""
        row = np.arange(STRETCHES * EACH) % EACH
        by = np.where(row < EACH // 2, 1.0, self.floor_m / floor_m)
        self.A, self.B, self.y = by[:, None] * self.A, by[:, None] * self.B, by * self.y
        self.by_nuisance, self.floor_m = kinds_of(self.A.T).T, floor_m


def compared(monkeypatch: pytest.MonkeyPatch, wider: float, by_chance: float = 0.0) -> tuple[Floored, Fit, list]:
    """An arena whose floor is found to be too narrow by so much, its refit nominal model in the end, and the responses
    that pairs of effects are chosen by, none where none are tried."""
    arena = Floored(0.8)
    (base,) = Fits(arena).begun([(Hypothesis(), np.zeros(2), np.zeros(0))])  # type: ignore[arg-type]
    asked: list[tuple[Response, ...]] = []

    def fitted(arena: Floored, *_: object) -> tuple[Fit, list[Fit]]:
        solver = Fits(arena)  # type: ignore[arg-type]
        points = [Hypothesis(), *(Hypothesis((one,)) for one in KNOWN)]
        made = solver.begun([(one, np.zeros(2), np.zeros(len(one.parts))) for one in points])
        solver.run(made)
        return made[0], made[1:]

    def pairs_of(arena: Floored, base: Fit, fits: object, gained: object, responses: tuple, told_by: object) -> list:
        asked.append(responses)
        return []

    for name, made in (
        ("candidates", lambda *_: KNOWN), ("touched", lambda _: None), ("picked_of", lambda *_: ()), ("fitted", fitted),
        ("expected", lambda _: None), ("_widened", lambda *_: (wider, 9.0)), ("pairs_of", pairs_of),
        ("chance", lambda *_, **__: by_chance), ("left", lambda *_: None), ("no_gap", lambda *_, **__: None),
        ("concluded", lambda _: SimpleNamespace(ranking=(), effects=())), ("_in_order", lambda *_: []),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, made)
    calibration = SimpleNamespace(absolute=lambda: None)
    found = module.compare_effects(
        arena, base, floor_m=0.01, calibration=calibration, sizes={}, told=lambda *_: None,  # type: ignore[arg-type]
    )  # fmt: skip
    return arena, found.base, asked


def beside(arena: Floored, base: Fit, responses: tuple[Response, ...]) -> float:
    """Largest cosine of a direction with what the nuisances change, as white as it is now."""
    moved, _ = np.linalg.qr(Fits(arena).likely(base)[:, None] * base.jacobian[:, :2])  # type: ignore[arg-type]
    return max(float(np.abs(moved.T @ one.direction).max()) for one in responses)


def test_partners_are_chosen_by_directions_under_the_floor_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four times as wide a floor: no direction has a share that the nuisances explain, and each is that of the
    screening made anew; those of before would have one."""
    before: list[tuple[Response, ...]] = []

    def kept(arena: Floored, base: Fit, known: list) -> tuple[Response, ...]:
        before.append(screen(arena, base, known))  # type: ignore[arg-type]
        return before[-1]

    monkeypatch.setattr(module, "screen", kept)
    arena, base, (responses,) = compared(monkeypatch, 4.0)
    assert beside(arena, base, responses) < 1e-5
    assert beside(arena, base, before[0]) > 1e-2
    own = {one.candidate.effect: one for one in screen(arena, base, KNOWN)}  # type: ignore[arg-type]
    for one in responses:
        assert one.direction == pytest.approx(own[one.candidate.effect].direction)
    assert len(before) == 2


def test_nothing_is_screened_again_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the floor stays what it was."""
    count: list[int] = []
    monkeypatch.setattr(module, "screen", lambda *_: count.append(1) or ())
    compared(monkeypatch, 1.0)
    assert len(count) == 1
