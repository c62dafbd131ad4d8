"""Every check complains in exactly these words, and only where it must."""

from __future__ import annotations

import functools
import re
import shlex
from collections.abc import Callable
from typing import Any

import pytest
from typer.main import get_command

from r2s2r_cli.app import app
from r2s2r_cli.checks import CHECKS, FAMILIES
from r2s2r_cli.checks.base import AGAIN, IMPORTANCES, Check
from tests.checks.case import Case, Edge
from tests.checks.cases import EDGES, FAILS
from tests.support.check_subjects import SOUND

COMMANDS = ("r2s2r", "mv", "ls", "git", "pip")
BY_NAME = {entry.name: entry for entry in CHECKS}


@pytest.mark.parametrize("entry", CHECKS, ids=lambda entry: entry.name)
def test_every_check_is_seen_to_fail(entry: Check) -> None:
    """The list of failing subjects has one for every check."""
    assert [case for case in FAILS if case.check == entry.name] != []


@pytest.mark.parametrize("case", FAILS, ids=lambda case: case.check)
def test_a_wrong_subject_fails_with_exactly_this_message(case: Case) -> None:
    """Location, sentence, expected and received are those of the list, no more and no fewer findings."""
    entry, subject = BY_NAME[case.check], case.subject()
    assert entry.looks_at(subject)
    found = entry.run(subject, "a.h5")
    assert tuple((f.location, f.what, f.expected, f.received) for f in found) == case.found
    assert {(f.check, f.importance, f.file) for f in found} == {(entry.name, entry.importance, "a.h5")}
    assert all(f.hint and "{" not in f.hint.replace(AGAIN, "") for f in found)


@pytest.mark.parametrize("edge", EDGES, ids=lambda edge: f"{edge.check}: {edge.why}")
def test_a_subject_at_the_edge_passes(edge: Edge) -> None:
    """What is still right, or for another check to say, is not complained about."""
    entry, subject = BY_NAME[edge.check], edge.subject()
    assert entry.looks_at(subject)
    assert entry.run(subject, "a.h5") == []


@pytest.mark.parametrize("sound", SOUND.values(), ids=SOUND.keys())
def test_a_sound_subject_passes(sound: Callable[[], object]) -> None:
    """A subject that has every stream, and nothing wrong with it, passes every check."""
    looking = 0
    for entry in CHECKS:
        subject = sound()
        if entry.looks_at(subject):
            looking += 1
            assert entry.run(subject, "a.h5") == [], entry.name
    assert looking


@pytest.mark.parametrize("entry", CHECKS, ids=lambda entry: entry.name)
def test_every_check_looks_at_a_sound_subject(entry: Check) -> None:
    """No check is idle: one of the sound subjects is of its sort."""
    assert any(entry.looks_at(sound()) for sound in SOUND.values())


def test_names_are_unique_and_families_known() -> None:
    """Names can be selected, families have a heading, importances are the three."""
    assert len(BY_NAME) == len(CHECKS)
    assert {entry.family for entry in CHECKS} == set(FAMILIES)
    assert {entry.importance for entry in CHECKS} == set(IMPORTANCES)


@pytest.mark.parametrize("entry", CHECKS, ids=lambda entry: entry.name)
def test_every_check_says_what_why_and_how_to_fix(entry: Check) -> None:
    """The facts of the page are there, as sentences without capital and full stop; the function has a docstring."""
    for text in (entry.what, entry.why, entry.fix):
        assert len(text) > 5 and not text.endswith(".")
    assert (entry.function.__doc__ or "").strip()


@functools.cache
def command_line() -> Any:
    """All commands, built once."""
    return get_command(app)


@pytest.mark.parametrize("entry", CHECKS, ids=lambda entry: entry.name)
def test_a_fix_is_a_line_to_paste_or_names_no_command(entry: Check) -> None:
    """A command stands first, and its remark behind it as a shell skips it; words alone hold none, half of which
    would be pasted."""
    said = entry.fix.replace(AGAIN, "r2s2r estimate --force")
    if said.split()[0] not in COMMANDS:
        assert not re.search(rf"\b({'|'.join(COMMANDS)}) |run the stage|make the artifact", said)
        return
    words = shlex.split(said, comments=True)
    assert said.partition("   # ")[0].split() == words
    if words[0] == "r2s2r":
        command = command_line().commands[words[1]]
        command.make_context(words[1], [word for word in words[2:] if word != "--help"])


def test_what_a_picture_shows_is_drawn() -> None:
    """The three fixes of states that a camera saw: each draws its pictures."""
    names = ("caps_well_observed", "noise_as_assumed", "seldom_lost")
    assert {BY_NAME[name].fix.partition(":")[0] for name in names} == {f"{AGAIN}   # draws the pictures beside it"}
