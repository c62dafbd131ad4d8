"""What a figure is worth: diagnosers that look at nothing, splits by noise, gaits and rate, and which code judged."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from r2s2r_cli.blind import run
from r2s2r_cli.blind.code import code
from r2s2r_cli.blind.score import score_of
from r2s2r_cli.blind.score.baselines import baselines
from r2s2r_cli.blind.score.facts import said_of, truth_of
from r2s2r_cli.errors import InputError
from tests.support import blind_bank
from tests.support.blind_folder import Folder

LABELS = blind_bank.bank(250)
FOUND = blind_bank.answered(LABELS, blind_bank.right)


def test_who_looks_at_nothing_is_right_as_often_as_chance_allows() -> None:
    """At random 1 of n names, 3 of n among three; always the same name as often as the labels have it."""
    pairs = [(t, s) for _, t, s in FOUND]
    chance, often, effect = baselines(pairs, "B")
    names = len({name for _, s in pairs for name in s.order} | {*blind_bank.EFFECTS, "none", "unknown"})
    assert chance.values["top1_clear"] == pytest.approx(1 / names, abs=0.02)
    assert chance.values["top3_clear"] == pytest.approx(3 / names, abs=0.03)
    right = Counter(t.right for t, _ in pairs if t.right is not None)
    total = right.total()
    assert often.name == "always none" and often.values["top1_all"] == pytest.approx(right["none"] / total)
    assert often.values["false_alarm"] == 0.0 and often.values["top1_clear"] == 0.0
    clear = [t for t, _ in pairs if t.kind == "single" and t.stratum == "clear"]
    name = effect.name.removeprefix("always ")
    assert right[name] == max(n for one, n in right.items() if one not in ("none", "unknown"))
    assert effect.values["top1_clear"] == pytest.approx(sum(t.right == name for t in clear) / len(clear))
    assert chance.values["coverage"] == pytest.approx(0.9, abs=0.05) and often.values["coverage"] >= 0.9


def test_who_looks_is_better_than_who_does_not() -> None:
    """On every figure that baselines have, the one who knows is at least as good as each of them."""
    result = score_of(FOUND, tier="B", bank="test", sets=250, index="0")
    rows = {row.name: row for row in result.rows}
    for one in result.baselines:
        for name in ("top1_clear", "top3_clear", "channel_clear", "element_clear", "top1_weak", "pair_top3"):
            if name in one.values:
                assert float(rows[name].value or 0.0) > one.values[name], (one.name, name)


def test_splits_hold_every_set_once() -> None:
    """By noise, by gaits and by rate: counts add up to those of the whole table."""
    result = score_of(FOUND, tier="B", bank="test", sets=250, index="0")
    rows = {row.name: row for row in result.rows}
    for by, values in (("noise", ["2 mm", "5 mm", "10 mm"]), ("gaits", ["3", "5", "8"]), ("rate", ["10 Hz", "30 Hz"])):
        own = [one for one in result.splits if one.by == by]
        assert [one.value for one in own] == values and sum(one.sets for one in own) == 250
        assert (
            sum(one.clear for one in own) == rows["top1_clear"].n
            and sum(one.top1 for one in own) == rows["top1_clear"].n
        )
        assert sum(one.right for one in own) == sum(one.named for one in own) == rows["precision_named"].n
        assert sum(one.none for one in own) == rows["false_alarm"].n and sum(one.alarms for one in own) == 0


def test_the_right_effect_is_held_against_its_nearest_rival() -> None:
    """Less error left than the most probable wrong effect; sets where one of them was not fitted do not count."""
    label = next(one for one in LABELS if one["kind"] == "single" and one["d"] >= 8)
    name = label["effects"][0]["id"]
    others = [one for one in blind_bank.EFFECTS if one != name][:2]

    def ranked(own: float | None, first: float, second: float) -> float | None:
        document = blind_bank.document("ambiguous", [], {name: 0.2, others[0]: 0.5, others[1]: 0.2, "none": 0.1})
        for row in document["ranking"]:
            row["rmse_m"] = {name: own, others[0]: first, others[1]: second, "none": 0.0}[row["effect"]]
        found = [("a", truth_of(label), said_of({"diagnosis": document}))]
        rows = score_of(found, tier="B", bank="test", sets=1, index="0").rows
        return next(row.value for row in rows if row.name == "wrong_less")

    assert ranked(0.01, 0.02, 0.005) == 1.0 and ranked(0.03, 0.02, 0.05) == 0.0 and ranked(None, 0.02, 0.02) is None


def test_code_is_known_by_what_a_diagnosis_can_import(tmp_path: Path) -> None:
    """What is imported through others, also inside functions, counts; docs and what nothing imports do not."""
    files = {
        "__init__.py": "", "blind/__init__.py": "", "blind/run.py": "from r2s2r_cli.stages import look\n",
        "blind/catalogue.py": "def f():\n    import r2s2r_cli.effects\n", "stages/__init__.py": "",
        "stages/look.py": "from r2s2r_cli.effects.one import law\n", "effects/__init__.py": "", "effects/one.py": "",
        "views.py": "", "stages/calibration.json": "{}",
    }  # fmt: skip
    for name, text in files.items():
        path = tmp_path / "r2s2r_cli" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    first = code(tmp_path)
    assert first["commit"] is None and first["changed"] is False
    changes = {}
    for name in files:
        path = tmp_path / "r2s2r_cli" / name
        path.write_text(files[name] + "\n")
        code.cache_clear()
        changes[name] = code(tmp_path)["sources_sha256"] != first["sources_sha256"]
        path.write_text(files[name])
    assert {name for name, changed in changes.items() if not changed} == {"views.py", "stages/calibration.json"}
    with pytest.raises(InputError, match="no r2s2r"):
        code(tmp_path / "stages")


def test_a_verdict_says_which_code_judged(tmp_path: Path) -> None:
    """Also one that broke off, as here where a set has no logs; without it the code of later would be held for it."""
    made = Folder(tmp_path, LABELS[:1], blind_bank.right)
    verdict = run.one(run.jobs(made.bank, tmp_path / "out")[0])
    assert verdict["failed"] and verdict["code"] == code() and len(verdict["code"]["sources_sha256"]) == 64
