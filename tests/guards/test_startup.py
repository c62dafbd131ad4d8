"""Light commands load nothing heavy: what people would only notice when it is lost."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.guards.listing import commands

HEAVY = {"torch", "open3d", "cv2", "h5py", "scipy", "matplotlib", "plotly", "jinja2", "mujoco", "serial", "pandas"}

# Runs the command line as the console script does and leaves the names of all loaded modules in a file.
PROBE = """
import atexit, json, sys
target, arguments = sys.argv[1], sys.argv[2:]
atexit.register(lambda: open(target, "w").write(json.dumps(sorted(sys.modules))))
sys.argv = ["r2s2r", *arguments]
from r2s2r_cli.__main__ import main
main()
"""


def loaded(folder: Path, *arguments: str) -> set[str]:
    """Top-level modules that are loaded when `r2s2r ARGUMENTS` has ended well in `folder`."""
    target = folder / "modules.json"
    probe = [sys.executable, "-c", PROBE, str(target), *arguments]
    done = subprocess.run(probe, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {module.partition(".")[0] for module in json.loads(target.read_text())}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fresh project, made by the command itself."""
    folder = tmp_path_factory.mktemp("light")
    init = [sys.executable, "-m", "r2s2r_cli", "init", "p"]
    subprocess.run(init, cwd=folder, capture_output=True, text=True, check=True)
    return folder / "p"


def test_import_of_the_app_is_light(tmp_path: Path) -> None:
    """`import r2s2r_cli.app` loads every command module, and none of them loads anything heavy."""
    code = "import json, sys, r2s2r_cli.app; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    modules = set(json.loads(done.stdout))
    assert "r2s2r_cli.app" in modules
    assert HEAVY & modules == set()


@pytest.mark.parametrize("command", ["", *sorted(commands())])
def test_help_is_light(command: str, tmp_path: Path) -> None:
    """`r2s2r --help` and `r2s2r COMMAND --help` end well and load nothing heavy."""
    assert HEAVY & loaded(tmp_path, *command.split(), "--help") == set()


@pytest.mark.parametrize("arguments", ["--version", "status", "status --json"])
def test_light_commands_are_light(arguments: str, project: Path) -> None:
    """The commands that people run all the time load nothing heavy in a fresh project."""
    assert HEAVY & loaded(project, *arguments.split()) == set()


def test_init_is_light(tmp_path: Path) -> None:
    """Making a project loads nothing heavy, and makes it."""
    assert HEAVY & loaded(tmp_path, "init", "fresh") == set()
    assert (tmp_path / "fresh" / "project.toml").is_file()
