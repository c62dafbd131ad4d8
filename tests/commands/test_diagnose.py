"""`diagnose` in a project: an effect of an installed package named and used, and what an interruption leaves."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from r2s2r_cli.effects import known_effects
from r2s2r_cli.effects.known import GROUP
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.project import Project
from r2s2r_cli.store.write import write_artifact
from tests.commands.conftest import document, invoke
from tests.support.builders import provenance
from tests.support.identified import identification
from tests.support.planted_log import planted_project

pytestmark = pytest.mark.slow

GUIDE = Path(__file__).parents[2] / "docs" / "how-to-extend.md"
FORCE_N = 0.45
DIAGNOSIS = "iterations/001/70-diagnose.h5"
ASK = ("--train", "g1:1-4", "--test", "g2:1-2", "--effect", "side_wind", "--effect", "motor_lag")
START = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background process inherits "ignore"
sys.argv = ["r2s2r", "diagnose", *{arguments!r}]
from r2s2r_cli.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The package of the guide's example, installed: its module, and metadata with the entry point."""
    root = tmp_path_factory.mktemp("site")
    found = re.search(
        r"### In a package of your own.*?```python\n(.*?)```.*?```toml\n(.*?)```", GUIDE.read_text(), re.S
    )
    assert found is not None
    (root / "my_package").mkdir()
    (root / "my_package" / "__init__.py").touch()
    (root / "my_package" / "side_wind.py").write_text(found[1])
    entry = re.search(rf'"{GROUP}"\]\n(\w+) = "(.*)"', found[2])
    assert entry is not None
    info = root / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my_package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{entry[1]} = {entry[2]}\n")
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(root))
    known_effects.cache_clear()
    yield root
    patch.undo()
    known_effects.cache_clear()


@pytest.fixture(scope="module")
def template(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two gaits in a side wind, estimated, a simulator without wind, and the diagnosis of them."""
    root = tmp_path_factory.mktemp("diagnosed") / "robot"
    planted_project(root, {"side_wind.force_n": FORCE_N}, gaits=2, targets=4, seed=1)
    here = Project.find(root)
    write_artifact(root / "iterations/001/30-identify.h5", identification(here.robot()), provenance())
    result = invoke("diagnose", *ASK, "--project", str(root), "--json")
    assert result.exit_code == 0, result.stderr
    (root / "diagnosis.json").write_text(result.stdout)
    return root


@pytest.fixture
def project(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that project, as the working directory."""
    root = tmp_path / "robot"
    shutil.copytree(template, root)
    monkeypatch.chdir(root)
    return root


def told(project: Path) -> dict[str, Any]:
    """What the diagnosis of the template said."""
    found: dict[str, Any] = json.loads((project / "diagnosis.json").read_text())
    return found


def test_an_effect_of_a_package_is_found(project: Path) -> None:
    """It is screened, fitted to what was planted, before any other, and said to be what the runs show. From 0.3 N to
    0.5 N four intervals cost the same within a few nats, by chance one more or less than the next."""
    first = next(one for one in told(project)["ranking"] if one["effect"] not in ("none", "unknown"))
    assert first["effect"] == "side_wind" and first["channel"] == "world"
    size, (low, high) = first["size"]["side_wind.force_n"], first["ci90"]["side_wind.force_n"]
    assert low < size <= high and abs(size - FORCE_N) < 0.16
    assert "side_wind" in told(project)["set90"]


def test_what_it_writes_validates_and_needs_no_network(project: Path) -> None:
    """The artifact has no error; page and pictures lie beside it; nothing unfinished is left."""
    assert invoke("validate", DIAGNOSIS).exit_code == 0
    names = {path.name for path in (project / "iterations/001").glob("70-diagnose*")}
    assert names >= {f"70-diagnose{end}" for end in (
        ".h5", ".html", "-gap.png", "-robot.png", "-floor.png", "-ranking.png", "-judged.png"
    )}  # fmt: skip
    assert "70-diagnose.partial" not in names
    page = (project / "iterations/001/70-diagnose.html").read_text()
    assert told(project)["report"]["sentence"].split(".")[0] in page
    assert not re.search(r"(src|href)=.?(https?:)?//", page)


def test_ctrl_c_leaves_what_was_simulated_and_resume_ends_the_same(project: Path, site: Path) -> None:
    """Interrupted it leaves with 130 and the command that goes on, the artifact as it was; taken up, even with the
    last of the file torn off as by a crash, it leaves the artifact of the whole diagnosis, bit by bit."""
    before = read_header(project / DIAGNOSIS).content_sha256
    code = START.format(arguments=[*ASK, "--force", "--no-draw"])
    paths = os.pathsep.join([str(site), *filter(None, [os.environ.get("PYTHONPATH")])])
    child = subprocess.Popen([sys.executable, "-c", code], cwd=project, stdout=subprocess.DEVNULL,
                             stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": paths})  # fmt: skip
    checkpoint = project / "iterations/001/70-diagnose.partial"
    deadline = time.monotonic() + 300
    while child.poll() is None and time.monotonic() < deadline:
        if checkpoint.exists() and checkpoint.stat().st_size > 1_000_000:
            break
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    _, stderr = child.communicate(timeout=300)
    assert child.returncode == 130, stderr
    assert "Traceback" not in stderr
    assert f"hint: r2s2r diagnose {' '.join(ASK)} --no-draw --resume --force" in stderr
    assert read_header(project / DIAGNOSIS).content_sha256 == before
    refused = invoke("diagnose", *ASK, "--seed", "9", "--resume")
    assert refused.exit_code == 2 and "another request" in refused.stderr
    os.truncate(checkpoint, checkpoint.stat().st_size - 100)
    again = document("diagnose", *ASK, "--no-draw", "--resume")
    assert again["state"] == "done" and again["content_sha256"] == before
    assert again["ranking"] == told(project)["ranking"]
    assert again["next_gait"] is None or again["next_gait"]["file"] is None  # the policy is written with the pictures
    assert not checkpoint.exists()


def test_one_interval_is_too_few(project: Path) -> None:
    """Exit code 4 before any work, with what to do."""
    result = invoke("diagnose", "--train", "g1:1", "--test", "g2:1", "--force", "--json")
    assert result.exit_code == 4
    error = json.loads(result.stdout)
    assert (error["where"], error["expected"], error["received"]) == ("--train", "at least 2 to fit", "g1:1")
    assert error["hint"].startswith("r2s2r ")
