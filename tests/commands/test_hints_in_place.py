"""A hint mends what was wrong in the command line as it was typed, and is not refused for the next thing."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import pytest

from r2s2r_cli.blind.labels import new_key, read_key, seal, unsealed
from r2s2r_cli.commands.whole import whole
from r2s2r_cli.errors import InputError, NumericalError
from tests.commands.conftest import invoke
from tests.guards.listing import ROOT

SAMPLE = ROOT / "examples" / "sample-project" / "project"


def _refused(folder: Path, monkeypatch: pytest.MonkeyPatch, typed: str) -> str:
    """What a command that is typed in a copy of the sample project says, being wrong."""
    monkeypatch.chdir(shutil.copytree(SAMPLE, folder / "project"))
    result = invoke(*typed.split())
    assert result.exit_code == 2
    return result.stderr


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("simulate --random abc", "simulate --random 15"),
        ("simulate --seed 2 --random=abc --no-draw", "simulate --seed 2 --random=15 --no-draw"),
        ("simulate --random 0 --no-draw --dry-run", "simulate --random 15 --no-draw --dry-run"),
        ("record --random 0 --repeats 2 --port p", "record --random 15 --repeats 2 --port p"),
        ("record --random 3 --repeats 0 --port p", "record --random 3 --repeats 1 --port p"),
        ("execute --repeats 0 --iteration 2 --port socket://x", "execute --repeats 1 --iteration 2 --port socket://x"),
        ("run --repeats 0 --port socket://x --yes --dry-run", "run --repeats 1 --port socket://x --yes --dry-run"),
        ("plan --to 1,1,0 --to 5,5 --seed 2", "plan --to 1,1,0 --to 0.5,1,90 --seed 2"),
    ],
)
def test_what_was_wrong_is_mended_where_it_stood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str, hint: str
) -> None:
    """All else stays."""
    assert _refused(tmp_path, monkeypatch, typed).endswith(f"hint: r2s2r {hint}\n")


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("record --policy straight --port p --dry-run", "record iterations/002/40-plan.h5:straight --port p --dry-run"),
        ("record --policy=policies/walk.toml --dry-run", "record policies/walk.toml --dry-run"),
        ("simulate --policy straight --dry-run", "simulate iterations/002/40-plan.h5:straight --dry-run"),
        ("execute --policies straight --dry-run", "execute straight --dry-run"),
        ("record --policy nosuch --dry-run", "record --help"),
    ],
)
def test_an_argument_typed_as_an_option_becomes_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str, hint: str
) -> None:
    """A policy of a plan with the plan where the command asks for it; of no policy nobody knows what was meant."""
    said = _refused(tmp_path, monkeypatch, typed)
    assert "policies without an option" in said
    assert said.endswith(f"hint: r2s2r {hint}\n")
    if hint.startswith("simulate"):
        assert invoke(*hint.split()).exit_code == 0


def test_of_several_the_one_that_is_named_as_the_place() -> None:
    """`--to 5,5,0` as where: not the first of that name."""
    error = NumericalError("no way", where="--to 5,5,0", received="nearest (1.00, 2.00) m", hint="--to 1.00,2.00,3")
    words = ["plan", "--to", "1,1,0", "--to", "5,5,0"]
    assert whole(error, words) == "r2s2r plan --to 1,1,0 --to 1.00,2.00,3"


def test_numbers_come_before_the_plan_that_needs_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a changed robot.toml: `plan` would refuse those that were identified with the one before."""
    monkeypatch.chdir(shutil.copytree(SAMPLE, tmp_path / "project"))
    robot = Path("robot.toml")
    robot.write_text(robot.read_text().replace("\nfriction = 0.76", "\nfriction = 0.61"))
    refused = invoke("execute", "--iteration", "1", "--dry-run")
    assert refused.exit_code == 4 and "contact.friction was 0.76, is 0.61" in refused.stderr
    assert refused.stderr.endswith("hint: r2s2r identify --iteration 1\n")
    assert invoke("plan", "--iteration", "1", "--dry-run").exit_code == 4
    Path("iterations/001/30-identify.h5").unlink()
    assert "hint: r2s2r plan --iteration 1\n" in invoke("execute", "--iteration", "1", "--dry-run").stderr


def test_a_key_is_looked_for_and_not_asked_for_by_another_command(tmp_path: Path) -> None:
    """One that is not there, and one that is another: `blind score` is not what was typed."""
    label, commitment = seal({"cause": "none"}, new_key(tmp_path / "one.key"))
    with pytest.raises(InputError) as missing:
        read_key(tmp_path / "none.key")
    with pytest.raises(InputError) as other:
        unsealed(label, new_key(tmp_path / "two.key"), commitment, where="there")
    for caught in (missing, other):
        assert shlex.split(caught.value.hint, comments=True) == ["find", ".", "-name", "*.key"]


def test_what_a_bank_is_opened_with_is_added_to_what_was_typed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both at once, and --out stays, without which the hint would be refused."""
    monkeypatch.chdir(tmp_path)
    for lacking, given in (("--verdicts verdicts --key labels.key", ""), ("--key labels.key", " --verdicts v")):
        words = f"blind calibrate bank --out c.json{given}"
        monkeypatch.setattr("sys.argv", ["r2s2r", *words.split()])
        refused = invoke(*words.split())
        assert refused.exit_code == 2 and refused.stderr.endswith(f"hint: r2s2r {words} {lacking}\n")
