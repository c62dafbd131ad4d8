"""Projects to run commands in."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from r2s2r_cli.app import app

Run = Callable[..., Any]


def invoke(*arguments: str) -> Any:
    """Run `r2s2r` in this process; the result has exit_code, stdout and stderr."""
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with the kinematic sample, as the working directory."""
    root = tmp_path / "robot"
    assert invoke("init", str(root), "--sample").exit_code == 0
    monkeypatch.chdir(root)
    return root


@pytest.fixture
def estimated(project: Path) -> Path:
    """The same with the sample imported and estimated."""
    for arguments in (("import", "sample.csv"), ("estimate",)):
        result = invoke(*arguments, "--quiet")
        assert result.exit_code == 0, result.stderr
    return project


def document(*arguments: str) -> dict[str, Any]:
    """The JSON document of a command that must succeed."""
    result = invoke(*arguments, "--json")
    assert result.exit_code == 0, result.stderr
    parsed: dict[str, Any] = json.loads(result.stdout)
    return parsed
