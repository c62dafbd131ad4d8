"""What each kind of evidence is worth: nothing where it says nothing, everything where it alone tells."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.blind.score import worth_published
from r2s2r_cli.blind.score.cases import Case
from r2s2r_cli.blind.score.facts import Truth
from r2s2r_cli.blind.score.worth import KINDS, worth
from r2s2r_cli.errors import InputError
from schemas.results_blind_worth import BlindWorthRow
from tests.guards.listing import ROOT

EFFECTS = ("backlash", "payload", "motor_lag", "soft_ground")
BLIND, TAUGHT = ROOT / "docs/blind/blind-b-6.json.gz", ROOT / "docs/blind/calibration-10.json.gz"


def sets(count: int, seed: int, *, replay: float, parity: float) -> list[tuple[Truth, Case]]:
    """Clear single effects, one in five with nothing wrong. replay, parity [nats]: what each says for the right name
    beyond what it says for the others, all of it noise of 1 nat where 0."""
    rng = np.random.default_rng(seed)
    names, found = (*EFFECTS, "none"), []
    for k in range(count):
        nothing = k % 5 == 0
        right = "none" if nothing else str(rng.choice(EFFECTS))
        there = np.array([name == right for name in names])
        said = np.where(np.arange(5) < 4, np.abs(rng.normal(0.0, 1.0, 5)) + replay * there, 0.0)
        told = np.where(np.arange(5) < 4, np.abs(rng.normal(0.0, 0.1, 5)) + parity * there, 0.0)
        one = Case(names, said, told, right)
        kind = "none" if nothing else "single"
        found.append((Truth(kind, () if nothing else (right,), 0.0 if nothing else 20.0, (), None, None, None, None,
                            right), one))  # fmt: skip
    return found


def rows(*, replay: float, parity: float) -> dict[str, BlindWorthRow]:
    """By what is left out; 100 sets teach and 50 others are judged."""
    cases = [one for _, one in sets(100, 1, replay=replay, parity=parity)]
    return {one.without: one for one in worth(cases, sets(50, 2, replay=replay, parity=parity))}


def test_what_alone_tells_is_worth_everything() -> None:
    """Where only the parity stage knows the truth, it finds it where no replay is asked; a replay that gains a nat or
    two for every name leaves little of that, and it is lost without the parity stage. Where only the replay knows,
    nothing else matters. Sets lost and won are the difference of first guesses."""
    by_parity, by_replay = rows(replay=0.0, parity=8.0), rows(replay=60.0, parity=0.0)
    whole = by_parity["nothing"]
    assert whole.clear == 40 and whole.none == 10
    assert by_parity["the parity stage"].top1 < 20 < whole.top1 < by_parity["the replay (parity alone)"].top1
    assert by_parity["the replay (parity alone)"].top1 >= 36
    whole = by_replay["nothing"]
    assert whole.top1 >= 36
    assert by_replay["the parity stage"].top1 == whole.top1
    assert by_replay["the replay (parity alone)"].top1 < 20
    for found in (by_parity, by_replay):
        assert list(found) == list(KINDS)
        for one in found.values():
            assert one.top1 - found["nothing"].top1 == one.won - one.lost
            assert one.top1 <= one.top3 <= one.clear and one.right <= one.named
        assert found["nothing"].lost == found["nothing"].won == 0


def test_what_misleads_is_better_left_out() -> None:
    """Parity findings speak for a wrong name in the judged sets alone: truths are likelier without them. But the replay
    refutes them, so that the truth stays among three."""
    cases = [one for _, one in sets(100, 1, replay=60.0, parity=8.0)]
    judged = [(truth, replace(one, parity=np.r_[np.roll(one.parity[:4], 1), 0.0]))
              for truth, one in sets(50, 2, replay=10.0, parity=8.0)]  # fmt: skip
    found = {one.without: one for one in worth(cases, judged)}
    assert found["nothing"].top3 == found["the parity stage"].top3 == 40
    assert found["the replay (parity alone)"].top3 < 10
    assert found["the parity stage"].log_loss < found["nothing"].log_loss


def test_each_kind_is_left_out_and_nothing_else() -> None:
    """Left-out gaits take the place of what all data say, or these of them; sets that do not say them stay as they
    are."""
    one = replace(sets(5, 3, replay=60.0, parity=8.0)[1][1], strange=2.0, left_sd=9.0)
    other = np.array([0.0, 1.0, 2.0, 3.0, 0.0])
    left_out = KINDS["all data together (left-out gaits instead)"]
    assert left_out(replace(one, left_out=other)).gain.tolist() == other.tolist()
    assert (
        KINDS["left-out gaits, and the witness (all data together instead)"](replace(one, left_out=other)).gain
        is one.said
    )
    assert left_out(one) is one
    alone = KINDS["the replay (parity alone)"](one)
    assert not alone.said.any() and alone.strange == alone.left_sd == 0.0 and alone.parity is one.parity
    assert not KINDS["the parity stage"](one).parity.any() and KINDS["the parity stage"](one).said is one.said
    assert KINDS["what a wider floor explains"](one).strange == 0.0
    assert KINDS["what is left beyond healthy runs"](one).left_sd == 0.0


def test_what_teaches_may_not_judge() -> None:
    """Nor may a blind shard teach; and without a clear single effect there is nothing to judge by."""
    with pytest.raises(InputError, match="only a calibration bank"):
        worth_published([BLIND], [BLIND])
    with pytest.raises(InputError, match="what teaches may not judge"):
        worth_published([TAUGHT], [TAUGHT])
    nothing = [(t, one) for t, one in sets(50, 2, replay=60.0, parity=0.0) if t.kind == "none"]
    with pytest.raises(InputError, match="no clear single effect"):
        worth([one for _, one in sets(100, 1, replay=60.0, parity=0.0)], nothing)


def test_published_shards_are_judged(tmp_path: Path) -> None:
    """The committed shards: the first row has every clear set of the shard, as the score has it."""
    from r2s2r_cli.blind.score import score_published

    result = worth_published([TAUGHT], [BLIND])
    clear = next(row for row in score_published([BLIND]).rows if row.name == "top1_clear")
    assert result.rows[0].clear == clear.n
    assert result.learned > 70 and result.judged < 40
