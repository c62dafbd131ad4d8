"""What is committed to: a probable first guess, whose effect predicts, by the threshold of what it claims."""

from __future__ import annotations

import pytest

from r2s2r_cli.stages.diagnose.parity.finding import ABSOLUTE
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.found import Ranked
from r2s2r_cli.stages.diagnose.which.verdict import verdict_of

BY = Calibration(commit=0.6, commit_none=0.8, commit_unknown=0.7)
CHANCE = 5.0


def ranking(first: str, probability: float, gain: float) -> list[Ranked]:
    """The first guess and another one."""
    return [Ranked(first, gain, probability), Ranked("backlash", 0.0, 1.0 - probability)]


@pytest.mark.parametrize(("first", "kind", "at"), [("payload", "effect", 0.6), ("none", "no_gap", 0.8),
                                                   ("unknown", "unknown", 0.7)])  # fmt: skip
def test_each_claim_has_its_threshold(first: str, kind: str, at: float) -> None:
    """From it on, and not below."""
    assert verdict_of(ranking(first, at, 30.0), BY, None, CHANCE)[0] == kind
    assert verdict_of(ranking(first, at - 0.01, 30.0), BY, None, CHANCE) == ("ambiguous", (), at - 0.01)


def test_a_cause_predicts() -> None:
    """However probable the parity stage makes it: what gains no more than chance in the replay is not the cause. What
    changes no prediction at all needs none."""
    assert verdict_of(ranking("sensor_bias", 0.99, 30.0), BY, None, CHANCE)[:2] == ("effect", ("sensor_bias",))
    assert verdict_of(ranking("sensor_bias", 0.99, CHANCE), BY, None, CHANCE)[0] == "ambiguous"
    assert verdict_of(ranking("dropout", 0.99, 0.0), BY, None, CHANCE)[:2] == ("effect", ("dropout",))


def test_a_pair_is_named_by_its_first() -> None:
    """Where the first guess belongs to the pair that was found."""
    found = verdict_of(ranking("payload", 0.9, 30.0), BY, ("payload", "backlash"), CHANCE)
    assert found[:2] == ("pair", ("payload", "backlash"))
    assert verdict_of(ranking("payload", 0.9, 30.0), BY, ("motor_lag", "backlash"), CHANCE)[0] == "effect"


def test_without_healthy_runs_the_parity_stage_counts_for_less() -> None:
    """And whoever reads the probabilities is told."""
    own = BY.absolute()
    assert own.score("payload", 7.0, parity=8.0) - 7.0 == pytest.approx(
        ABSOLUTE * (BY.score("payload", 7.0, parity=8.0) - 7.0)
    )
    assert own.score("payload", 7.0) == BY.score("payload", 7.0)
    assert "healthy runs" in own.words and own.commit == BY.commit
