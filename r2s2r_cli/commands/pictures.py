"""Pictures and pages beside an artifact: they go when it is replaced, so that none shows another one."""

from __future__ import annotations

import glob
from collections.abc import Iterator
from pathlib import Path

from r2s2r_cli.errors import R2S2RError
from r2s2r_cli.store.header import read_header


def remove_pictures(artifact: Path) -> None:
    """Remove what was drawn of the artifact at this place: what its head names, or, where that cannot be read, what is
    called after it."""
    for path in list(_drawn(artifact)):
        path.unlink(missing_ok=True)


def _drawn(artifact: Path) -> Iterator[Path]:
    try:
        names = read_header(artifact).provenance.drawings
    except R2S2RError:
        stem = glob.escape(artifact.stem)
        for pattern in (f"{stem}.html", f"{stem}.png", f"{stem}-*.png"):
            yield from artifact.parent.glob(pattern)
        return
    yield from (artifact.with_name(Path(name).name) for name in names)
