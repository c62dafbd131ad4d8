"""The import layers of docs/adr/0001, as import-linter sees them."""

from __future__ import annotations

import subprocess
import sys

from tests.guards.listing import ROOT


def test_import_contracts_are_kept() -> None:
    """Every contract of pyproject.toml holds in the present tree."""
    call = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    done = subprocess.run([sys.executable, "-c", call], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
