"""One more gait on ambiguous sets: `follow` knows no label, so the score says whether it was right."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.blind.score import score, score_published
from r2s2r_cli.blind.score.facts import truth_of
from r2s2r_cli.blind.score.follow import resolved
from r2s2r_cli.blind.score.published import published
from r2s2r_cli.blind.score.shard import opened
from r2s2r_cli.errors import InputError
from tests.support import blind_bank
from tests.support.blind_folder import CODE, Folder

LABELS = blind_bank.bank(60)


def told(verdict: str, *named: str, committed: bool = True) -> dict[str, Any]:
    """What a diagnosis with one more gait says, as `blind follow` writes it."""
    return {"failed": None, "verdict": verdict, "named": list(named), "first": "", "set90": [], "committed": committed}


def of(kind: str, least: float = 8.0) -> dict[str, Any]:
    """A label."""
    return next(one for one in LABELS if one["kind"] == kind and (kind == "none" or one["d"] >= least))


def test_committed_and_right_is_resolved() -> None:
    """For every kind of truth: the right words and no others, never ambiguity, failure or silence."""
    single, pair = of("single"), of("pair")
    ids, both = [one["id"] for one in single["effects"]], [one["id"] for one in pair["effects"]]
    right = {
        "none": (of("none"), told("no_gap")), "outside": (of("outside"), told("unknown")),
        "single": (single, told("effect", *ids)), "pair": (pair, told("pair", *reversed(both))),
    }  # fmt: skip
    for kind, (label, _) in right.items():
        truth = truth_of(label)
        assert {other for other, (_, words) in right.items() if resolved(truth, words)} == {kind}
        assert not resolved(truth, None) and not resolved(truth, told("ambiguous", committed=False))
        assert not resolved(truth, told("effect", "ghost")) and not resolved(truth, told("effect", both[0], "x"))
        assert not resolved(truth, right[kind][1] | {"failed": "no memory"})


def ambiguous(label: dict[str, Any], rng: Any) -> dict[str, Any]:
    """The right order, without a commitment."""
    return blind_bank.right(label, rng) | {"verdict": "ambiguous", "effects": []}


@pytest.fixture
def folder(tmp_path: Path) -> tuple[Folder, Path]:
    """Ten ambiguous sets; of six one more gait was run: two suggested ones and one random resolve."""
    singles = [one for one in LABELS if one["kind"] == "single" and one["d"] >= 8][:10]
    made = Folder(tmp_path, singles, ambiguous)
    for i in range(6):
        right = told("effect", singles[i]["effects"][0]["id"])
        wrong = told("effect", "ghost")
        where = made.follow(f"{i:03d}", right if i < 2 else None if i == 5 else wrong, right if i == 3 else None)
    return made, where


def test_rows_count_what_was_followed(folder: tuple[Folder, Path]) -> None:
    """No suggestion is not resolved; sets that nobody followed are told and not counted."""
    made, where = folder
    result = score(made.bank, made.verdicts, made.key, follow=where)
    rows = {row.name: row for row in result.rows}
    assert rows["next_gait_resolves"].n == rows["next_gait_random"].n == 6
    assert rows["next_gait_resolves"].value == pytest.approx(2 / 6) and rows["next_gait_resolves"].passed is False
    assert rows["next_gait_random"].value == pytest.approx(1 / 6) and rows["next_gait_random"].target is None
    assert rows["ambiguous"].value == 1.0
    assert any("4 of 10 ambiguous sets were not followed" in words for words in result.warnings)
    none = {row.name: row for row in score(made.bank, made.verdicts, made.key).rows}
    assert none["next_gait_resolves"].n == 0 and none["next_gait_resolves"].passed is None


def test_a_published_file_holds_it(folder: tuple[Folder, Path], tmp_path: Path) -> None:
    """With it inside, or beside it: the same rows as of the bank."""
    made, where = folder
    inside, plain = tmp_path / "inside.json", tmp_path / "plain.json"
    inside.write_bytes(published(opened(made.bank, made.verdicts, made.key, follow=where), CODE))
    plain.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    of_bank = score(made.bank, made.verdicts, made.key, follow=where)
    assert of_bank.rows == score_published([inside]).rows == score_published([plain], follow=where).rows
    assert of_bank.rows != score_published([plain]).rows


def test_one_more_gait_of_another_bank_is_refused(folder: tuple[Folder, Path]) -> None:
    """Another list, other logs, and what cannot be read."""
    made, where = folder
    path = where / "000.json"
    good = path.read_text()
    for bad in ({"index": "0"}, {"logs": "0"}):
        path.write_text(json.dumps(json.loads(good) | bad))
        with pytest.raises(InputError, match="another bank"):
            score(made.bank, made.verdicts, made.key, follow=where)
    path.write_text("{}")
    with pytest.raises(InputError, match="cannot be read"):
        score(made.bank, made.verdicts, made.key, follow=where)
