"""Bytes that changed inside an artifact: plain `status` reads none and says so, `status --check` finds them."""

from __future__ import annotations

from pathlib import Path

from tests.commands.conftest import document, invoke

ESTIMATE = "iterations/001/20-estimate.h5"
NOT_READ = "heads and sizes were read, contents were not; to compare every byte: r2s2r status --check"


def spoil(path: Path) -> None:
    """Change eight bytes in the middle."""
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 8] = bytes(255 ^ one for one in content[middle : middle + 8])
    path.write_bytes(content)


def test_what_was_not_read_is_said(estimated: Path) -> None:
    """Below the table and before the hint; with nothing in the project nothing is said, nor with --check."""
    spoil(estimated / ESTIMATE)
    shown = invoke("status")
    assert shown.exit_code == 0 and shown.stderr.splitlines()[0] == NOT_READ
    assert shown.stderr.splitlines()[-1] == f"hint: {document('status')['next']}"
    assert NOT_READ not in invoke("status", "--quiet").stderr
    checked = invoke("status", "--check")
    assert checked.exit_code == 3 and NOT_READ not in checked.stderr
    assert "damaged" in checked.stdout and checked.stderr.splitlines()[-1] == f"hint: r2s2r recover {ESTIMATE}"


def test_an_empty_project_has_no_contents(project: Path) -> None:
    """No artifact, no remark on them."""
    assert NOT_READ not in invoke("status").stderr
