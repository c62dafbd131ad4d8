"""One writer a project."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from filelock import FileLock

from r2s2r_cli.errors import ExitCode, UsageError
from r2s2r_cli.store.lock import GLANCE_S, writer, writing, writing_at
from r2s2r_cli.store.project import STATE_DIR

HOLD = """
import sys
from pathlib import Path
from r2s2r_cli.store.lock import writing
with writing(Path(sys.argv[1]), "import"):
    print("held", flush=True)
    sys.stdin.readline()
"""


def holder(root: Path) -> subprocess.Popen[str]:
    """Another process that holds the lock until it gets a line or is killed."""
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(root)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None and child.stdout.readline() == "held\n"
    return child


def end(child: subprocess.Popen[str]) -> None:
    """Kill it if it lives, and close its pipes."""
    child.kill()
    child.communicate()


def test_a_second_process_is_refused_and_told_who_writes(tmp_path: Path) -> None:
    """While one process writes, another gets a usage error that names command and process."""
    child = holder(tmp_path)
    try:
        with pytest.raises(UsageError) as caught, writing(tmp_path, "estimate"):
            pass
    finally:
        end(child)
    assert caught.value.exit_code == ExitCode.USAGE
    assert "r2s2r import" in caught.value.received and str(child.pid) in caught.value.received


def test_who_only_asks_refuses_nobody(tmp_path: Path) -> None:
    """To ask who writes takes the lock for an instant: a writer that comes just then waits it out."""
    with writing(tmp_path, "import"):
        pass
    asking = FileLock(tmp_path / STATE_DIR / "write.lock", thread_local=False)
    asking.acquire()
    threading.Timer(GLANCE_S / 4, asking.release).start()
    with writing(tmp_path, "estimate"):
        assert writer(tmp_path) is not None


def test_the_lock_dies_with_its_process(tmp_path: Path) -> None:
    """A writer killed with SIGKILL leaves nothing locked."""
    end(holder(tmp_path))
    with writing(tmp_path, "estimate"):
        pass


def test_the_lock_is_free_again_after_an_error(tmp_path: Path) -> None:
    """An exception inside releases it."""
    with pytest.raises(ZeroDivisionError), writing(tmp_path, "import"):
        raise ZeroDivisionError
    with writing(tmp_path, "import"):
        pass


def test_two_projects_do_not_disturb_each_other(tmp_path: Path) -> None:
    """The lock is the project's."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    child = holder(tmp_path / "a")
    try:
        with writing(tmp_path / "b", "import"):
            pass
    finally:
        end(child)


def test_a_file_is_guarded_by_the_project_it_lies_in(tmp_path: Path) -> None:
    """The project is found from the file, whatever the working directory; outside of projects nothing is locked."""
    (tmp_path / "project.toml").write_text("broken =")
    inside = tmp_path / "iterations" / "001" / "10-record.h5"
    child = holder(tmp_path)
    try:
        with pytest.raises(UsageError), writing_at(inside, "recover"):
            pass
        (tmp_path / "project.toml").unlink()
        with writing_at(inside, "recover"):
            pass
    finally:
        end(child)
