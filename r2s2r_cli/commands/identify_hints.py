"""Hints as whole commands: what was asked for stays, what was wrong goes, files have their path."""

from __future__ import annotations

import fnmatch
import os
import re
import shlex
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import R2S2RError, UsageError
from r2s2r_cli.nearest import nearest_choice
from r2s2r_cli.store.atomic import PARTIAL
from r2s2r_cli.store.checkpoint import OtherRequest
from r2s2r_cli.store.header import CutOff, NotAnArtifact

if TYPE_CHECKING:
    from r2s2r_cli.commands.identify_inputs import Asked

FLAGS = (
    "--online",
    "--no-discrepancy",
    "--self-test",
    "--resume",
    "--json",
    "--quiet",
    "--no-draw",
    "--dry-run",
    "--force",
    "--draw",
    "--sample",
)
"""Options without a value."""
SINGLE = ("--method", "--drive", "--seed", "--starts", "--iteration", "--project", "--model")
"""Options that are given once."""
_MANNER = ("--json", "--quiet", "--force", "--dry-run")
"""How the command goes about it: behind what it is about."""
_COMMAND = "r2s2r identify"
Option = tuple[str, str | None]


@contextmanager
def whole_hints(
    typed: Sequence[str], artifacts: Callable[[], Sequence[Path]], command: str = _COMMAND
) -> Iterator[None]:
    """An error on the way leaves with a hint that can be pasted. typed: options as given; artifacts: what is read;
    command: whose options they are."""
    try:
        yield
    except R2S2RError as error:
        error.hint = completed(error, typed, command)
        with suppress(R2S2RError):
            error.hint = located(error.hint, artifacts())
        raise


def typed_options(**given: object) -> list[str]:
    """Options as words, of the values that the command received by name; what is not given or false is left out."""
    words: list[str] = []
    for name, value in given.items():
        option = f"--{name.strip('_').replace('_', '-')}"
        if value is True:
            words.append(option)
        elif value is not None and value is not False:
            words += [word for one in (value if isinstance(value, list) else [value]) for word in (option, str(one))]
    return words


def completed(error: R2S2RError, typed: Sequence[str], command: str = _COMMAND) -> str:
    """The hint with the other options of the command line, where it is about options of `command`.

    An option of the hint takes the place of the one that was wrong: of the same name, run or parameter, of the value
    that the error received, or of a choice that the error names as its place. A parameter that it fixes is not free. A
    value that was received and has nothing in its place goes.
    """
    said, gap, remark = error.hint.partition("   #")
    if isinstance(error, NotAnArtifact | CutOff | OtherRequest) or said.endswith(" --show-config"):
        return error.hint  # about another artifact, maybe of the same stage, or about none
    if said.startswith(command):
        said = said[len(command) :]
    elif not said.startswith("--"):
        return error.hint
    new, old = options_of(shlex.split(said)), options_of(typed)
    new = [_as_typed(one, [other for other in old if _replaces(one, other, error)], error) for one in new]
    kept = [one for one in old if not any(_replaces(other, one, error) for other in new) and not _wrong(one, error)]
    last = [one for one in (*kept, *new) if one[0] in _MANNER]
    words = [word for one in (*kept, *new) if one not in last for word in _words(one)]
    words += [word for one in last for word in _words(one)]
    return f"{command} {shlex.join(words)}".rstrip() + gap + remark


def _wrong(old: Option, error: R2S2RError) -> bool:
    """Whether an option is what the error is about: by its name or its value, or --resume where the checkpoint is."""
    name, value = old
    if name == "--resume" and error.where.endswith(PARTIAL):
        return True
    places = error.where.replace(",", " ").split()
    return name in places and (name in (*SINGLE, *FLAGS) or value == error.received)


def _words(option: Option) -> Sequence[str]:
    return [word for word in option if word is not None]


def options_of(words: Sequence[str]) -> list[Option]:
    """(name, value) of each option, None for the value of a flag; `--name=value` as well."""
    found: list[Option] = []
    rest = list(words)
    while rest:
        name, equals, value = rest.pop(0).partition("=")
        if not name.startswith("--"):
            continue
        if equals:
            found.append((name, value))
        else:
            found.append((name, rest.pop(0) if rest and name not in FLAGS else None))
    return found


def located(hint: str, artifacts: Sequence[Path]) -> str:
    """The hint with the way from here to each artifact that it calls by its bare name; the first of that name."""
    for path in artifacts:
        here = shlex.quote(os.path.relpath(path))
        hint = re.sub(rf"(?<![\w/.-]){re.escape(path.name)}\b", lambda _, here=here: here, hint)  # type: ignore[misc]
    return hint


def _replaces(new: Option, old: Option, error: R2S2RError) -> bool:
    name, value = old
    if new[0] == "--fix" and name == "--free":
        return _about(new[1]) == _about(value)
    if new[0] != name:
        return False
    if name in SINGLE or name in FLAGS:
        return True
    if name == "--set" and _about(value).rpartition(".")[2] == error.received:
        return True
    received = error.received.split(", ")
    if "*" in _about(value) and fnmatch.filter(received, _about(value)):
        return True
    return _about(new[1]) == _about(value) or (value or "nothing") == error.received or _about(value) in received


def _as_typed(new: Option, replaced: Sequence[Option], error: R2S2RError) -> Option:
    """With the plus of --free +SPEC, where what it replaces had one; and where a name alone was wrong, with the numbers
    that stood behind it."""
    name, value = new
    if value is None or name in ("--train", "--test"):  # their hints have the numbers already, maybe others
        return new
    for _, text in replaced:
        wrong = _about(text)
        if text and wrong == error.received and wrong != _about(value):
            value = _about(value) + text.removeprefix("+")[len(wrong) :]
    plus = name == "--free" and any((text or "").startswith("+") for _, text in replaced)
    return (name, f"+{value}") if plus and not value.startswith("+") else (name, value)


def _about(value: str | None) -> str:
    """The run, parameter or setting that a value is about."""
    return re.split("[:=,]", (value or "").removeprefix("+"), maxsplit=1)[0]


def require_one_of(value: str, known: tuple[str, ...], option: str) -> None:
    """Raises UsageError for a choice that an option does not have."""
    if value not in known:
        raise UsageError("there is no such choice", where=option, expected=" | ".join(known), received=value,
                         hint=f"r2s2r identify {option} {nearest_choice(value, known)}")  # fmt: skip


def require_starts(asked: Asked, overrides: dict[str, Any]) -> None:
    """Raises UsageError for a number of --starts that the setting does not allow, with a hint of that option."""
    try:
        asked.project.config(asked.iteration, overrides)
    except UsageError as error:
        error.where = "--starts"
        error.hint = error.hint.replace("--set identify.starts=", "--starts ")
        raise
