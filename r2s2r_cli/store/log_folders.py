"""Folders in which the logs of a project lie, as far as a hint may look for them: few folders, and few files of each.

A hint must come at once, also where a project lies in a folder of a hundred thousand files.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from r2s2r_cli.store.header import peeked_header
from schemas.versions import KINDS

USUAL = ("data", "logs", "recordings")
"""Where people put logs beside what is made of them."""
MOST_FILES = 500
"""Entries of one folder that are looked at."""
MOST_RECORDINGS = 20
"""Recordings whose heads are asked where they came from, the latest first."""
SOURCES = ("file", "folder")
"""Kinds of inputs that are logs."""


def log_folders(root: Path) -> list[Path]:
    """The folders that are there: the project's, those that its recordings were imported from, and the usual ones."""
    named = [root, *_imported_from(root), *(root / name for name in USUAL)]
    return [folder for folder in dict.fromkeys(named) if folder.is_dir()]


def some_files(folder: Path, ending: str) -> list[Path]:
    """Files of that ending among the first `MOST_FILES` entries of a folder, sorted; none where it cannot be listed."""
    try:
        return sorted(path for path in islice(folder.iterdir(), MOST_FILES) if path.suffix == ending and path.is_file())
    except OSError:
        return []


def _imported_from(root: Path) -> list[Path]:
    """Folders above the logs of the recordings that can be read: their paths are kept relative to the project."""
    from r2s2r_cli.store.project import ITERATIONS

    recordings = sorted(root.glob(f"{ITERATIONS}/*/{KINDS['recording'].filename}"), reverse=True)
    found: list[Path] = []
    for path in recordings[:MOST_RECORDINGS]:
        header = peeked_header(path) if path.is_file() else None
        if header is not None and header.provenance.stage == "import":
            found += [(root / ref.path).parent for ref in header.provenance.inputs if ref.kind in SOURCES]
    return [folder.resolve() for folder in found]
