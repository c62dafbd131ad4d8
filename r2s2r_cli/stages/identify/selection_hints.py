"""A hint that mends all that is wrong with --train and --test, where one error after the other would each mend one."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence

from r2s2r_cli.errors import UsageError

TRAIN, TEST = "--train", "--test"
Sides = dict[str, list[str]]
"""The texts of both options."""


def mended(
    error: UsageError, train: Sequence[str], test: Sequence[str], again: Callable[[list[str], list[str]], object]
) -> UsageError:
    """The error, its hint followed until nothing is wrong any more: options of all texts that are others then.

    again: raises the next UsageError of these texts, if any. Where the hints lead nowhere the error is as it was.
    """
    typed: Sides = {TRAIN: list(train), TEST: list(test)}
    sides, following = typed, error
    for step in range(2 * (len(train) + len(test)) + 2):
        new = _options(following.hint)
        if new is None:
            return error
        sides = {option: _replaced(texts, new[option], following.received) for option, texts in sides.items()}
        try:
            again(sides[TRAIN], sides[TEST])
        except UsageError as other:
            following = other
        else:
            return error if step == 0 else _of_all(error, typed, sides)
    return error


def _of_all(error: UsageError, typed: Sides, sides: Sides) -> UsageError:
    """The error with the options that lead from `typed` to `sides`, and every name in `received` that has to go: the
    command is put together from these."""
    new = {option: [text for text in texts if text not in typed[option]] for option, texts in sides.items()}
    runs = {option: {run_of(text) for text in texts} for option, texts in new.items()}
    gone = [
        run_of(text) for option, texts in typed.items() for text in texts
        if text not in sides[option] and run_of(text) not in runs[option]
    ]  # fmt: skip
    error.hint = " ".join(worded(option, text) for option, texts in new.items() for text in texts)
    error.received = ", ".join(dict.fromkeys([error.received, *gone]))
    error.where = ", ".join(option for option in (TRAIN, TEST) if new[option])
    return error


def worded(option: str, text: str) -> str:
    """An option as it is pasted."""
    return f"{option} {shlex.quote(text)}"


def run_of(text: str) -> str:
    """The run that a text is about."""
    return text.partition(":")[0]


def _options(hint: str) -> Sides | None:
    """The texts of a hint; None where it is about something else."""
    words = shlex.split(hint)
    if len(words) % 2 or not {*words[::2]} <= {TRAIN, TEST}:
        return None
    pairs = [*zip(words[::2], words[1::2], strict=True)]
    return {option: [text for name, text in pairs if name == option] for option in (TRAIN, TEST)}


def _replaced(texts: Sequence[str], new: Sequence[str], received: str) -> list[str]:
    """Texts with new ones in the place of those of the same run, and of what was wrong."""
    if not new:
        return list(texts)
    runs = {run_of(text) for text in new}
    kept = [text for text in texts if run_of(text) not in {*runs, received} and text != received]
    return [*kept, *new]
