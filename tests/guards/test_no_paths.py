"""Nothing that is committed names this machine or the hosts that packages come from."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.guards.listing import ROOT, name, project_files

# Put together from parts, so that this file does not contain what it forbids.
HOSTS = [f"{host}.org" for host in ("pypi", "pythonhosted", "npmjs", "debian", "pytorch")]
FOLDERS = [f"/{folder}" for folder in ("work/main", "work/shared", "opt/wheels", "opt/pypi")]


def forbidden() -> list[str]:
    """Host names, folders of the workplace, and where this checkout and this user's home lie now."""
    here = [str(path) for path in (ROOT, Path.home()) if len(path.parts) > 1]
    return [*HOSTS, *FOLDERS, *(text + "/" for text in here)]


@pytest.mark.parametrize("text", forbidden())
def test_no_file_names_the_machine(text: str) -> None:
    """No file of the project contains a path of this machine or the name of a registry's host."""
    assert [name(p) for p in project_files() if text.encode() in p.read_bytes()] == []
