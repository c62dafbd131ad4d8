"""What is shipped: one wheel with both packages and all the files that are read at run time."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.guards.listing import ROOT, name, project_files

SHIPPED = ("r2s2r_cli", "schemas")


@pytest.fixture(scope="module")
def wheel_files(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Names of the files in a wheel that is built from a copy of the project's files."""
    source, target = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for path in project_files():
        if path.relative_to(ROOT).parts[0] in {*SHIPPED, "pyproject.toml", "README.md", "LICENSE"}:
            copy = source / path.relative_to(ROOT)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", str(target), str(source)]
    done = subprocess.run(build, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = Path(target).glob("*.whl")
    return set(zipfile.ZipFile(wheel).namelist())


@pytest.mark.slow
def test_the_wheel_holds_every_file_of_both_packages(wheel_files: set[str]) -> None:
    """Every file under r2s2r_cli and schemas is in the wheel: code, templates, JSON Schemas, py.typed."""
    wanted = {name(path) for path in project_files() if path.relative_to(ROOT).parts[0] in SHIPPED}
    assert wanted - wheel_files == set()


@pytest.mark.slow
def test_the_wheel_holds_nothing_else(wheel_files: set[str]) -> None:
    """No test, example or document is installed under a top-level name that belongs to others."""
    assert {file.split("/")[0] for file in wheel_files if ".dist-info/" not in file} == set(SHIPPED)
