"""`--set` options that a hint prints: pasted, they mean what was meant."""

from __future__ import annotations

import shlex

import pytest

from r2s2r_cli.options import parse_override
from r2s2r_cli.store.toml_hints import override, override_text


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
