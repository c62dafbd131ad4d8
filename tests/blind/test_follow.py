"""Following up an ambiguous verdict: what is asked for, what is kept, and what is never handed over."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.blind import follow
from r2s2r_cli.blind.catalogue import diagnosed
from r2s2r_cli.errors import InputError
from schemas.robot import Robot
from tests.commands.conftest import invoke
from tests.support.blind_bank import document
from tests.support.blind_follow import TARGETS, bank_of, verdict, wants

SURE = document("effect", ["payload"], {"payload": 0.9, "none": 0.1})


def test_what_is_ambiguous_is_followed(tmp_path: Path) -> None:
    """Neither what is settled nor what broke off; of a long suggestion what `diagnose` judged it by."""
    from r2s2r_cli.stages.diagnose.imagined import LONGEST

    many = {"a": wants([[1.0, k / 20] for k in range(20)]), "b": SURE, "c": {}, "d": wants(None), "e": wants(TARGETS)}
    whole = follow.trial(*bank_of(tmp_path, many))
    assert [(one.name, one.gait) for one in whole.open] == [("a", "reversals"), ("d", None), ("e", "reversals")]
    assert whole.targets == {"a": [[1.0, k / 20] for k in range(LONGEST)], "e": TARGETS}
    assert (whole.sets, whole.judged) == (5, 5)


def test_the_maker_is_told_the_targets_alone(tmp_path: Path) -> None:
    """No name of a gait or an effect, no probability. What was begun is gone on with, another seed is refused."""
    whole = follow.trial(*bank_of(tmp_path, {"a": wants(TARGETS), "b": SURE}))
    path = follow.begin(whole, tmp_path / "out", seed=3)
    assert json.loads(path.read_text()) == {"index": whole.index, "seed": 3, "sets": {"a": TARGETS}}
    assert follow.begin(whole, tmp_path / "out", seed=3) == path
    with pytest.raises(InputError, match="begun with"):
        follow.begin(whole, tmp_path / "out", seed=4)


@pytest.mark.parametrize(
    "changed", [{"index": "0"}, {"shuffled": 1}, {"diagnosis": {"verdict": "ambiguous"}}, {"refused": ["labels/a"]}]
)
def test_verdicts_of_something_else_are_refused(tmp_path: Path, changed: dict[str, Any]) -> None:
    """Of another bank, of a negative control, with a part missing, or that reached for the truth."""
    with pytest.raises(InputError):
        follow.trial(*bank_of(tmp_path, {"a": wants(TARGETS)}, **changed))


def test_verdicts_with_other_settings_are_refused(tmp_path: Path) -> None:
    """What comes after is asked what was asked before, which must be one thing."""
    bank, verdicts = bank_of(tmp_path, {"a": wants(TARGETS), "b": wants(TARGETS)})
    other = verdict("b", follow.trial(bank, verdicts).index, wants(TARGETS), settings={"seed": 1})
    (verdicts / "b.json").write_text(json.dumps(other))
    with pytest.raises(InputError, match="different questions"):
        follow.trial(bank, verdicts)


def test_what_was_said_is_kept_without_a_judgement(tmp_path: Path) -> None:
    """Before, after the suggested gait, after one by chance, as soon as both are there; a set without a suggestion has
    neither."""
    whole = follow.trial(*bank_of(tmp_path, {"a": wants(TARGETS), "d": wants(None)}))
    out = tmp_path / "out"
    follow.begin(whole, out, seed=0)
    after = {"suggested": verdict("a", "1", SURE), "random": verdict("a", "2", {})}
    for which, found in after.items():
        assert [one["set"] for one in follow.write(whole, out, whole.open)] == ["d"]
        (out / "verdicts" / which).mkdir(parents=True)
        (out / "verdicts" / which / "a.json").write_text(json.dumps(found))
    follow.write(whole, out, whole.open)
    kept = json.loads((out / "a.json").read_text())
    assert kept["gait"] == {"name": "reversals", "targets": 2}
    assert (kept["format"], kept["index"], kept["logs"]) == (follow.FORMAT, whole.index, "logs of a")
    assert kept["before"]["verdict"] == "ambiguous" and not kept["before"]["committed"]
    assert kept["suggested"] == {"failed": None, "verdict": "effect", "named": ["payload"], "first": "payload",
                                 "set90": ["payload", "none"], "committed": True}  # fmt: skip
    assert kept["random"]["failed"] == "broke" and not kept["random"]["committed"]
    none = json.loads((out / "d.json").read_text())
    assert none["gait"] is None and none["suggested"] is None and none["random"] is None


def test_what_else_changed_is_said(tmp_path: Path) -> None:
    """Code or calibration, where both verdicts tell; verdicts of older versions tell neither."""
    old = {"code": {"sources_sha256": "1"}, "diagnosis": {**wants(TARGETS), "calibrated": "20 sets"}}
    whole = follow.trial(*bank_of(tmp_path, {"a": wants(TARGETS)}, **old))
    same = verdict("a", "1", {**SURE, "calibrated": "20 sets"}, code={"sources_sha256": "1"})
    assert follow.judged_otherwise(whole, same) is None
    assert follow.judged_otherwise(whole, verdict("a", "1", {})) is None
    code = follow.judged_otherwise(whole, {**same, "code": {"sources_sha256": "2"}})
    learned = follow.judged_otherwise(whole, {**same, "diagnosis": {**SURE, "calibrated": "30 sets"}})
    assert code is not None and "other code" in code
    assert learned is not None and "calibration" in learned


def test_a_verdict_names_a_gait_of_the_library_of_diagnose(monkeypatch: pytest.MonkeyPatch) -> None:
    """The diagnoser on trial chooses from what `r2s2r diagnose` chooses from."""
    from r2s2r_cli.stages.diagnose import diagnose as stage
    from r2s2r_cli.stages.init.robots import robot_toml

    class Seen(Exception):
        pass

    def looks(evidence: Any, settings: stage.Settings, **how: Any) -> None:
        assert {"ramps", "holds", "reversals", "repeats"} < set(settings.library.gaits)
        raise Seen

    class Little:
        robot = Robot.model_validate(tomllib.loads(robot_toml("threebar")))

    monkeypatch.setattr(stage, "diagnose", looks)
    with pytest.raises(Seen):
        diagnosed(Little(), {"seed": 1})  # type: ignore[arg-type]


def asked(bank: Path, verdicts: Path, out: Path) -> tuple[int, dict[str, Any]]:
    """Exit code and document of the command."""
    result = invoke("blind", "follow", str(bank), "--verdicts", str(verdicts), "--key", str(bank.parent / "a.key"),
                    "--out", str(out), "--json", "--quiet")  # fmt: skip
    return result.exit_code, json.loads(result.stdout)


def test_a_bank_without_doubt_needs_no_maker(tmp_path: Path) -> None:
    """Nothing is ambiguous, or nothing is suggested: no key is read, no world is made, and it says so."""
    bank, verdicts = bank_of(tmp_path, {"b": SURE, "d": wants(None)})
    code, found = asked(bank, verdicts, tmp_path / "out")
    assert code == 0 and (found["ambiguous"], found["without_gait"], found["done"]) == (1, 1, 1)
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["asked.json", "d.json"]


def test_what_would_be_overwritten_is_refused(tmp_path: Path) -> None:
    """The verdicts, and the bank; and a folder without a verdict is bad input."""
    bank, verdicts = bank_of(tmp_path, {"a": wants(TARGETS)})
    assert asked(bank, verdicts, verdicts)[0] == 2 and asked(bank, verdicts, bank / "out")[0] == 2
    assert sorted(one.name for one in bank.iterdir()) == ["index.json"]
    code, found = asked(bank, tmp_path, tmp_path / "out")
    assert code == 4 and "blind run" in found["hint"] and not (tmp_path / "out").exists()


def test_a_key_that_is_none_ends_it(tmp_path: Path) -> None:
    """The maker says so; nothing is diagnosed, and no new key is written."""
    bank, verdicts = bank_of(tmp_path, {"a": wants(TARGETS)})
    code, found = asked(bank, verdicts, tmp_path / "out")
    assert code == 4 and "key of the labels" in found["what"]
    assert not (tmp_path / "a.key").exists() and not (tmp_path / "out" / "verdicts").exists()
