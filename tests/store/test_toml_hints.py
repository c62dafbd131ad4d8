"""`--set` options that a hint prints: pasted, they mean what was meant."""

from __future__ import annotations

import shlex
import subprocess
from pathlib import Path

import pytest

from r2s2r_cli.options import parse_override
from r2s2r_cli.store.toml_hints import override, override_text, shown


def _pasted(option: str) -> object:
    words = shlex.split(option)
    assert words[0] == "--set"
    assert len(words) == 2
    return parse_override(words[1], hint=lambda key: key)[1]


@pytest.mark.parametrize(
    "value",
    ["calm", "two words", "true", "0.5", "1e3", "[1]", "2026-01-01", '"', "it's", "a = 1\nb", "", True, 0.5, [1, "2"]],
)
def test_a_pasted_value_is_the_value(value: object) -> None:
    """Text that looks like a number, a truth value or a list stays text, whatever the shell strips."""
    assert _pasted(override("stage.key", value)) == value


def test_words_are_printed_bare() -> None:
    """Quotes only where they are needed."""
    assert override("stage.key", "calm") == "--set stage.key=calm"


def test_what_was_typed_is_pasted_as_typed() -> None:
    """A wrong key keeps its text: it was TOML already."""
    assert override_text("stage.key", "0.5") == "--set stage.key=0.5"
    assert _pasted(override_text("stage.key", '"0.5"')) == "0.5"


@pytest.mark.parametrize(("key", "lines"), [("p", ["3"]), ("rate_hz", ["4"]), ("gone", ["1", "2", "3", "4"])])
def test_the_line_of_a_key_is_shown(tmp_path: Path, key: str, lines: list[str]) -> None:
    """A key of one letter is shown where it is set, not in every line that has the letter; of one that is not there the
    whole file."""
    path = tmp_path / "robot's.toml"
    path.write_text("# pid: p is a gain\n[pid]\np = 65535\nrate_hz = 50  # per second\n")
    printed = subprocess.run(shown(str(path), key), shell=True, capture_output=True, text=True, check=True).stdout
    assert [line.replace(":", " ").split()[0] for line in printed.splitlines()] == lines
