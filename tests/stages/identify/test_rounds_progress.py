"""How far a fit says it is: never less than a moment ago while starts follow each other."""

from __future__ import annotations

from r2s2r_cli.stages.identify.request import PERCENT, Step
from r2s2r_cli.stages.identify.rounds import _heard
from r2s2r_cli.stages.identify.solve.record import Progress


def test_starts_one_after_the_other_only_come_nearer_to_the_end() -> None:
    """Two starts of two stages of ten generations: the second begins where the first ended, and all ends at 1."""
    heard: list[Progress] = []
    for way in range(2):
        for stage in range(2):
            for generation in range(1, 11):
                _heard(heard.append, ("first", "all"), 10, 2, way, stage, generation, 1.0)
    shares = [one.fraction for one in heard]
    assert shares == sorted(shares)
    assert shares[19] == 0.5 and shares[-1] == 1.0


def test_a_share_is_told_in_percent() -> None:
    """Whole ones, never more than are done."""
    assert [Step.share("fit", x).done for x in (0.0, 0.299, 1.0)] == [0, 29, 100]
    assert Step.share("fit", 0.5, 3.0) == Step("fit", 50, PERCENT, 3.0)
