"""Projects to run commands in."""

from __future__ import annotations

import functools
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.testing
from typer.main import get_command
from typer.testing import CliRunner

from r2s2r_cli.app import app

# The runner builds the whole command line anew for every command that it runs, a third of what a short one takes.
typer.testing._get_command = functools.cache(get_command)

Run = Callable[..., Any]


def invoke(*arguments: str) -> Any:
    """Run `r2s2r` in this process; the result has exit_code, stdout and stderr."""
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture(scope="module", autouse=True)
def sketches(request: pytest.FixtureRequest) -> Iterator[None]:
    """Pictures that commands draw in this process are small, without axes and not laid out, in a third of the time:
    what stands in them is tested in tests/views, from values. Among the slow tests are some that look at them."""
    if request.config.getoption("markexpr") != "not slow":
        yield
        return
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    save = Figure.savefig

    def sketched(figure: Figure, *to: Any, **how: Any) -> None:
        for axes in figure.axes:
            axes.set_axis_off()
        save(figure, *to, **{**how, "dpi": 20})

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", sketched)
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda *_: None)
        yield


@pytest.fixture(scope="session")
def templates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two projects with the kinematic sample: `new`, and `done` with it imported, estimated and drawn."""
    root = tmp_path_factory.mktemp("templates")
    assert invoke("init", str(root / "new"), "--sample").exit_code == 0
    shutil.copytree(root / "new", root / "done")
    where = ("--project", str(root / "done"))
    for arguments in (("import", str(root / "done" / "sample.csv"), *where), ("estimate", *where)):
        result = invoke(*arguments)
        assert result.exit_code == 0, result.stderr
    return root


@pytest.fixture
def project(templates: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project with the kinematic sample, as the working directory."""
    return _copy(templates / "new", tmp_path, monkeypatch)


@pytest.fixture
def estimated(templates: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The same with the sample imported and estimated."""
    return _copy(templates / "done", tmp_path, monkeypatch)


def _copy(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    root = tmp_path / "robot"
    shutil.copytree(template, root)
    monkeypatch.chdir(root)
    return root


def document(*arguments: str) -> dict[str, Any]:
    """The JSON document of a command that must succeed."""
    result = invoke(*arguments, "--json")
    assert result.exit_code == 0, result.stderr
    parsed: dict[str, Any] = json.loads(result.stdout)
    return parsed
