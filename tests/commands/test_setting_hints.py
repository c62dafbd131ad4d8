"""A wrong setting, of --set or of a TOML file: the hint is a command, as typed but for what was wrong."""

from __future__ import annotations

import json
import shlex
import subprocess
from pathlib import Path

import pytest

from r2s2r_cli.commands.whole import whole
from r2s2r_cli.errors import UsageError
from tests.commands.conftest import invoke


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("identify --set starts=2 --dry-run", "r2s2r identify --set identify.starts=2 --dry-run"),
        ("identify --set=identify.starts --dry-run", "r2s2r identify --set=identify.starts=3 --dry-run"),
        ("identify --set identify.starts=0 --dry-run", "r2s2r identify --set identify.starts=3 --dry-run"),
        ("identify --set identify.start=2 --seed 4 --dry-run",
         "r2s2r identify --seed 4 --set identify.starts=2 --dry-run"),
        ("identify --starts 0 --seed 4 --dry-run", "r2s2r identify --seed 4 --starts 3 --dry-run"),
        ("identify --set identify.zzz=0 --seed 4", "r2s2r identify --show-config"),
        ("estimate --set estimate.zzz=0 --quiet", "r2s2r estimate --show-config"),
        ("record --set record.color=gif --show-config", "r2s2r record --set record.color=jpeg --show-config"),
        ("export robot.toml --to mjcf --set contact.frction=0.5",
         "r2s2r export robot.toml --to mjcf --set contact.friction=0.5"),
        ("export robot.toml --to mjcf --set contact.friction=-1", "grep -n friction robot.toml"),
    ],
)  # fmt: skip
def test_a_wrong_override_is_answered_with_the_command(estimated: Path, typed: str, hint: str) -> None:
    """With the key that was meant, or a value that is allowed; where neither is known, with what lists the settings."""
    refused = invoke(*typed.split())
    assert refused.exit_code == 2 and refused.stderr.splitlines()[-1] == f"hint: {hint}", refused.stderr
    assert "  expected: " in refused.stderr and "  received: " in refused.stderr
    if hint.startswith("r2s2r"):
        assert invoke(*shlex.split(hint)[1:]).exit_code == 0


@pytest.mark.parametrize(
    ("right", "wrong", "mended"),
    [
        ('name = "new"', 'nmae = "new"', True),
        ("[diagnose]", "[diagnos]", True),
        ('name = "new"', "name = 3", False),
        ("schema_version = 1", "", False),
        ('name = "new"', "name = [", False),
    ],
)
def test_a_wrong_project_file_is_answered_with_a_command(estimated: Path, right: str, wrong: str, mended: bool) -> None:
    """That mends a misspelt key or table, and else shows the place."""
    file = estimated / "project.toml"
    text = file.read_text()
    assert right in text
    file.write_text(text.replace(right, wrong, 1))
    refused = invoke("status", "--json")
    error = json.loads(refused.stdout)
    assert refused.exit_code == 4 and error["expected"] and error["received"]
    done = subprocess.run(["bash", "-c", error["hint"]], capture_output=True, text=True, check=True)
    assert (invoke("status").exit_code == 0) == mended
    assert mended or (wrong in done.stdout and done.stdout)


def test_an_option_alone_becomes_the_command_line() -> None:
    """In the place of the one that was wrong, else behind the others; any other hint stays as it is."""

    def hint(said: str, *typed: str, received: str = "") -> str:
        return whole(UsageError("wrong", where="--x", received=received, hint=said), typed)

    assert hint("--depth-scale 0.001", "import", "a b", "--depth-scale", "1000") == (
        "r2s2r import 'a b' --depth-scale 0.001"
    )
    assert hint("--depth-scale 0.001", "import", "--depth-scale=9") == "r2s2r import --depth-scale=0.001"
    assert hint("--depth-scale 0.001   # L515", "import", "a") == "r2s2r import a --depth-scale 0.001   # L515"
    assert hint("--set a.b=1", "a", "--set", "a.c=2", "--set", "a.b=0") == "r2s2r a --set a.c=2 --set a.b=1"
    assert hint("--set a.bc=1", "a", "--set", "a.b=1", received="b") == "r2s2r a --set a.bc=1"
    assert (
        hint("--set a.b=1", "a", "--set", "a.b=2", "--set", "a.b", received="a.b") == "r2s2r a --set a.b=2 --set a.b=1"
    )
    for said in ("r2s2r status", "--one 1 or --two 2", "--open 'quote", "ls -la ."):
        assert hint(said, "import", "a") == said
