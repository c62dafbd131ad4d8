"""Which gaits are kept of a behaviour, and what they are called."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.stages.plan import choose
from r2s2r_cli.stages.plan.choose import ChoiceSettings, chosen, short_names
from r2s2r_cli.stages.plan.gaits import Gait
from r2s2r_cli.stages.plan.rewards import BEHAVIOURS, Outcomes

PAIRS = 8


def came(forward: np.ndarray) -> Outcomes:
    """Gaits that go straight ahead, one an entry."""
    n = len(forward)
    com = np.column_stack([np.zeros(n), forward, np.zeros(n)])
    return Outcomes(com, np.zeros(n), np.zeros(n, dtype=int), np.zeros(n), np.ones(n), np.ones(n))


class Judge:
    """Simulators in which gait k comes as far as `forward[k]` says, one entry a pair."""

    executor = reference = None
    rest_error_m = 0.02

    def __init__(self, gaits: list[Gait], forward: np.ndarray) -> None:
        self.pairs = range(PAIRS)
        self.told = {gait.key: row for gait, row in zip(gaits, forward, strict=True)}

    def also_from(self, more: Any) -> None:
        """No more robots."""

    def __call__(self, gaits: list[Gait], count: int) -> list[tuple[Outcomes, np.ndarray]]:
        """The first `count` simulators."""
        return [(came(self.told[gait.key][:count]), np.ones(count, dtype=bool)) for gait in gaits]


@pytest.fixture
def gaits(monkeypatch: pytest.MonkeyPatch) -> list[Gait]:
    """Fourteen gaits of one shape each."""
    monkeypatch.setattr(choose, "arrived", lambda *_: SimpleNamespace())
    return [Gait(np.array([[k >> bit & 1 for bit in range(6)]], dtype=float)) for k in range(14)]


def test_a_gait_that_works_in_one_simulator_loses(gaits: list[Gait]) -> None:
    """It comes farthest with the best numbers, and is behind all that come half as far in all; ten are kept."""
    forward = np.tile(np.linspace(0.10, 0.11, len(gaits))[:, None], (1, PAIRS))
    forward[0] = [0.3, *[0.0] * (PAIRS - 1)]
    judge: Any = Judge(gaits, forward)
    kept = chosen(judge, {"forward": gaits}, {"forward": BEHAVIOURS["forward"]}, ChoiceSettings(first_pairs=PAIRS))
    names = [one.name for one in kept["forward"]]
    assert names == [f"forward-{k}" for k in range(1, 11)]
    assert [one.gait.key for one in kept["forward"]] == [gait.key for gait in reversed(gaits[4:])]
    assert all(one.mean == one.score for one in kept["forward"]), "they do not differ between simulators"
    every = chosen(
        judge, {"forward": gaits}, {"forward": BEHAVIOURS["forward"]}, ChoiceSettings(first_pairs=PAIRS, kept=14)
    )
    lucky = every["forward"][-1]
    assert lucky.gait.key == gaits[0].key and lucky.nominal == 0.3 and lucky.score < 0


def test_names_of_gaits_are_their_own() -> None:
    """The last word of a dotted name; the module before it where another behaviour is called so."""
    assert short_names(["forward", "mine:along"]) == {"forward": "forward", "mine:along": "along"}
    assert short_names(["forward", "mine:forward", "a.b:c", "a.d:c"]) == {
        "forward": "forward", "mine:forward": "mine-forward", "a.b:c": "b-c", "a.d:c": "d-c",
    }  # fmt: skip
