"""Shards: two of them are one bank, and what does not belong together is not put together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.blind.index import FORMAT, index_of
from r2s2r_cli.blind.score import calibration_published, score, score_published
from r2s2r_cli.blind.score.published import published
from r2s2r_cli.blind.score.shard import opened
from r2s2r_cli.errors import InputError
from tests.support import blind_bank
from tests.support.blind_folder import CODE, Folder

LABELS = blind_bank.bank(60)
NAMES = [f"{(37 * i) % 101:03d}" for i in range(60)]


def knows_by_number(label: dict[str, Any], rng: Any) -> dict[str, Any]:
    """Right on two sets of three: an answer that does not depend on the order in which it is asked."""
    plain = blind_bank.np.random.default_rng(label["seed"])
    return (blind_bank.always if label["seed"] % 3 == 0 else blind_bank.right)(label, plain)


def shard(home: Path, which: slice, **options: Any) -> Path:
    """Published file of a part of the labels."""
    code = CODE | options.pop("code", {})
    made = Folder(home, LABELS[which], knows_by_number, names=NAMES[which], **options)
    path = home / "shard.json"
    path.write_bytes(published(opened(made.bank, made.verdicts, made.key), code))
    return path


def test_two_shards_are_one_bank(tmp_path: Path) -> None:
    """Every figure and picture of both together is that of one bank with all sets, in any order of the files."""
    a, b = shard(tmp_path / "a", slice(0, 25)), shard(tmp_path / "b", slice(25, 60))
    whole = score_published([shard(tmp_path / "whole", slice(0, 60))])
    both = score_published([a, b])
    apart = {"shards": (), "index_sha256": ""}
    assert both.model_copy(update=apart) == whole.model_copy(update=apart)
    assert both == score_published([b, a]) and not both.warnings
    assert [one.scored for one in both.shards] in ([25, 35], [35, 25])
    assert all(one.index_sha256 in both.index_sha256 for one in both.shards)
    learned, other = calibration_published([b, a]), calibration_published([tmp_path / "whole" / "shard.json"])
    assert learned | {"words": ""} == other | {"words": ""} and "+" in learned["words"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"tier": "A"}, "different tiers"),
        ({"bank": "blind"}, "different banks"),
        ({"settings": {"with_parity": False}}, "different questions"),
        ({"shuffled": 1}, "different questions"),
    ],
)
def test_what_does_not_belong_together_is_refused(options: dict[str, Any], words: str, tmp_path: Path) -> None:
    """Tier, bank, settings, exchanged commands."""
    a, b = shard(tmp_path / "a", slice(0, 20)), shard(tmp_path / "b", slice(20, 40), **options)
    with pytest.raises(InputError, match=words):
        score_published([a, b])


def test_no_world_counts_twice(tmp_path: Path) -> None:
    """The same file again; a set of the same name; another name for the same seed; the same worlds seen through other
    noise."""
    a, b = shard(tmp_path / "a", slice(0, 20)), shard(tmp_path / "b", slice(10, 30))
    c = tmp_path / "c" / "shard.json"
    made = Folder(c.parent, LABELS[:5], knows_by_number, names=["a", "b", "c", "d", "e"])
    c.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    again = [one | {"observed": 1} for one in LABELS[:5]]
    made = Folder(tmp_path / "d", again, knows_by_number, names=["f", "g", "h", "i", "j"])
    d = tmp_path / "d" / "shard.json"
    d.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    for files in ([a, a], [a, b], [a, c], [a, d]):
        with pytest.raises(InputError, match="counted twice"):
            score_published(files)


def test_other_code_and_another_calibration_are_told(tmp_path: Path) -> None:
    """Commits alone may differ; sources and calibration may not, without a word."""
    a = shard(tmp_path / "a", slice(0, 20))
    b = shard(tmp_path / "b", slice(20, 40), code={"commit": "c1"})
    c = shard(tmp_path / "c", slice(40, 60), code={"commit": "c2", "sources_sha256": "f01", "changed": True})
    assert score_published([a, b]).warnings == ()
    told = score_published([a, b, c]).warnings
    assert any("different code" in one and "c2" in one for one in told) and any("not committed" in one for one in told)
    made = Folder(tmp_path / "d", LABELS[20:40], lambda label, rng: knows_by_number(label, rng) | {"calibrated": "new"},
                  names=NAMES[20:40])  # fmt: skip
    d = tmp_path / "d.json"
    d.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    assert any("2 calibrations" in one for one in score_published([a, d]).warnings)


def test_banks_that_other_code_made_are_told(tmp_path: Path) -> None:
    """Their labels may mean something else: two digests are remarked on, of files as of a bank; one, or one that is not
    known beside it, is not. The published file carries them in its list."""
    a = shard(tmp_path / "a", slice(0, 15), makers=[CODE])
    b = shard(tmp_path / "b", slice(15, 30), makers=[CODE | {"commit": "c1"}])
    c = shard(tmp_path / "c", slice(30, 45), makers=[CODE | {"commit": "c2", "sources_sha256": "f01"}])
    before = shard(tmp_path / "before", slice(45, 60))
    assert score_published([a, b, before]).warnings == ()
    found = score_published([a, c, before])
    assert len(found.warnings) == 1 and all(word in found.warnings[0] for word in ("labels", "c0de", "c2"))
    assert sorted(one.makers_sha256 for one in found.shards) == [(), ("f00",), ("f01",)]
    made = Folder(tmp_path / "d", LABELS[:20], knows_by_number, makers=[CODE, CODE | {"sources_sha256": "f01"}])
    assert "different code made" in score(made.bank, made.verdicts, made.key).warnings[0]


@pytest.mark.parametrize("makers", [[{}], [7], 7, [CODE | {"sources_sha256": None}], [CODE | {"commit": 7}]])
def test_makers_that_are_none_are_refused(makers: Any, tmp_path: Path) -> None:
    """A list that was written by hand: said so, no traceback."""
    found = {"format": FORMAT, "tier": "B", "bank": "blind", "made_by": "x", "sets": {}, "makers": makers}
    with pytest.raises(InputError, match="list of the blind sets"):
        index_of(json.dumps(found).encode(), where="x")


def test_only_a_calibration_bank_teaches(tmp_path: Path) -> None:
    """Neither a blind bank nor exchanged commands."""
    for name, options in (("a", {"bank": "blind"}), ("b", {"shuffled": 1})):
        with pytest.raises(InputError, match="may teach"):
            calibration_published([shard(tmp_path / name, slice(0, 20), **options)])


def test_an_effect_that_was_not_given_has_a_row(tmp_path: Path) -> None:
    """Without payload in the catalogue: whoever names it all the same is found."""
    kept = [name for name in blind_bank.EFFECTS if name not in ("friction_field", "payload")]
    result = score_published([shard(tmp_path, slice(0, 60), settings={"effects": kept})])
    told = next(one for one in result.rows if one.name == "without_named")
    assert told.n == 60 and told.value and told.passed is False


def test_other_noise_may_be_published_too(tmp_path: Path) -> None:
    """Second verdicts from files: compared by name where the seed is the same, refused where it is not."""
    a = shard(tmp_path / "a", slice(0, 20))
    again = shard(tmp_path / "again", slice(0, 15))
    row = next(one for one in score_published([a], again=[again]).rows if one.name == "same_verdict")
    assert row.n == 15 and row.value == 1.0
    made = Folder(tmp_path / "other", LABELS[40:], knows_by_number, names=NAMES[:20])
    other = tmp_path / "other.json"
    other.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    with pytest.raises(InputError, match="different worlds"):
        score_published([a], again=[other])


def test_verdicts_say_which_code_judged(tmp_path: Path) -> None:
    """What they say goes before what is said of them; code that changed between two of them is told of the bank too."""
    made = Folder(tmp_path, LABELS[:20], knows_by_number, code=CODE | {"commit": "c3"})
    made.judge("007", {"code": CODE | {"commit": "c4", "sources_sha256": "f05"}})
    path = tmp_path / "a.json"
    path.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    of_file, of_bank = score_published([path]), score(made.bank, made.verdicts, made.key)
    assert of_file.shards[0].commits == ("c3", "c4") and of_file.shards[0].sources_sha256 == ("f00", "f05")
    assert of_file.warnings == of_bank.warnings and "different code" in of_file.warnings[0]
    assert of_file.shards[0].model_copy(update={"where": ""}) == of_bank.shards[0].model_copy(update={"where": ""})


def test_second_verdicts_are_read_as_carefully(tmp_path: Path) -> None:
    """A folder that is not there or knows no set has none; one that holds no verdict, or peeked, is refused."""
    a, folder = shard(tmp_path / "a", slice(0, 20)), tmp_path / "a" / "verdicts"
    row = next(one for one in score_published([a], again=[folder]).rows if one.name == "same_verdict")
    assert row.n == 20 and row.value == 1.0
    with pytest.raises(InputError, match="no second verdict"):
        score_published([a], again=[tmp_path / "none"])
    path = folder / f"{NAMES[0]}.json"
    good = path.read_text()
    path.write_text(good.replace('"refused": []', '"refused": ["labels"]'))
    with pytest.raises(InputError, match="reached for"):
        score_published([a], again=[folder])
    path.write_text(good[:-9])
    with pytest.raises(InputError, match="cannot be read"):
        score_published([a], again=[folder])


@pytest.mark.parametrize(
    ("said", "fits"),
    [
        ({"shrinkage": {"judged_on": ["g4:1", "g5:3"]}, "segments": [{"run": "g1"}, {"run": "g3"}]}, True),
        ({"shrinkage": {"judged_on": ["g4:2"]}, "segments": []}, True),
        ({"shrinkage": None, "segments": [{"run": "g3"}]}, True),
        ({"shrinkage": {"judged_on": ["g3:1"]}, "segments": [{"run": "g1"}, {"run": "g2"}]}, False),
        ({"shrinkage": {"judged_on": ["g6:1", "g8:3"]}, "segments": [{"run": "g5"}]}, False),
        ({"shrinkage": None, "segments": [{"run": "g6"}]}, False),
    ],
)  # fmt: skip
def test_a_second_verdict_is_on_the_same_gaits(said: dict[str, Any], fits: bool, tmp_path: Path) -> None:
    """Of a set of five: with another --count the same key makes other worlds under the same names."""
    labels = [one | {"gaits": 5} for one in LABELS[:3]]
    made = Folder(tmp_path, labels, lambda label, rng: knows_by_number(label, rng) | said, names=NAMES[:3])
    a = tmp_path / "a.json"
    a.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    if fits:
        rows = score_published([a], again=[made.verdicts]).rows
        assert next(one for one in rows if one.name == "same_verdict").n == 3
    else:
        with pytest.raises(InputError, match="on another world"):
            score_published([a], again=[made.verdicts])


def test_a_set_without_d_teaches_nothing(tmp_path: Path) -> None:
    """It would teach that nothing is wrong where something is."""
    labels = [one | {"d": None} for one in LABELS[:20]]
    made = Folder(tmp_path / "a", labels, knows_by_number, names=NAMES[:20])
    path = tmp_path / "a" / "shard.json"
    path.write_bytes(published(opened(made.bank, made.verdicts, made.key), CODE))
    with pytest.raises(InputError, match="without d"):
        calibration_published([path])
