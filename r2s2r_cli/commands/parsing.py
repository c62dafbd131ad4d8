"""What the option parser did not understand, in our form, with the command line mended where it is known how."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import R2S2RError, UsageError
from r2s2r_cli.nearest import nearest

_EXTRA = re.compile(r"Got unexpected extra arguments?\(?s?\)? \((?P<words>.*)\)")
_UNREADABLE = re.compile(r"[Pp]ath '(?P<path>.*)' is not readable")
_COMMAND = re.compile(r"No such command '(?P<name>.*?)'")


def usage_error(error: Any, arguments: Sequence[str]) -> R2S2RError:
    """Of an exception of the parser; ArtifactError for a file that may not be read, UsageError for all else. arguments:
    as typed after `r2s2r`; they stay in the hint but for what was wrong, where it is known what would have been right.
    """
    context = getattr(error, "ctx", None)
    path = context.command_path if context is not None else _path(arguments)
    message = error.format_message() if hasattr(error, "format_message") else str(error)
    command = None if context is None else context.command
    if closed := _UNREADABLE.search(message):
        from r2s2r_cli.store.header import unreadable

        return unreadable(Path(closed["path"]), PermissionError(errno.EACCES, os.strerror(errno.EACCES)))
    for reads, say in _KINDS:
        if reads(error, message):
            return _in_words(path, *say(error, message, command, list(arguments)))
    return _in_words(path, message.rstrip(".").strip(), "what the help says", shlex.join(arguments), None)


def _in_words(path: str, what: str, expected: str, received: str, mended: list[str] | None) -> UsageError:
    hint = f"{path} --help" if mended is None else shlex.join(["r2s2r", *mended])
    return UsageError(what, where=path, expected=expected, received=received or "nothing", hint=hint)


def _path(arguments: Sequence[str]) -> str:
    from r2s2r_cli.commands import COMMANDS, GROUPS

    return " ".join(["r2s2r", *(word for word in arguments[:1] if word in {**COMMANDS, **GROUPS})])


EXAMPLES = {"--random": "15"}
"""Values of options that cannot simply go where theirs is wrong: without them nothing is asked for."""
Said = tuple[str, str, str, "list[str] | None"]
"""What, expected, received, and the command line mended; None: nobody knows how."""


def _option(error: Any, message: str, command: Any, words: list[str]) -> Said:
    """There is no such option: the one that is spelt like it."""
    del message
    name = str(error.option_name)
    known = {one.lstrip("-"): one for param in command.params for one in (*param.opts, *param.secondary_opts)
             if one.startswith("--")}  # fmt: skip
    near = nearest(name.lstrip("-"), known)
    if not near:
        mended, expected = _as_argument(name, command, words)
        return "there is no such option", expected or " | ".join(known.values()), name, mended
    right = known[near]
    mended = [right + word[len(name) :] if word.partition("=")[0] == name else word for word in words]
    return "there is no such option", right, name, mended if mended != words else None


def _as_argument(name: str, command: Any, words: list[str]) -> tuple[list[str] | None, str]:
    """Of an option that is spelt like an argument (`--policy straight`): the command line with its value as that, where
    it is known to be one, and what is expected then."""
    arguments = [param.name for param in command.params if param.param_type_name == "argument"]
    near = nearest(name.lstrip("-"), arguments)
    at = next((i for i, word in enumerate(words) if word.partition("=")[0] == name), None)
    if not near or at is None:
        return None, ""
    given = _Given(at, words)
    value = given.value
    if near == "policies" and command.name != "execute":  # which knows those of its plan by their names alone
        value = value if Path(value).is_file() else _planned(value, words)
    expected = f"{near} without an option before them"
    if not value or value.startswith("-"):
        return None, expected
    return [*words[:at], value, *words[at + (1 if given.equals else 2) :]], expected


def _planned(name: str, words: Sequence[str]) -> str:
    """A policy of the latest plan that has one of this name, as it is typed; empty where there is none."""
    from r2s2r_cli.store.header import read_header
    from r2s2r_cli.store.project import Project

    typed = next((_Given(i, words).value for i, word in enumerate(words) if word.partition("=")[0] == "--project"), "")
    with contextlib.suppress(R2S2RError, OSError):
        for place in reversed(Project.find(Path(typed) if typed else None).iterations()):
            path = place.artifact("plan")
            if path.exists() and any(one.startswith(f"policies/{name}/") for one in read_header(path).datasets):
                return f"{os.path.relpath(path)}:{name}"
    return ""


def _command(error: Any, message: str, command: Any, words: list[str]) -> Said:
    """There is no such command: the one that is spelt like it."""
    del error
    name = _COMMAND.search(message)["name"]  # type: ignore[index]
    near = nearest(name, command.commands)
    mended = list(words)
    if near and name in words:
        mended[words.index(name)] = near
    return ("there is no such command", near or " | ".join(command.commands), name,
            mended if mended != words else None)  # fmt: skip


def _value(error: Any, message: str, command: Any, words: list[str]) -> Said:
    """A value that an option does not take: the choice that is spelt like it, or what holds without the option."""
    del message, command
    said, param = str(error.message), error.param
    choices = re.findall(r"'([^']*)'", said.partition("is not one of")[2])
    expected = " | ".join(choices) or said.removeprefix("Input should be ").partition(", unable")[0].rstrip(".")
    given = [_Given(i, words) for i, word in enumerate(words) if word.partition("=")[0] in param.opts]
    wrong = next((one for one in given if one.value not in choices and not one.value.isdecimal()), None)
    wrong = given[0] if wrong is None and len(given) == 1 else wrong
    if wrong is None:
        return f"this is no value of {param.name}", expected, said, None
    begun = [one for one in choices if wrong.value and one.startswith(wrong.value)]
    near = begun[0] if len(begun) == 1 else nearest(wrong.value, choices)
    usual = getattr(param.default, "value", param.default)
    usual = EXAMPLES.get(wrong.option) if usual is None else usual
    right = near or (None if usual is None or param.multiple else str(usual))
    mended = None if choices and not near else wrong.replaced(words, right)
    return f"this is no value of {wrong.option}", expected, wrong.value, mended


class _Given:
    """An option as typed, its value behind `=` or in the next word."""

    def __init__(self, at: int, words: Sequence[str]) -> None:
        self.at = at
        self.option, self.equals, behind = words[at].partition("=")
        self.value = behind if self.equals else "".join(words[at + 1 : at + 2])

    def replaced(self, words: Sequence[str], value: str | None) -> list[str]:
        """The words with another value, or without the option."""
        new = [] if value is None else [f"{self.option}={value}"] if self.equals else [self.option, value]
        return [*words[: self.at], *new, *words[self.at + (1 if self.equals else 2) :]]


def _bad_use(error: Any, message: str, command: Any, words: list[str]) -> Said:
    """An option without its value goes; a flag loses the value that it does not take."""
    del command
    name, takes = str(error.option_name), "requires" in message
    mended = [word.partition("=")[0] if word.startswith(f"{name}=") else word for word in words]
    mended = [word for word in mended if not (takes and word == name)]
    received = next((word.partition("=")[2] for word in words if word.startswith(f"{name}=")), "")
    expected = f"{name} and a value" if takes else f"{name} without a value"
    return message.rstrip("."), expected, received, mended


def _extra(error: Any, message: str, command: Any, words: list[str]) -> Said:
    """More arguments than the command takes: without them."""
    del error, command
    extra = _EXTRA.search(message)["words"].split()  # type: ignore[index]
    mended = list(reversed(words))
    for word in reversed(extra):
        if word not in mended:
            return "there are too many arguments", "fewer arguments", " ".join(extra), None
        mended.remove(word)
    return "there are too many arguments", "fewer arguments", " ".join(extra), mended[::-1]


def _missing(error: Any, message: str, command: Any, words: list[str]) -> Said:
    del words, command
    param = error.param
    return message.rstrip("."), f"a value for {param.name}" if param else "an argument", "nothing", None


def _subcommand(error: Any, message: str, command: Any, words: list[str]) -> Said:
    """A group without its subcommand: the parser's message is the whole help."""
    del error, message, words
    return "a subcommand is missing", " | ".join(getattr(command, "commands", ())) or "a subcommand", "nothing", None


_KINDS: tuple[tuple[Callable[[Any, str], bool], Callable[[Any, str, Any, list[str]], Said]], ...] = (
    (lambda error, said: hasattr(error, "possibilities") and error.ctx is not None, _option),
    (lambda error, said: _COMMAND.search(said) is not None, _command),
    (lambda error, said: said.startswith("Missing"), _missing),
    (lambda error, said: getattr(error, "param", None) is not None, _value),
    (lambda error, said: hasattr(error, "option_name"), _bad_use),
    (lambda error, said: _EXTRA.search(said) is not None, _extra),
    (lambda error, said: said.startswith("Usage:"), _subcommand),
)
"""How an exception of the parser is known, and what is said of it; the first that fits."""
