"""Published files: what they say is what the bank says, anybody can check them, and nothing in them can be changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from r2s2r_cli.blind.score import calibration, calibration_published, publish, score, score_published
from r2s2r_cli.blind.score.lines import WIDTH, text_of
from r2s2r_cli.blind.score.published import published, read_published, write_form
from r2s2r_cli.blind.score.shard import opened
from r2s2r_cli.errors import InputError
from schemas import blind as models, results_diagnose as said
from schemas.results_blind import BlindScoreResult
from tests.guards.listing import ROOT
from tests.support import blind_bank
from tests.support.blind_folder import CODE, Folder

LABELS = blind_bank.bank(40)
Change = Callable[[dict[str, Any]], object]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """Forty sets judged by chance; one diagnosis broke off, one set has no verdict."""
    home = tmp_path_factory.mktemp("bank")
    made = Folder(home, LABELS, blind_bank.by_chance, settings={"cache": str(home / "cache"), "seed": 3})
    trace = f'File "{home}/checkout/r2s2r_cli/x.py", line 3, in f\nOSError: {home}/bank/sets/003/log.csv'
    made.judge("003", {"failed": f"bug: {trace}", "diagnosis": {}})
    (made.verdicts / "005.json").unlink()
    return made


@pytest.fixture(scope="module")
def file(folder: Folder) -> Path:
    """Its published file."""
    path = folder.bank.parent / "published.json"
    path.write_bytes(published(opened(folder.bank, folder.verdicts, folder.key), CODE))
    return path


def figures(result: BlindScoreResult) -> BlindScoreResult:
    """All but where it was read from."""
    return result.model_copy(update={"shards": ()})


def test_a_published_file_is_scored_as_its_bank(folder: Folder, file: Path) -> None:
    """Every figure, the confusion, the misses and the warnings are the same, and so is what a calibration learns."""
    of_bank = score(folder.bank, folder.verdicts, folder.key)
    assert figures(score_published([file])) == figures(of_bank)
    assert (
        of_bank.scored == 39 and of_bank.sets == 40 and of_bank.failed == 1 and "1 sets have no" in of_bank.warnings[0]
    )
    assert calibration_published([file]) == calibration(folder.bank, folder.verdicts, folder.key)


def test_the_same_verdicts_give_the_same_bytes(folder: Folder, file: Path, tmp_path: Path) -> None:
    """Also compressed, whatever the name; no folder of this machine is in it, and a set takes little room."""
    again = published(opened(folder.bank, folder.verdicts, folder.key), CODE)
    assert again == file.read_bytes()
    assert write_form(again, "a.json.gz") == write_form(again, "b.json.gz") != again
    (tmp_path / "a.json.gz").write_bytes(write_form(again, "a.json.gz"))
    assert read_published(tmp_path / "a.json.gz").sets == read_published(file).sets
    text = again.decode()
    assert str(folder.bank.parent) not in text and "r2s2r_cli/x.py" in text and '"seed": 3' in text
    assert len(again) < 10_000 * 39 and max(map(len, text.replace("\\n", "\n").splitlines())) < 2 * WIDTH


def test_a_reader_can_check_it_with_nothing_but_hashes(folder: Folder, file: Path) -> None:
    """The list is the one whose hash was published, and every label hashes to what the list says of it."""
    content = json.loads(file.read_text())
    assert hashlib.sha256(content["index"].encode()).hexdigest() == content["index_sha256"] == folder.own
    listed = json.loads(content["index"])["sets"]
    for name, one in content["sets"].items():
        plain = json.dumps({"label": one["label"], "salt": one["salt"]}, sort_keys=True)
        assert hashlib.sha256(plain.encode()).hexdigest() == listed[name]["label"]
    verdict = (folder.verdicts / "000.json").read_bytes()
    assert hashlib.sha256(verdict).hexdigest() == content["sets"]["000"]["verdict"]["sha256"]


def test_it_fits_its_schema(file: Path) -> None:
    """schemas/json/blind_published.json describes it, and refuses what is not of it."""
    schema = json.loads((ROOT / "schemas" / "json" / "blind_published.json").read_text())
    content = json.loads(file.read_text())
    jsonschema.Draft202012Validator(schema).validate(content)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft202012Validator(schema).validate({**content, "truth": 1})


def _index(content: dict[str, Any]) -> None:
    """Another label is committed to, afterwards."""
    one = content["sets"]["000"]
    one["label"]["d"] = 99.0
    plain = json.dumps({"label": one["label"], "salt": one["salt"]}, sort_keys=True)
    index = json.loads(content["index"])
    index["sets"]["000"]["label"] = hashlib.sha256(plain.encode()).hexdigest()
    content["index"] = json.dumps(index)


FORGED: dict[str, tuple[Change, str]] = {
    "label": (lambda c: c["sets"]["000"]["label"].update(d=99.0), "not the one that was committed to"),
    "salt": (lambda c: c["sets"]["000"].update(salt="00"), "not the one that was committed to"),
    "logs": (lambda c: c["sets"]["000"]["verdict"].update(logs="00"), "other logs"),
    "list": (_index, "not of the list"),
    "tier": (lambda c: c.update(tier="A"), "not of the list"),
    "set left out": (lambda c: c["sets"].pop("000"), "other sets than its list"),
    "no set": (lambda c: c.update(sets={}, missing=sorted(c["sets"])), "other sets than its list"),
    "key that is none": (lambda c: c["sets"]["000"].update(truth=1), "cannot be read"),
    "another format": (lambda c: c.update(format="r2s2r blind published 2"), "cannot be read"),
}


@pytest.mark.parametrize("name", FORGED)
def test_who_forges_it_and_its_sum_is_found_out(name: str, file: Path, tmp_path: Path) -> None:
    """The sum of the file is made to fit, the commitments cannot be."""
    change, words = FORGED[name]
    content = json.loads(file.read_text())
    change(content)
    rest = {key: value for key, value in content.items() if key != "content_sha256"}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"))
    forged = tmp_path / "forged.json"
    forged.write_text(json.dumps({**rest, "content_sha256": hashlib.sha256(text.encode()).hexdigest()}))
    with pytest.raises(InputError, match=words):
        read_published(forged)


def test_a_verdict_that_was_changed_is_refused(file: Path, tmp_path: Path) -> None:
    """One digit of one probability; half a file; no file."""
    content = json.loads(file.read_text())
    content["sets"]["000"]["verdict"]["diagnosis"]["probability"] += 0.001
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(content))
    with pytest.raises(InputError, match="was changed"):
        read_published(changed)
    changed.write_bytes(write_form(file.read_bytes(), "x.gz")[:-40])
    for path in (changed, tmp_path / "none.json"):
        with pytest.raises(InputError, match="cannot be read"):
            read_published(path)


@pytest.mark.parametrize("path", sorted((ROOT / "docs/blind").glob("*.json.gz")), ids=lambda path: path.name)
def test_what_was_published_before_stays_readable(path: Path) -> None:
    """Every shard of the project, by whatever version it was judged: its sums and its labels fit."""
    assert read_published(path).sets


def test_publish_checks_as_score_does(folder: Folder, tmp_path: Path) -> None:
    """A verdict that reached for the truth, of another bank, or to another question is not published."""
    for wrong, words in (({"refused": ["labels"]}, "reached"), ({"index": "0"}, "another bank"),
                         ({"settings": {"seed": 4}}, "different questions")):  # fmt: skip
        made = Folder(tmp_path / words.split()[0], LABELS[:3], blind_bank.right)
        made.judge("001", wrong)
        with pytest.raises(InputError, match=words):
            publish(made.bank, made.verdicts, made.key)


@pytest.mark.parametrize(
    "value", [{}, [], None, 1e-17, "µ\n", {"b": [1, {"a": list(range(200))}], "a": {"c": "x" * 300}}]
)
def test_short_text_says_the_same(value: object) -> None:
    """What is written on few lines is read back as it was, keys in order."""
    text = text_of(value)
    assert json.loads(text) == value and text.endswith("\n") and text_of(json.loads(text)) == text
    if isinstance(value, dict):
        assert list(json.loads(text)) == sorted(value)


LEFT_OUT = {
    ("PublishedRank", "RankedName"): {"ci90", "units", "on_bound"},
    ("PublishedWhere", "WhereFound"): {"segments", "onset"},
    ("PublishedShrinkage", "ShrinkageFound"): {"metric", "judged_on", "set_aside", "within_run"},
    ("PublishedNext", "NextGaitFound"): {"file", "targets", "candidates"},
    ("PublishedDiagnosis", "DiagnoseReport"): {
        "iteration", "free_iteration", "robot", "floor_from", "floor_given", "left_out", "segments", "hidden",
        "missing", "parity_effects", "parity_sd", "refit", "refit_units", "rollouts", "within_run",
        "wall_s", "seconds", "warnings",
    },
}  # fmt: skip
"""Of what a diagnosis says, by the model of the published file: nothing that is scored, calibrated or asked about."""
NO_LONGER_SAID = {"PublishedRank": {"linear_gain"}}
"""In files that were published before, which stay readable."""


@pytest.mark.parametrize("pair", LEFT_OUT, ids="-".join)
def test_what_is_left_out_was_decided(pair: tuple[str, str]) -> None:
    """A new field of a diagnosis is published, or named here: a calibration that reads it must find it in the file."""
    mine, theirs = (getattr(module, name).model_fields for module, name in zip((models, said), pair, strict=True))
    before = NO_LONGER_SAID.get(pair[0], set())
    assert set(mine) - before | LEFT_OUT[pair] == set(theirs) and not set(mine) & LEFT_OUT[pair]
    assert before <= set(mine) and not before & set(theirs)


@pytest.mark.parametrize(("name", "received"), [("none.json.gz", "none of this name"), ("page.md", "neither JSON")])
def test_what_is_no_published_file_gets_a_hint_that_writes_nothing(tmp_path: Path, name: str, received: str) -> None:
    """A file that is not there, and one that is something else: the hint lists what there is."""
    (tmp_path / "page.md").write_text("# a page\n")
    with pytest.raises(InputError) as caught:
        read_published(tmp_path / name)
    assert received in caught.value.received and caught.value.hint.startswith("ls ")
