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
    return InputError("the checkpoint cannot be read", where=str(checkpoint), received=type(error).__name__,
                      expected="what an interrupted command left", hint=begin_anew(command))  # fmt: skip


def of_another(checkpoint: Path, command: Sequence[str]) -> UsageError:
    """For a checkpoint of either kind whose key is not that of this request."""
    return UsageError("the checkpoint belongs to another request", where=str(checkpoint),
                      expected="the inputs, settings and options that it was made with", received="others",
                      hint=begin_anew(command))  # fmt: skip


def begin_anew(command: Sequence[str]) -> str:
    """The hint where a checkpoint is of no use: the command line that takes none up."""
    return shlex.join(["r2s2r", *(word for word in command if word != "--resume")])


def command_of(checkpoint: Path) -> tuple[str, ...] | None:
    """The words that were typed after `r2s2r` for the work that lies there, of either kind of checkpoint; None where it
    does not say."""
    try:
        with checkpoint.open("rb") as file:
            return tuple(str(word) for word in json.loads(file.readline())["command"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def checkpoint_of(artifact: Path) -> Path:
    """Where the checkpoint of an artifact lies: it never has an artifact's name."""
    return artifact.with_suffix(PARTIAL)


def failed_of(checkpoint: Path) -> Path:
    """Where a checkpoint is kept that ended in a bug: nothing goes on from it by itself."""
    return checkpoint.with_name(f"{checkpoint.name}.failed")


def checkpoint_key(*parts: Any) -> str:
    """Digest of what must be the same for saved work to be of use."""
    return json_sha256(list(parts))
