"""`schemas` is a generic name: it must be ours wherever r2s2r runs."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import r2s2r_cli
import schemas
from tests.guards.listing import ROOT


def test_schemas_lies_beside_r2s2r_cli() -> None:
    """The package that is imported as `schemas` is the one of this project."""
    assert Path(schemas.__file__).parents[1] == Path(r2s2r_cli.__file__).parents[1] == ROOT


def test_no_other_distribution_brings_schemas() -> None:
    """No other package of the environment installs the top-level name `schemas`."""
    assert set(packages_distributions()["schemas"]) == {"r2s2r"}


def test_a_file_of_that_name_in_the_working_directory_does_no_harm(tmp_path: Path) -> None:
    """The console script works in a directory that holds a file schemas.py."""
    (tmp_path / "schemas.py").write_text("raise SystemExit('the wrong schemas')\n")
    script = Path(sys.executable).with_name("r2s2r")
    done = subprocess.run([script, "--version"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
