"""Write the golden artifacts: `python -m tests.support.make_golden`. Only for a kind or version that has none yet.

A golden file, once committed, is never written again: it stands for what users have on their disks.
"""

from __future__ import annotations

from pathlib import Path

from r2s2r_cli.store.write import write_artifact
from schemas.header import Header
from schemas.versions import KINDS
from tests.support.builders import BUILDERS, provenance

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


def golden_path(kind: str, version: int, folder: Path = GOLDEN) -> Path:
    """Where the golden artifact of one kind and version lies."""
    return folder / f"{kind}-{version}.h5"


def make(kind: str, path: Path) -> Header:
    """Write the golden artifact of a kind in its present version to `path`."""
    return write_artifact(path, BUILDERS[kind](), provenance())


def main() -> None:
    """Write what is missing."""
    for kind, spec in KINDS.items():
        path = golden_path(kind, spec.version)
        if not path.exists():
            make(kind, path)


if __name__ == "__main__":
    main()
