"""A bank that was begun is gone on with as it was begun, or not at all: its composition is not mixed."""

from __future__ import annotations

import json
import shlex
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cryptography.fernet import Fernet

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.code import code
from r2s2r_cli.blind.index import read_index
from r2s2r_cli.blind.make import bank as maker
from r2s2r_cli.blind.make.bank import Asked, make, sealed, worlds
from r2s2r_cli.blind.make.begun import RECORD
from r2s2r_cli.blind.make.one import label
from r2s2r_cli.blind.split import Bank
from r2s2r_cli.errors import InputError, UsageError
from tests.commands.conftest import invoke
from tests.support.blind_folder import CODE

OTHERS: list[tuple[dict[str, Any], str]] = [
    ({"count": 13}, "--count"), ({"count": 8}, "--count"), ({"bank": Bank.REGRESSION}, "--bank"),
    ({"tier": "A"}, "--tier"), ({"camera": True}, "--camera"), ({"gaits": 3}, "--gaits"),
    ({"noise_mm": 1.0}, "--noise"),
    ({"effect": "payload"}, "--effect"), ({"commissioning": 1}, "--commissioning"), ({"oracle": False}, "--no-oracle"),
    ({"observed": 1}, "--observed"), ({"first": 12}, "--first"),
]  # fmt: skip
"""What is asked for otherwise, and what must be named."""


@pytest.fixture
def asked(tmp_path: Path) -> Asked:
    """Twelve sets, all there, but for logs."""
    key = Fernet.generate_key()
    (tmp_path / "a.key").write_bytes(key)
    found = Asked(Bank.CALIBRATION, 12, tmp_path / "a bank", key, key_file=str(tmp_path / "a.key"))
    for number, world in enumerate(worlds(found)):
        path = sealed(found.out, labels.set_name(key, number))
        path.parent.mkdir(parents=True, exist_ok=True)
        said = label(world, [], None, 0) | {"d": None if world.kind.value == "none" else 9.0}
        path.write_bytes(labels.seal(said, key)[0])
    return found


def all_of(asked: Asked) -> int:
    """How many sets there are when it is done."""
    return len(list(make(asked)))


def test_it_goes_on_as_it_was_begun(asked: Asked) -> None:
    """Also one of before that says nothing of its options, and again with what it was asked by default."""
    assert not (asked.out / RECORD).exists()
    assert [all_of(asked), all_of(asked), all_of(replace(asked, first=0))] == [12, 12, 12]
    assert (asked.out / RECORD).exists() and b"count" not in (asked.out / RECORD).read_bytes()


@pytest.mark.parametrize(("other", "name"), OTHERS)
def test_other_options_are_refused_by_name(other: dict[str, Any], name: str, asked: Asked) -> None:
    """What it was and what it would be; the hint goes on; no label, no list and no record changes."""
    assert all_of(asked) == 12
    before = {path: path.read_bytes() for path in asked.out.rglob("*") if path.is_file()}
    with pytest.raises(UsageError) as caught:
        all_of(replace(asked, **other))
    assert name in f"{caught.value.expected} {caught.value.received}" and caught.value.expected != caught.value.received
    assert len([word for word in caught.value.expected.split() if word.startswith("--")]) == 1
    assert "--count 12" in caught.value.hint and shlex.split(caught.value.hint)[-1] == str(asked.out)
    assert {path: path.read_bytes() for path in asked.out.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize(("other", "name"), OTHERS)
def test_without_a_record_the_labels_tell(other: dict[str, Any], name: str, asked: Asked) -> None:
    """A bank that an earlier version began, half of which is there: nothing is made, and no label is told."""
    for number in range(6, 12):
        sealed(asked.out, labels.set_name(asked.key, number)).unlink()
    with pytest.raises(UsageError) as caught:
        all_of(replace(asked, **other))
    assert "bank" in caught.value.what and not (asked.out / RECORD).exists()
    if name not in ("--bank", "--first", "--observed", "--camera"):  # another world, as it was refused before
        assert "begun with other options" in caught.value.what
        assert not any(one.name[:12] in str(caught.value) for one in (asked.out / labels.LABELS).iterdir())


def test_a_list_of_before_tells_the_count(asked: Asked) -> None:
    """Of twelve sets that were closed: another count is refused although no record says so."""
    assert all_of(asked) == 12
    (asked.out / RECORD).unlink()
    with pytest.raises(UsageError) as caught:
        all_of(replace(asked, count=24))
    assert (caught.value.expected, caught.value.received) == ("12", "24")


def test_another_key_is_refused(asked: Asked) -> None:
    """Its names would be others, and both lie in one folder."""
    all_of(asked)
    with pytest.raises(InputError, match="cannot be opened with this key"):
        all_of(replace(asked, key=Fernet.generate_key()))


def test_the_command_says_so_and_its_hint_goes_on(asked: Asked) -> None:
    """From the maker's process to exit code 2 and one hint, which can be typed; a key that is not there is not made."""
    all_of(asked)
    command = ["blind", "make", str(asked.out), "--key", asked.key_file]
    result = invoke(*command, "--count", "24", "--gaits", "3", "--json")
    told = json.loads(result.stdout)
    assert result.exit_code == 2 and told["expected"] == "--count 12 no --gaits"
    assert told["received"] == "--count 24 --gaits 3"
    index = read_index(asked.out / labels.INDEX)[1]
    again = invoke(*shlex.split(told["hint"])[1:], "--json")
    assert again.exit_code == 0 and json.loads(again.stdout)["index_sha256"] == index
    none = invoke("blind", "make", str(asked.out), "--key", f"{asked.key_file}.2", "--count", "12", "--json")
    assert none.exit_code == 2 and not Path(f"{asked.key_file}.2").exists()


@pytest.fixture
def made_by(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Sets are nothing but a label here; gives what says which code makes them from now on."""

    def one(job: tuple[Asked, Any, str]) -> None:
        asked, world, name = job
        path = sealed(asked.out, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(labels.seal(label(world, [], None, 0), asked.key)[0])

    monkeypatch.setattr(maker, "open_executor", lambda spec, workers: ThreadPoolExecutor(1))
    monkeypatch.setattr(maker, "_one", one)
    return lambda digest: monkeypatch.setattr(maker, "maker", lambda: CODE | {"sources_sha256": digest})


def index_of_bank(asked: Asked) -> dict[str, Any]:
    """The list that was written."""
    return read_index(asked.out / labels.INDEX)[0]


def test_the_list_says_which_code_made_the_bank(tmp_path: Path, made_by: Any) -> None:
    """All of it where a bank was gone on with by other code, each once; a list that was closed stays as it is."""
    asked = Asked(Bank.CALIBRATION, 6, tmp_path, Fernet.generate_key(), oracle=False)
    made_by("f00")
    half = make(asked)
    assert [next(half) for _ in range(3)]
    half.close()
    for digest in ("f01", "f01", "f02"):
        made_by(digest)
        all_of(asked)
    makers = index_of_bank(asked)["makers"]
    assert [one["sources_sha256"] for one in makers] == ["f00", "f01"] and makers[0]["commit"] == CODE["commit"]


def test_of_a_bank_of_before_nothing_is_claimed(asked: Asked, made_by: Any) -> None:
    """What made half of it is not known; and its list, which was committed to, is not written anew."""
    made_by("f00")
    sealed(asked.out, labels.set_name(asked.key, 3)).unlink()
    all_of(replace(asked, oracle=True))
    text = (asked.out / labels.INDEX).read_text()
    assert "makers" not in text
    (asked.out / labels.INDEX).write_text(text + " ")
    all_of(asked)
    assert (asked.out / labels.INDEX).read_text() == text + " "


def test_the_digest_is_of_all_that_makes_a_bank(tmp_path: Path) -> None:
    """The rig and what computes d change it; what only judges does not."""
    for name in ("__init__", "blind/make/__main__", "blind/make/oracle", "rig/world", "blind/score/rows"):
        path = tmp_path / "r2s2r_cli" / f"{name}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    home = tmp_path / "r2s2r_cli"
    (home / "blind/make/__main__.py").write_text("from r2s2r_cli.blind.make.oracle import detectability\n")
    (home / "blind/make/oracle.py").write_text("def f():\n    from r2s2r_cli.rig import world\n")
    changed = {}
    for name in ("blind/make/oracle", "rig/world", "blind/score/rows"):
        code.cache_clear()
        before = code(tmp_path, maker.BEGIN)["sources_sha256"]
        with (home / f"{name}.py").open("a") as file:
            file.write("x = 1\n")
        code.cache_clear()
        changed[name] = code(tmp_path, maker.BEGIN)["sources_sha256"] != before
    assert changed == {"blind/make/oracle": True, "rig/world": True, "blind/score/rows": False}
    assert maker.maker()["sources_sha256"] != code()["sources_sha256"]
