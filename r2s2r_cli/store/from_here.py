"""Whether a command that is typed in a folder finds a project by itself, and what it needs where it does not."""

from __future__ import annotations

import os
import shlex
from pathlib import Path


def project_option(root: Path, here: Path | None = None) -> list[str]:
    """`--project` with the way to the folder `root`, as words of a command typed in `here` (default: the working
    directory); no word inside of the project, where it is found."""
    root, here = root.resolve(), (here or Path.cwd()).resolve()
    return [] if here.is_relative_to(root) else ["--project", os.path.relpath(root, here)]


def typed_here(command: str, root: Path, here: Path | None = None) -> str:
    """A command of r2s2r that would be typed in the project's directory `root`, as it is typed in `here`: files keep
    their place, and the project is named where it would not be found. Others, and nothing, stay as they are."""
    said, gap, remark = command.partition("   #")
    here = (here or Path.cwd()).resolve()
    if not said.startswith("r2s2r ") or here == root.resolve():
        return command
    words = shlex.split(said)
    files = [word != "r2s2r" and not word.startswith("-") and (root / word).exists() for word in words]
    placed = [
        os.path.relpath(root.resolve() / word, here) if file else word for word, file in zip(words, files, strict=True)
    ]
    # `recover` and its like find the project of the file that they are given.
    option = [] if "--project" in words or (len(words) == 3 and files[2]) else project_option(root, here)
    return shlex.join([*placed, *option]) + gap + remark
