"""The README is short, and what it tells people to type exists."""

from __future__ import annotations

import re
import shlex

from tests.guards.listing import ROOT, commands, inline_code, shell_lines

TEXT = (ROOT / "README.md").read_text()


def test_readme_is_short() -> None:
    """The README has fewer than 150 lines."""
    assert len(TEXT.splitlines()) < 150


def test_readme_mentions_every_command() -> None:
    """Every registered command stands in the README, as code."""
    code = " ".join([*shell_lines(TEXT), *inline_code(TEXT)])
    assert [command for command in commands() if not re.search(rf"\b{command}\b", code)] == []


def test_readme_names_only_commands_that_exist() -> None:
    """Every `r2s2r` line of the README's code blocks is a registered command, with options that it has."""
    lines = [shlex.split(line) for line in shell_lines(TEXT) if line.startswith("r2s2r ")]
    assert lines, "the README shows no r2s2r command"
    for words in lines:
        command = next((name for name in (" ".join(words[1:3]), words[1]) if name in commands()), None)
        assert command is not None, words
        known = {text for parameter in commands()[command].params for text in parameter.opts}
        used = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert used <= known | {"--help"}, words


def test_readme_names_only_make_targets_that_exist() -> None:
    """Every `make` target that the README names is one of the Makefile's, and the two main ones are named."""
    code = [*shell_lines(TEXT), *inline_code(TEXT)]
    named = {match for line in code for match in re.findall(r"^make ([a-z-]+)", line)}
    goals = re.search(r"^GOALS := (.*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    assert goals is not None
    assert {"demo", "test"} <= named <= set(goals.group(1).split())
