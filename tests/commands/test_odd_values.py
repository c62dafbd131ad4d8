"""Values that nobody means: refused in words, before anything is computed or written."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands.conftest import invoke
from tests.commands.test_stages import ESTIMATE


@pytest.mark.parametrize(
    "words",
    [("init", "q", "--sample", "--seed", "-1"), ("simulate", "--random", "2", "--seed", "-1"),
     ("plan", "--seed", "-1", "--dry-run"), ("run", "--seed", "-1", "--dry-run"),
     ("import", "sample.csv", "--depth-scale", "nan"), ("import", "sample.csv", "--depth-scale", "inf", "--dry-run"),
     ("import", "sample.csv", "--set", "import.max_gap_s=" + "9" * 5000),
     ("import", "sample.csv", "--set", "import.max_gap_s=" + "[" * 3000),
     ("export", "robot.toml", "--to", "mjcf", "--set", "contact.friction=" + "9" * 400)],
    ids=lambda words: " ".join(words)[:40],
)  # fmt: skip
def test_numbers_that_nobody_means_are_refused(project: Path, words: tuple[str, ...]) -> None:
    """Before anything is computed or written, in words."""
    before = sorted(project.rglob("*"))
    result = invoke(*words)
    assert result.exit_code in (2, 4) and "Traceback" not in result.stderr and "hint: " in result.stderr
    assert sorted(project.rglob("*")) == before


def test_text_that_ends_in_the_middle_is_refused(project: Path) -> None:
    """HDF5 cuts text at a NUL: a name with one is no name, for `validate` as for every stage."""
    path = project / "robot.toml"
    path.write_text(path.read_text().replace('name = "threebar"', 'name = "three\\u0000bar"', 1))
    for words, code in ((("validate", "robot.toml"), 3), (("import", "sample.csv"), 4)):
        result = invoke(*words)
        assert result.exit_code == code and "NUL" in result.stdout + result.stderr


def test_a_damaged_head_is_no_file_of_another_program(estimated: Path) -> None:
    """`inspect` says that it is ours and what brings it back."""
    path = estimated / ESTIMATE
    data = bytearray(path.read_bytes())
    data[300] ^= 1
    path.write_bytes(data)
    result = invoke("inspect", ESTIMATE)
    assert result.exit_code == 4 and "r2s2r recover" in result.stderr
