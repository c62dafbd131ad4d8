"""`r2s2r blind` says what is missing, and never leaves a half-written file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from r2s2r_cli.blind.index import index_text
from tests.commands.conftest import invoke


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


@pytest.mark.parametrize("extra", [("--set", "with_parity"), ("--set", "x=]"), ("--without", "ghosts")])
def test_settings_that_are_none_are_refused(bank: Path, extra: tuple[str, str]) -> None:
    """No value, no TOML, no such effect: exit code 2."""
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
