"""Every example has a `run.sh` and says what to expect; the short ones are run and compared with it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.guards.listing import ROOT

EXAMPLES = sorted(path for path in (ROOT / "examples").iterdir() if path.name[:2].isdigit())
SHORT = ("04_observations",)
MINUTE = ("05_engine_library", "10_rig_camera")
"""Among the slow tests. The longer ones have tests of their parts."""
CLOSE = 0.05
"""Part by which a number may differ: other processors round otherwise, and contact lets it grow."""
ANY = "~"
"""Stands for a number that is another one every time."""


def agrees(expected: str, printed: str, folder: Path | None = None) -> str:
    """The first line that is not as expected, in words; empty where all are. Folders of the run are written DIR."""
    found = printed.replace(str(folder), "DIR") if folder else printed
    one, two = ([line.split() for line in text.strip().splitlines()] for text in (expected, found))
    for wanted, line in zip(one, two, strict=False):
        if len(wanted) != len(line) or not all(map(_same, wanted, line)):
            return f"expected {' '.join(wanted)!r}, printed {' '.join(line)!r}"
    return "" if len(one) == len(two) else f"expected {len(one)} lines, printed {len(two)}"


def _same(wanted: str, word: str) -> bool:
    """Words are the same; numbers are close, whatever stands around them."""
    if wanted == word:
        return True
    number = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    if re.sub(f"{number}|{ANY}", "#", wanted) != re.sub(f"{number}|{ANY}", "#", word):
        return False
    pairs = zip(re.findall(f"{number}|{ANY}", wanted), re.findall(number, word), strict=True)
    return all(a == ANY or abs(float(a) - float(b)) <= CLOSE * abs(float(a)) + _digit(a) for a, b in pairs)


def _digit(text: str) -> float:
    """One in the last digit that is printed."""
    mantissa, _, exponent = text.partition("e")
    return 10.0 ** (-len(mantissa.partition(".")[2]) + int(exponent or 0))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.name)
def test_every_example_can_be_run_and_says_what_to_expect(path: Path) -> None:
    """`run.sh`, executable, with its purpose in its first lines; `expected.txt` or a README; a line in the list."""
    script = path / "run.sh"
    assert os.access(script, os.X_OK)
    lines = script.read_text().splitlines()
    assert lines[0] == "#!/usr/bin/env bash" and lines[1].startswith("# ") and "set -euo pipefail" in lines
    told = [one for one in (path / "expected.txt", path / "README.md") if one.exists()]
    assert told and all(one.read_text().strip() for one in told)
    assert f"[{path.name}]({path.name}" in (ROOT / "examples" / "README.md").read_text()


@pytest.mark.parametrize("name", [*SHORT, *(pytest.param(name, marks=pytest.mark.slow) for name in MINUTE)])
def test_a_short_example_prints_what_is_expected(name: str, tmp_path: Path) -> None:
    """Line by line, numbers within a few per cent."""
    path = ROOT / "examples" / name
    takes_out = "--out" in (path / "run.py").read_text()
    command = ["bash", str(path / "run.sh"), *(["--out", str(tmp_path / "out")] if takes_out else [])]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, cwd=tmp_path, env={**os.environ, "PYTHON": sys.executable}
    )
    assert done.returncode == 0, done.stderr
    assert agrees((path / "expected.txt").read_text(), done.stdout, tmp_path / "out") == ""


def test_agreement_is_of_words_and_close_numbers() -> None:
    """A number off by a tenth, another word, a missing line: each is named."""
    text = "moved 19.30 mm\npull +-+ of 100 steps 4.2e-05\npictures in DIR\n"
    assert agrees(text, text) == ""
    assert agrees(text, text.replace("19.30", "19.90")) == ""
    assert agrees(text, text.replace("4.2e-05", "4.3e-05")) == ""
    assert "19.30" in agrees(text, text.replace("19.30", "21.30"))
    assert "-+-" in agrees(text, text.replace("+-+", "-+-"))
    assert "lines" in agrees(text, "\n".join(text.splitlines()[:2]))
    assert agrees("cost ~ ms", "cost 12.5 ms") == "" and agrees("cost ~ ms", "cost none ms") != ""
