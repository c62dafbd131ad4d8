"""The command that brings this r2s2r up to date, where an artifact is of a newer one."""

from __future__ import annotations

from pathlib import Path

from r2s2r_cli.errors import UPDATE_CLONE, quoted


def newer_r2s2r() -> str:
    """Of the clone that this is: no package index has r2s2r. Installed in another way, it has to be in a clone."""
    root = Path(__file__).resolve().parents[2]
    if (root / "pyproject.toml").is_file() and (root / ".git").exists():
        return f"git -C {quoted(root)} pull && pip install -e {quoted(root)}"
    return UPDATE_CLONE
