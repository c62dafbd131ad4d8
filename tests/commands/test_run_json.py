"""`run --json`: one document on stdout, of the whole, or of the stage that failed."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import IO

import pytest

from tests.commands.conftest import document, invoke
from tests.commands.test_run import Child
from tests.guards.listing import commands


class Speaking(Child):
    """A stage that prints a document."""

    def __init__(self, words: list[str], stdout: IO[bytes]) -> None:
        super().__init__(words)
        assert words[-1] == "--json"
        stdout.write(json.dumps({"stage": words[3]}).encode())


@pytest.fixture
def speaking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages that do nothing and say so."""
    Child.calls, Child.codes = [], {}
    monkeypatch.setattr(subprocess, "Popen", Speaking)


def test_the_whole_is_one_document(estimated: Path, speaking: None) -> None:
    """Of every stage its command, its artifact, and whether it was carried out."""
    found = document("run", "--until", "plan", "--port", "socket://nowhere:1")
    assert (found["schema"], found["iteration"]) == ("r2s2r.run/1", 1)
    assert [(one["stage"], one["state"]) for one in found["stages"]] == [
        ("record", "kept"), ("estimate", "done"), ("identify", "done"), ("plan", "done"),
    ]  # fmt: skip
    assert found["stages"][-1]["command"] == "r2s2r plan --iteration 1"
    assert found["stages"][-1]["artifact"] == "iterations/001/40-plan.h5"
    dry = document("run", "--until", "estimate", "--dry-run")
    assert [one["state"] for one in dry["stages"]] == ["dry_run"]


def test_a_stage_that_fails_has_the_word(estimated: Path, speaking: None) -> None:
    """Its document alone, with its code."""
    Child.codes["identify"] = 6
    result = invoke("run", "--json")
    assert result.exit_code == 6
    assert json.loads(result.stdout) == {"stage": "identify"}


def test_every_command_has_it() -> None:
    """As README.md says."""
    single = {name: one for name, one in commands().items() if not hasattr(one, "commands")}
    assert single and [name for name, one in single.items() if not any("--json" in p.opts for p in one.params)] == []
