"""Work that survives an interruption: JSON values in a file beside the artifact that they will become."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.store.atomic import PARTIAL, write_text
from r2s2r_cli.store.canonical import json_sha256
from r2s2r_cli.store.project import iteration_number

_FORM = 1


@dataclass(frozen=True)
class CheckpointFile:
    """The checkpoint of one artifact. key: digest of the inputs and settings that its values belong to. command: the
    words that were typed after `r2s2r`, without --resume."""

    path: Path
    key: str
    resume: bool = False
    command: Sequence[str] = ("status",)

    def load(self) -> dict[str, Any] | None:
        """The saved values; None where there are none, or where they are not wanted.

        Raises InputError where the file cannot be read, UsageError where it belongs to another request.
        """
        if not self.resume or not self.path.exists():
            return None
        try:
            kept = json.loads(self.path.read_text("utf-8"))
            form, key, values = kept["form"], kept["key"], dict(kept["values"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise unreadable(self.path, self.command, error) from error
        if (form, key) != (_FORM, self.key):
            raise of_another(self.path, self.command)
        return values

    def require_own(self) -> None:
        """Raises what `load` raises."""
        self.load()

    def kept(self) -> bool:
        """Whether work of this very request lies there, with which --resume goes on."""
        try:
            return bool(json.loads(self.path.read_text("utf-8"))["key"] == self.key)
        except (OSError, ValueError, KeyError, TypeError):
            return False

    def save(self, values: Mapping[str, Any]) -> None:
        """Replace what was saved, whole or not at all; floats come back bit by bit. Raises ArtifactError."""
        write_text(
            self.path,
            json.dumps({"form": _FORM, "key": self.key, "command": list(self.command), "values": dict(values)}),
        )

    def clear(self) -> None:
        """Remove it, and one that failed: the artifact stands."""
        discard(self.path)


def discard(checkpoint: Path) -> None:
    """Remove a checkpoint of either kind, and one that failed."""
    checkpoint.unlink(missing_ok=True)
    failed_of(checkpoint).unlink(missing_ok=True)


def unreadable(checkpoint: Path, command: Sequence[str], error: Exception) -> InputError:
    """For a checkpoint of either kind that is no checkpoint, or of another form."""
    received = f"a file that cannot be opened: {error}" if isinstance(error, OSError) else "a damaged one"
    return InputError("the checkpoint cannot be read", where=str(checkpoint), received=received,
                      expected="what an interrupted command left", hint=begin_anew(command))  # fmt: skip


class OtherRequest(UsageError):
    """A checkpoint of another command line, whose hint is that line: options of this one have no place in it."""


def of_another(checkpoint: Path, command: Sequence[str]) -> UsageError:
    """For a checkpoint of either kind whose key is not that of this request: with the command that it belongs to, and
    behind it the one that begins anew; that alone where both are the same, because inputs or settings changed since."""
    what, where = "the checkpoint belongs to another request", str(checkpoint)
    typed = command_of(checkpoint)
    if typed is None or typed[:1] != tuple(command[:1]) or _request(typed) == _request(command):
        return UsageError(what, where=where, expected="the inputs, settings and options that it was made with",
                          received="others" if typed is None else "the same command, with other inputs or settings",
                          hint=begin_anew(command))  # fmt: skip
    number = iteration_number(checkpoint.resolve().parent)
    place = [] if number is None else ["--iteration", str(number)]
    project = [word for option in _options(command) if option[0] == "--project" for word in option]
    words = [word for option in _options(typed) if option[0] not in _MANNER for word in option]
    go_on, anew = shlex.join(["r2s2r", *words, *place, *project, "--resume"]), begin_anew(command)
    return OtherRequest(what, where=where, expected=begin_anew(typed), received=anew,
                        hint=f"{go_on}   # or, dropping it: {anew}")  # fmt: skip


_MANNER = ("--resume", "--json", "--quiet", "--force", "--dry-run", "--iteration", "--project")
"""Options that do not decide what is computed, or that the place of the checkpoint decides."""


def _request(words: Sequence[str]) -> list[tuple[str, ...]]:
    """What of a command line decides what is computed."""
    return sorted(option for option in _options(words) if option[0] not in (*_MANNER, "--draw", "--no-draw"))


def _options(words: Sequence[str]) -> list[tuple[str, ...]]:
    """The words of each option, its value with it, `--name=value` as two; other words each by itself."""
    split = [part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])]
    found: list[tuple[str, ...]] = []
    for word in split:
        if found and not word.startswith("--") and found[-1][0].startswith("--") and len(found[-1]) == 1:
            found[-1] = (*found[-1], word)
        else:
            found.append((word,))
    return found


def begin_anew(command: Sequence[str]) -> str:
    """The hint where a checkpoint is of no use: the command line that takes none up."""
    return shlex.join(["r2s2r", *(word for word in command if word != "--resume")])


def head_of(checkpoint: Path) -> dict[str, Any] | None:
    """What the first line of a checkpoint of either kind says; None where it is damaged."""
    try:
        with checkpoint.open("rb") as file:
            found = json.loads(file.readline())
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and "key" in found else None


def command_of(checkpoint: Path) -> tuple[str, ...] | None:
    """The words that were typed after `r2s2r` for the work that lies there, of either kind of checkpoint; None where it
    does not say."""
    return command_in(head_of(checkpoint))


def command_in(head: Mapping[str, Any] | None) -> tuple[str, ...] | None:
    """The same of a head."""
    words = (head or {}).get("command")
    return tuple(str(word) for word in words) if isinstance(words, list) else None


def checkpoint_of(artifact: Path) -> Path:
    """Where the checkpoint of an artifact lies: it never has an artifact's name."""
    return artifact.with_suffix(PARTIAL)


def failed_of(checkpoint: Path) -> Path:
    """Where a checkpoint is kept that ended in a bug: nothing goes on from it by itself."""
    return checkpoint.with_name(f"{checkpoint.name}.failed")


def checkpoint_key(*parts: Any) -> str:
    """Digest of what must be the same for saved work to be of use."""
    return json_sha256(list(parts))
