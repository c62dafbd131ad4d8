"""Whether a command that is typed in a folder finds a project by itself, and what it needs where it does not."""

from __future__ import annotations

import os
from pathlib import Path


def project_option(root: Path, here: Path | None = None) -> list[str]:
    """`--project` with the way to the folder `root`, as words of a command typed in `here` (default: the working
    directory); no word inside of the project, where it is found."""
    root, here = root.resolve(), (here or Path.cwd()).resolve()
    return [] if here.is_relative_to(root) else ["--project", os.path.relpath(root, here)]
