"""Where words go: data on stdout (one JSON document with --json), talk, progress and hints on stderr."""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from r2s2r_cli.errors import InputError, R2S2RError

if TYPE_CHECKING:
    from collections.abc import Callable

    from pydantic import BaseModel

NO_PROGRESS = "R2S2R_NO_PROGRESS"
PIPED_WIDTH = 160
"""Columns of a table that goes to a file or pipe."""


LINE_S = 30.0
"""Between two lines of progress that go to a file or pipe."""


class PipeClosed(Exception):
    """Whoever read our stdout went away (`| head`). Not an error."""


def out(text: str) -> None:
    """A line on stdout. Raises PipeClosed, or InputError where stdout takes no more (a full disk)."""
    try:
        print(text, flush=True)
    except BrokenPipeError as error:
        raise PipeClosed from error
    except OSError as error:
        raise InputError("stdout cannot be written", where="stdout", expected="room for the output",
                         received=error.strerror or str(error), hint="df -h .") from error  # fmt: skip


def tell(text: str) -> None:
    """A line on stderr. One that takes no more (a closed terminal, a full disk) is left out: work that is under way
    must not end of what is said about it, nor an error be lost for the want of somebody who hears it."""
    with suppress(OSError):
        print(text, file=sys.stderr)


class Console:
    """The two streams of one command. Colours follow the terminal and NO_COLOR; nothing is said by colour alone."""

    def __init__(self, *, json: bool = False, quiet: bool = False) -> None:
        self.json = json
        self.quiet = quiet

    def document(self, result: BaseModel) -> None:
        """The command's one JSON document, if --json was given."""
        if self.json:
            out(_as_json(result))

    def raw(self, text: str) -> None:
        """Text on stdout that is data in both forms."""
        out(text)

    def data(self, text: str) -> None:
        """A line of data for people; silent with --json."""
        if not self.json:
            out(text)

    def table(self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
        """A table of data for people; silent with --json."""
        if self.json:
            return
        from r2s2r_cli.views.tables import table_text

        body = [[str(cell) for cell in row] for row in rows]
        terminal = sys.stdout.isatty()
        width = shutil.get_terminal_size().columns if terminal else PIPED_WIDTH
        out("\n".join([f"\n{title}" if title else "", table_text(columns, body, width, terminal=terminal), ""]))

    def say(self, text: str) -> None:
        """A remark on stderr; silent with --quiet."""
        if not self.quiet:
            tell(text)

    def warn(self, text: str) -> None:
        """A warning on stderr, never silenced."""
        tell(f"warning: {text}")

    def hint(self, command: str) -> None:
        """What to run next; silent with --quiet."""
        self.say(f"hint: {command}")

    @contextmanager
    def progress(self, title: str, total: int) -> Iterator[Callable[[int], None]]:
        """A bar with rate and time left on stderr; yields a function that takes the number of items just done.

        Without a terminal a line now and then; silent with --quiet, or where R2S2R_NO_PROGRESS is set.
        """
        with self.parts(several=False) as show:
            done = 0

            def advance(more: int) -> None:
                nonlocal done
                done += more
                show(title, done, total, "")

            show(title, 0, total, "")
            yield advance

    @contextmanager
    def parts(self, *, several: bool = True) -> Iterator[Callable[[str, int, int, str], None]]:
        """The same for work of several parts: yields a function of part, items done and in all, and a word beside them.

        A part gets its bar when it is first named; parts that were done stay until all are. Where stderr is no terminal
        a line every LINE_S seconds says how far it is: a log of minutes without a word looks like one that hangs.
        several: more parts may follow, so that the time left is of this one.
        """
        if self.quiet or os.environ.get(NO_PROGRESS):
            yield lambda part, done, total, word: None
            return
        if not sys.stderr.isatty():
            yield _Lines(self.say, several=several).show
            return
        from rich.console import Console as RichConsole
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            ProgressColumn,
            Task,
            TaskID,
            TextColumn,
            TimeRemainingColumn,
        )
        from rich.text import Text

        class Rate(ProgressColumn):
            """Items a second, once there is a speed to tell."""

            def render(self, task: Task) -> Text:
                return Text("" if task.speed is None else f"{task.speed:.1f}/s")

        class Word(ProgressColumn):
            """What stands beside the bar; never read as markup."""

            def render(self, task: Task) -> Text:
                return Text(str(task.fields["word"]))

        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            Rate(),
            TimeRemainingColumn(),
            Word(),
        )
        with Progress(*columns, console=RichConsole(stderr=True), transient=True) as bar:
            tasks: dict[str, TaskID] = {}

            def show(part: str, done: int, total: int, word: str) -> None:
                if part not in tasks:
                    tasks[part] = bar.add_task(part, total=total, word=word)
                bar.update(tasks[part], completed=done, total=total, word=word)

            yield show


class _Lines:
    """Progress as lines, for files and pipes: none of work that is done within LINE_S."""

    def __init__(self, say: Callable[[str], None], *, several: bool) -> None:
        self.say = say
        self.whose = " of this part" if several else ""
        self.begun = self.last = time.monotonic()
        self.since: dict[str, tuple[float, int]] = {}
        """When a part was first named, and how far it was then: one that is resumed begins in its middle."""

    def show(self, part: str, done: int, total: int, word: str) -> None:
        """As the bar's: a part, items done and in all, and a word beside them."""
        now = time.monotonic()
        began, from_ = self.since.setdefault(part, (now, done))
        if now - self.last < LINE_S or done >= total:
            return
        self.last = now
        more = done - from_
        left = f", about {(now - began) * (total - done) / more:.0f} s left{self.whose}" if more > 0 else ""
        beside = f", {word}" if word else ""
        self.say(f"{part}: {done} of {total} after {now - self.begun:.0f} s{left}{beside}")


def _as_json(result: BaseModel) -> str:
    """The document as text. A name that is not UTF-8 holds half characters, which JSON has no form for: they become
    `\\udcff` and the like, as on the other stream."""
    from pydantic_core import PydanticSerializationError, to_json

    try:
        return result.model_dump_json(by_alias=True, indent=2)
    except PydanticSerializationError:
        return to_json(_whole_characters(result.model_dump(mode="json", by_alias=True)), indent=2).decode()


def _whole_characters(value: Any) -> Any:
    """The same, of dicts, lists and plain values, with every half character of its texts written out."""
    if isinstance(value, str):
        return value.encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, dict):
        return {_whole_characters(key): _whole_characters(item) for key, item in value.items()}
    return [_whole_characters(item) for item in value] if isinstance(value, list) else value


def print_error(error: R2S2RError, *, as_json: bool) -> None:
    """The error on stderr for people, and with --json as the document on stdout as well; a stream that takes no more
    is left out: what went wrong may be just that."""
    if as_json:
        from schemas.results import ErrorResult

        document = ErrorResult(
            exit_code=int(error.exit_code), what=error.what, where=error.where, expected=error.expected,
            received=error.received, hint=error.hint,
        )  # fmt: skip
        with suppress(PipeClosed, InputError):
            out(_as_json(document))
    tell("\n".join([f"error: {error.what}", *error.lines()[1:]]))
