"""Checkpoints: what comes back is what was left, or it is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from r2s2r_cli.commands.identify_hints import completed
from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.store.checkpoint import CheckpointFile, checkpoint_key, checkpoint_of

VALUES = {"z": [0.1, 1 / 3, -math.pi, 5e-324], "stage": 2, "reason": None, "words": "größer"}


def test_values_come_back_bit_by_bit(tmp_path: Path) -> None:
    """Floats, text and None; nothing else is left in the folder, and it never has an artifact's name."""
    path = checkpoint_of(tmp_path / "30-identify.h5")
    CheckpointFile(path, "a").save({"old": True})
    CheckpointFile(path, "a").save(VALUES)
    assert [p.name for p in tmp_path.iterdir()] == ["30-identify.partial"]
    assert CheckpointFile(path, "a", resume=True).load() == VALUES


def test_without_resume_or_without_a_file_there_is_nothing(tmp_path: Path) -> None:
    """A checkpoint is taken up only where that is asked for."""
    path = tmp_path / "x.partial"
    assert CheckpointFile(path, "a", resume=True).load() is None
    CheckpointFile(path, "a").save(VALUES)
    assert CheckpointFile(path, "a").load() is None


def test_another_request_is_refused(tmp_path: Path) -> None:
    """Work of other inputs or settings is never gone on with."""
    path = tmp_path / "x.partial"
    CheckpointFile(path, checkpoint_key({"starts": 3}, ["sha"])).save(VALUES)
    with pytest.raises(UsageError, match="another request") as another:
        CheckpointFile(path, checkpoint_key({"starts": 4}, ["sha"]), resume=True).load()
    assert another.value.hint == "r2s2r status"
    assert CheckpointFile(path, checkpoint_key({"starts": 3}, ["sha"]), resume=True).load() == VALUES


def test_the_command_of_another_request_is_named(tmp_path: Path) -> None:
    """Its own line goes on with it, in its iteration and from this directory; of the same line inputs or settings have
    changed, and only a new beginning is left."""
    path = tmp_path / "001" / "x.partial"
    path.parent.mkdir()
    CheckpointFile(path, "a", command=["diagnose", "--also", "2", "--json", "--force"]).save(VALUES)

    def refused(*words: str) -> UsageError:
        with pytest.raises(UsageError, match="another request") as caught:
            CheckpointFile(path, "b", True, words).load()
        return caught.value

    other = refused("diagnose", "--project", "here", "--seed=9", "--resume")
    on, anew = other.hint.split("   # or, dropping it: ")
    assert on == "r2s2r diagnose --also 2 --iteration 1 --project here --resume"
    assert anew == other.received
    assert other.expected == "r2s2r diagnose --also 2 --json --force"
    assert other.received == "r2s2r diagnose --project here --seed=9"
    assert completed(other, ["--seed", "9", "--resume"], "r2s2r diagnose") == other.hint
    same = refused("diagnose", "--iteration", "1", "--also=2", "--no-draw", "--resume")
    assert "other inputs or settings" in same.received and same.hint.endswith("--also=2 --no-draw")


@pytest.mark.parametrize("content", ["", "[]", '{"form": 1}', '{"form": 1, "key": "a", "values": 3}', "\x00"])
def test_a_broken_file_is_said(tmp_path: Path, content: str) -> None:
    """Exit code 4 with the way out."""
    path = tmp_path / "x.partial"
    path.write_text(content)
    with pytest.raises(InputError) as caught:
        CheckpointFile(path, "a", True, ["plan", "--seed", "3", "--resume"]).load()
    assert caught.value.hint == "r2s2r plan --seed 3"


def test_clear_removes_it(tmp_path: Path) -> None:
    """Once the artifact stands nothing is left to resume; twice is no error."""
    file = CheckpointFile(tmp_path / "x.partial", "a")
    file.save(VALUES)
    file.clear()
    file.clear()
    assert not list(tmp_path.iterdir())
