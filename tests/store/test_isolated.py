"""The child process that opens files nobody vouches for: it may die or hang, the command does neither."""

from __future__ import annotations

import os
import signal
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store import isolated
from r2s2r_cli.store.isolated import IsolatedReader
from tests.store.conftest import Copy


def stuck(tmp_path: Path) -> Path:
    """A file that is waited for without end when it is opened."""
    os.mkfifo(tmp_path / "stuck.h5")
    return tmp_path / "stuck.h5"


def test_a_sound_artifact_is_found_sound(golden: Copy, reader: IsolatedReader) -> None:
    """Digests and layout hold, and there is nothing to say."""
    report = reader.verify(golden("estimate"))
    assert report == {"readable": True, "content_ok": True, "seal_ok": True, "problems": []}


def test_a_file_that_hangs_the_library_is_given_up(
    tmp_path: Path, golden: Copy, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the time limit the child is killed, the error says so, and the next file is read by a new child."""
    monkeypatch.setattr(isolated, "BASE_LIMIT_S", 0.5)
    with IsolatedReader() as reader:
        assert reader.verify(golden("policy"))["content_ok"]
        with pytest.raises(ArtifactError, match="busy for over") as caught:
            reader.verify(stuck(tmp_path))
        assert caught.value.hint
        monkeypatch.undo()
        assert reader.verify(golden("policy"))["content_ok"]


def test_a_file_that_crashes_the_library_is_an_error(tmp_path: Path, golden: Copy) -> None:
    """Where the child dies over a file, the error says so, and the next file is read by a new child."""
    with IsolatedReader() as reader:
        reader.verify(golden("policy"))
        child = reader._child
        assert child is not None
        threading.Timer(0.3, lambda: os.kill(child.pid, signal.SIGSEGV)).start()
        with pytest.raises(ArtifactError, match="crashed"):
            reader.verify(stuck(tmp_path))
        assert reader.verify(golden("policy"))["content_ok"]


def test_a_child_that_died_before_it_was_asked_says_nothing_of_the_file(
    golden: Copy, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The machine was out of memory, say: a new child reads the file, which is sound."""
    with IsolatedReader() as reader:
        child = reader._running()
        child.kill()
        child.wait()
        # It dies just after it was found alive.
        monkeypatch.setattr(child, "poll", lambda: monkeypatch.undo())
        assert reader.verify(golden("policy"))["content_ok"]


def test_the_child_ends_with_its_reader(golden: Copy) -> None:
    """No process is left behind."""
    with IsolatedReader() as reader:
        reader.verify(golden("policy"))
        child = reader._child
    assert child is not None and child.returncode is not None


def test_files_of_the_user_are_not_imported(tmp_path: Path, golden: Copy, monkeypatch: pytest.MonkeyPatch) -> None:
    """A working directory with files named like modules does not disturb the child."""
    for name in ("json", "numpy", "h5py", "schemas"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('imported from the working directory')\n")
    path = golden("policy").relative_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    with IsolatedReader() as reader:
        assert reader.verify(path)["content_ok"]


def test_a_missing_file_is_an_error_in_words(tmp_path: Path, reader: IsolatedReader) -> None:
    """It is not handed to the child at all."""
    with pytest.raises(ArtifactError, match="no such file"):
        reader.verify(tmp_path / "no.h5")


def test_foreign_files_are_described_with_their_links(tmp_path: Path, reader: IsolatedReader) -> None:
    """The tree of another program's file: datasets, odd dtypes, soft links and rings, and it ends."""
    path = tmp_path / "foreign.h5"
    with h5py.File(path, "w") as file:
        file["a/numbers"] = np.zeros((2, 3))
        file["a/words"] = ["x", "yy"]
        file["a/ring"] = file["a"]
        file["soft"] = h5py.SoftLink("/a")
        file["a"].attrs["many"] = [1, 2, 3]
    report = reader.tree(path)
    nodes = {node["path"]: node for node in report["nodes"]}
    assert report["problem"] == "" and set(nodes) == {"a", "a/numbers", "a/words", "a/ring", "soft"}
    assert nodes["a/numbers"]["shape"] == [2, 3] and nodes["soft"]["attributes"] == {"link": "link to /a"}


def test_names_that_are_no_text_can_be_told(tmp_path: Path, reader: IsolatedReader) -> None:
    """A dataset name that is not UTF-8 comes back as something that can be printed."""
    path = tmp_path / "odd.h5"
    with h5py.File(path, "w") as file:
        file[b"\xff\xfe"] = 1.0
    report = reader.tree(path)
    assert len(report["nodes"]) == 1
    report["nodes"][0]["path"].encode()


@pytest.mark.parametrize("content", [b"", b"x" * 5000, b"\x89HDF\r\n\x1a\n" + bytes(5000)], ids=["empty", "x", "zeros"])
def test_what_is_no_hdf5_is_an_answer(tmp_path: Path, reader: IsolatedReader, content: bytes) -> None:
    """A file that cannot be opened gives a report with its problem."""
    (tmp_path / "x.h5").write_bytes(content)
    report = reader.verify(tmp_path / "x.h5")
    assert not report["readable"] and report["problems"]
    assert all(set(p) == {"where", "what", "expected", "received"} for p in report["problems"])
