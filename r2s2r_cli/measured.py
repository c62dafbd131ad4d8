"""Which stages measure, and what is said, of them and of others, where an input has become another since."""

from __future__ import annotations

MEASURED = ("record", "execute")
"""Stages whose artifacts are measurements: to make one again a robot must move."""
STAYS = "what the robot did stays what it did"
CONTENT = "its content hash is another"
BYTES = "its bytes are others"


def changed(path: str, stage: str, how: str) -> str:
    """Of an input at `path` that is another now. stage: that made the artifact; how: that it is seen by. Nothing is
    wrong with what was measured: it is of an older plan."""
    return f"recorded under an older {path}: {STAYS}" if stage in MEASURED else f"input {path} changed: {how}"


def itself_unfresh(path: str, stage: str, state: str) -> str:
    """Of an input that is stale, or damaged, itself."""
    itself = "stale itself" if state == "stale" else state
    return f"recorded under {path}, which is {itself}: {STAYS}" if stage in MEASURED else f"input {path} is {itself}"
