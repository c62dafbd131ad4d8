"""Light commands load nothing heavy: what people would only notice when it is lost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.guards.listing import commands

HEAVY = {"torch", "open3d", "cv2", "h5py", "scipy", "matplotlib", "plotly", "jinja2", "mujoco", "serial", "pandas"}

# Runs command lines as the console script does, one after the other, and says after each how it ended and which
# modules were loaded by then. What the first one loads, the later ones find loaded: the first one named is to blame.
PROBE = """
import io, json, sys
from contextlib import redirect_stdout
from r2s2r_cli.__main__ import main
answers = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["r2s2r", *arguments]
    code = None
    with redirect_stdout(io.StringIO()) as said:
        try:
            code = main()
        except SystemExit as end:
            code = end.code
    answers.append([code or 0, len(said.getvalue()), sorted({name.partition(".")[0] for name in sys.modules})])
print(json.dumps(answers))
"""


def heavy(folder: Path, *lines: str) -> dict[str, set[str]]:
    """What of HEAVY is loaded in a fresh process in `folder` after each `r2s2r LINE`; each must end well and say
    something. None, if all is well."""
    probe = [sys.executable, "-c", PROBE, json.dumps([line.split() for line in lines])]
    done = subprocess.run(probe, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    answers = json.loads(done.stdout)
    assert {line: code for line, (code, _, _) in zip(lines, answers, strict=True) if code} == {}, done.stderr
    assert all(said for _, said, _ in answers)
    return {line: found for line, (_, _, names) in zip(lines, answers, strict=True) if (found := HEAVY & set(names))}


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


def test_help_is_light(tmp_path: Path) -> None:
    """`r2s2r --help` and `r2s2r COMMAND --help` end well and load nothing heavy."""
    assert heavy(tmp_path, *(f"{command} --help" for command in ["", *sorted(commands())])) == {}


def test_init_is_light(tmp_path: Path) -> None:
    """Making a project loads nothing heavy, and makes it."""
    assert heavy(tmp_path, "init fresh") == {}
    assert (tmp_path / "fresh" / "project.toml").is_file()


def test_light_commands_are_light(project: Path) -> None:
    """The commands that people run all the time load nothing heavy in a fresh project. One that reads artifacts after
    them does: the guard sees what it guards against."""
    found = heavy(project, "--version", "status", "status --json", "validate")
    assert list(found) == ["validate"]
    assert "h5py" in found["validate"]


def test_torch_has_one_thread_where_nobody_asks_for_more(tmp_path: Path) -> None:
    """Whatever the machine has: sums, and so artifacts, do not depend on it."""
    code = PROBE + "import os, torch; print(torch.get_num_threads(), os.environ['OPENBLAS_NUM_THREADS'])"
    own = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    done = subprocess.run(
        [sys.executable, "-c", code, '[["--version"]]'], cwd=tmp_path, capture_output=True, text=True, check=True,
        env={**own, "OPENBLAS_NUM_THREADS": "3"},
    )  # fmt: skip
    assert done.stdout.split()[-2:] == ["1", "3"]
