"""`r2s2r blind` says what is missing, and never leaves a half-written file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from r2s2r_cli.blind.index import index_text
from tests.commands.conftest import invoke
from tests.support import blind_bank
from tests.support.blind_folder import Folder


@pytest.fixture
def bank(tmp_path: Path) -> Path:
    """A bank whose list names one set that nobody has diagnosed."""
    folder = tmp_path / "bank"
    folder.mkdir()
    (folder / "index.json").write_text(index_text("B", "calibration", {"a": {"label": "0", "logs": "0"}}, "test"))
    return folder


def refusal(*arguments: object) -> tuple[int, str]:
    """Exit code and hint of a command that is refused."""
    result = invoke("blind", *map(str, arguments), "--json")
    return result.exit_code, json.loads(result.stdout)["hint"]


def test_what_is_no_bank_is_refused(tmp_path: Path) -> None:
    """Exit code 4 and how to make one; no folder of verdicts."""
    code, hint = refusal("run", tmp_path, "--out", tmp_path / "v")
    assert code == 4 and "blind make" in hint and not (tmp_path / "v").exists()
    (tmp_path / "index.json").write_text("{}")
    assert refusal("run", tmp_path, "--out", tmp_path / "v")[0] == 4


def test_the_key_may_not_lie_in_the_bank(bank: Path) -> None:
    """Whoever copies the bank would have it."""
    code, _ = refusal("make", bank, "--key", bank / "a.key")
    assert code == 2 and not (bank / "a.key").exists()


def test_pictures_have_no_noise_of_their_own(tmp_path: Path) -> None:
    """What a tracker makes of them is what it is."""
    code, _ = refusal("make", tmp_path / "bank", "--key", tmp_path / "a.key", "--camera", "--noise", "1")
    assert code == 2 and not (tmp_path / "a.key").exists()


@pytest.mark.parametrize(
    "extra",
    [
        ("--set", "with_parity"),
        ("--set", "=3"),
        ("--set", "x=]"),
        ("--set", "x=1\ny=2"),
        ("--set", "with_partiy=false"),
        ("--set", "with_parity=3"),
        ("--set", "step=true"),
        ("--without", "ghosts"),
    ],
)
def test_settings_that_are_none_are_refused(bank: Path, extra: tuple[str, str]) -> None:
    """No value, no name, no TOML, two values, no such effect: exit code 2."""
    assert refusal("run", bank, "--out", bank / "v", *extra)[0] == 2
    assert not (bank / "v").exists()


def test_logs_that_are_gone_end_a_run(bank: Path) -> None:
    """The set of the list has no folder: exit code 4, before anything is diagnosed."""
    code, hint = refusal("run", bank, "--out", bank.parent / "v")
    assert code == 4 and hint.startswith("r2s2r blind make")


def test_a_score_needs_key_and_verdicts(bank: Path, tmp_path: Path) -> None:
    """Neither is made up."""
    code, hint = refusal("score", bank, "--verdicts", tmp_path, "--key", tmp_path / "no.key")
    assert code == 4 and "--key" in hint
    from cryptography.fernet import Fernet

    (tmp_path / "a.key").write_bytes(Fernet.generate_key())
    code, hint = refusal("score", bank, "--verdicts", tmp_path / "none", "--key", tmp_path / "a.key")
    assert code == 4 and hint.startswith("r2s2r blind run")
    assert not list(tmp_path.rglob("*.html"))


@pytest.mark.parametrize(
    ("first", "expected"),
    [(["--first", "990", "--count", "24"], "0 to 976"), (["--first", "-1"], ""), (["--first", "x"], "")],
)
def test_a_bank_ends_somewhere(first: list[str], expected: str, tmp_path: Path) -> None:
    """A first set that is not there, or no number: exit code 2, said where, and neither key nor folder is made."""
    bank, key = tmp_path / "bank", tmp_path / "a.key"
    result = invoke("blind", "make", str(bank), "--key", str(key), "--bank", "regression", *first, "--json")
    assert result.exit_code == 2 and expected in json.loads(result.stdout)["expected"]
    assert not bank.exists() and not key.exists()


@pytest.fixture
def judged(tmp_path: Path) -> Folder:
    """A calibration bank of 24 sets with right verdicts, its key in a file."""
    made = Folder(tmp_path / "judged", blind_bank.bank(24), blind_bank.right)
    (tmp_path / "a.key").write_bytes(made.key)
    checkout = tmp_path / "checkout" / "r2s2r_cli"
    (checkout / "blind").mkdir(parents=True)
    (checkout / "__init__.py").write_text("")
    return made


def test_publish_score_and_calibrate(judged: Folder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the bank to a file, and from the file to table, page and calibration without the key."""
    monkeypatch.chdir(tmp_path)
    bank, key = str(judged.bank), ("--verdicts", str(judged.verdicts), "--key", "a.key")
    done = invoke("blind", "publish", bank, *key, "--code", "checkout", "--out", "docs/shard-1.json.gz", "--json")
    assert done.exit_code == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["sets"] == 24 and told["bytes"] == (tmp_path / "docs" / "shard-1.json.gz").stat().st_size
    (tmp_path / "a.key").unlink()
    scored = invoke("blind", "score", "--published", "docs/shard-1.json.gz", "--json")
    assert scored.exit_code == 0, scored.stderr
    rows = {row["name"]: row for row in json.loads(scored.stdout)["rows"]}
    assert rows["top1_clear"]["value"] == 1.0 and json.loads(scored.stdout)["index_sha256"] == judged.own
    assert (tmp_path / "shard-1-score.html").exists() and len(list(tmp_path.glob("shard-1-score-*.png"))) == 2
    learned = invoke("blind", "calibrate", "--published", "docs/shard-1.json.gz", "--out", "calibration.json")
    assert learned.exit_code == 0 and json.loads((tmp_path / "calibration.json").read_text())["sets"] > 12
    assert invoke("blind", "score", "--published", "docs/shard-1.json.gz", "docs/shard-1.json.gz").exit_code == 4


def test_bank_and_files_are_not_mixed(judged: Folder, tmp_path: Path) -> None:
    """A key beside published files, two banks, a bank without key or verdicts: exit code 2 and what to type."""
    file = tmp_path / "a.json"
    file.write_text("{}")
    for command in (["score"], ["calibrate", "--out", tmp_path / "c.json"]):
        assert refusal(*command, "--published", file, "--key", tmp_path / "a.key")[0] == 2
        assert (
            refusal(*command, judged.bank, judged.bank, "--verdicts", judged.verdicts, "--key", tmp_path / "a.key")[0]
            == 2
        )
        assert refusal(*command, judged.bank, "--key", tmp_path / "a.key")[0] == 2
        code, hint = refusal(*command, file)
        assert code == 2 and hint == f"r2s2r blind {command[0]} --published {file}"
        assert refusal(*command, "--published", file)[0] == 4
    assert not (tmp_path / "c.json").exists()
