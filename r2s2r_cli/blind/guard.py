"""Proof that a verdict was found without the truth: a hook on every file that Python opens and every module it loads.

An audit hook cannot be taken off again (PEP 578), so whoever installs it is held to it until the process ends. What C
libraries open by themselves is not seen: the contracts of pyproject keep those that read files (h5py, mujoco) out.
"""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

FORBIDDEN_MODULES = ("r2s2r_cli.rig", "r2s2r_cli.blind.make", "r2s2r_cli.blind.labels", "r2s2r_cli.blind.score",
                     "mujoco", "cryptography")  # fmt: skip
_RUNS_OTHERS = ("subprocess.Popen", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "pty.spawn")
_LISTS = ("os.listdir", "os.scandir", "glob.glob")


class Peeked(RuntimeError):
    """Something that knows the truth was reached for while a set was diagnosed. Never caught: the run is worthless."""


@dataclass
class Guard:
    """What is watched. allowed: the set at work; all else of `bank` is closed. hidden: files and folders beside the
    bank that are closed (keys, worlds). opened: how many files were opened since the set began; refused: what was
    reached for and not given."""

    bank: Path
    hidden: tuple[Path, ...] = ()
    allowed: Path | None = None
    opened: int = 0
    refused: list[str] = field(default_factory=list)
    _at_work: bool = False

    def __post_init__(self) -> None:
        package = Path(__file__).resolve().parents[1]
        closed = (self.bank, package / "rig", package / "blind" / "make", package / "blind" / "score", *self.hidden)
        self._closed = tuple(os.path.realpath(one) for one in closed)

    def install(self) -> None:
        """From now on, to the end of the process."""
        sys.addaudithook(self._heard)

    def begin(self, folder: Path) -> None:
        """A set is diagnosed from now on: its own folder is open, nothing else of the bank."""
        self.allowed, self.opened, self._at_work = Path(os.path.realpath(folder)), 0, True

    def end(self) -> None:
        """Raises Peeked where anything was refused meanwhile, even if whoever asked swallowed the refusal."""
        self._at_work = False
        if self.refused:
            raise Peeked(f"reached for {self.refused[0]}")

    def _heard(self, event: str, args: tuple[Any, ...]) -> None:
        if not self._at_work:
            return
        if event == "open" and isinstance(args[0], str | bytes | os.PathLike):
            self.opened += 1
            self._path(os.fsdecode(args[0]))
        elif event in _LISTS and args and isinstance(args[0], str | bytes | os.PathLike):
            self._path(os.fsdecode(args[0]))
        elif event == "import" and str(args[0]).startswith(FORBIDDEN_MODULES):
            self._refuse(f"module {args[0]}")
        elif event in _RUNS_OTHERS:
            self._refuse(f"another process ({event})")

    def _path(self, path: str) -> None:
        real = os.path.realpath(path)
        if self.allowed is not None and _below(real, str(self.allowed)):
            return
        if any(_below(real, closed) for closed in self._closed) or _is_truth(real):
            self._refuse(real)

    def _refuse(self, what: str) -> None:
        self.refused.append(what)
        raise Peeked(f"reached for {what} while a set was diagnosed")


def _below(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder + os.sep)


def _is_truth(path: str) -> bool:
    name = Path(path).name
    return name.endswith((".sealed", ".key")) or (name.startswith("world") and name.endswith(".toml"))
