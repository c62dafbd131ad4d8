"""The command that brings the first data into a project: a log that lies there, else a recording of the robot."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from r2s2r_cli.errors import quoted
from r2s2r_cli.reached import reached
from r2s2r_cli.store.from_here import project_option
from r2s2r_cli.store.log_folders import log_folders, some_files

if TYPE_CHECKING:
    from schemas.config import LinkSettings

_HEAD_BYTES = 1 << 12
_CAP = b"cap0_x_"
"""In the header of every trajectory that `import` reads, and of no bench measurement."""
RECORD = "r2s2r record --random 15 --repeats 3"


def first_data(root: Path, link: LinkSettings | None = None, *, options: str = "", here: Path | None = None) -> str:
    """What to type where a project (of this folder, its robot at `link`) has no data at all. options: of the command,
    of those that both have. here: the folder in which it is typed; default: the working one."""
    here = (here or Path.cwd()).resolve()
    logs = list(_logs(root.resolve(), here))
    more = f" {options}" if options else ""
    more += "".join(f" {quoted(word)}" for word in project_option(root, here))
    if not logs:
        return f"{RECORD}{more} {reached(link)}"
    others = f"   # or {' or '.join(logs[1:])}" if logs[1:] else ""
    return f"r2s2r import {logs[0]}{more}{others}"


def _logs(root: Path, here: Path) -> Iterator[str]:
    """Trajectories of the first folder that has some, as they are typed in `here`: the project's, `here`, and where
    else logs lie."""
    for folder in dict.fromkeys((root, here, *log_folders(root))):
        found = [path for path in some_files(folder, ".csv") if _is_log(path)]
        if found:
            yield from (quoted(os.path.relpath(path, here)) for path in found)
            return


def _is_log(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return _CAP in file.read(_HEAD_BYTES).partition(b"\n")[0]
    except OSError:
        return False
