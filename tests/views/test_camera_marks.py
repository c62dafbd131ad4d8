"""The page on which caps are marked, with its script run by node where there is one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import r2s2r_cli
from r2s2r_cli.views.camera_marks import marks_page

HARNESS = Path(__file__).with_name("marks_harness.js")
SCRIPT = Path(r2s2r_cli.__file__).parent / "views" / "templates" / "marks.js"
COMMAND = "r2s2r doctor camera --camera 'x </script>'"


def page(rods: tuple[str, ...] = ("red", "it's <b>")) -> str:
    """A page of a small picture."""
    color = np.arange(48 * 64 * 3, dtype=np.uint8).reshape(48, 64, 3)
    return marks_page(color, rods, command=COMMAND, preview=b"\x89PNG", title="a & b").decode()


def task(text: str) -> dict[str, str]:
    """What the page hands to its script."""
    found = re.search(r'<script id="task" type="application/json">(.*?)</script>', text, re.DOTALL)
    assert found
    return json.loads(found[1])


def test_the_page_holds_all_that_it_needs() -> None:
    """Picture, rods and command are in the page, every text escaped, and nothing is fetched from elsewhere."""
    text = page()
    assert task(text)["command"] == COMMAND
    assert "it&#39;s &lt;b&gt;" in text and "<b>" not in text
    assert "a &amp; b" in text
    assert not re.search(r"(src|href)=\"(?!data:)", text)


@pytest.mark.skipif(shutil.which("node") is None, reason="node runs the page's script")
def test_clicks_and_drags_become_options(tmp_path: Path) -> None:
    """Pixels of the picture, whatever size it is shown at; a drag is a box with its last pixel; names are quoted."""
    (tmp_path / "task.json").write_text(json.dumps(task(page())))
    acts = [["click", "red", 10, 20], ["drag", "it's <b>", 40, 30, 12, 8], ["click", "red", 63, 47], ["undo"]]
    done = subprocess.run(
        ["node", str(HARNESS), str(tmp_path / "task.json"), str(SCRIPT), json.dumps(acts)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    first = f"{COMMAND} --click red:10,20"
    box = "--box 'it'\\''s <b>:12,8,41,31'"
    assert done.stdout.splitlines() == [
        f"{first} --save", f"{first} {box} --save", f"{first} {box} --click red:63,47 --save", f"{first} {box} --save",
    ]  # fmt: skip
