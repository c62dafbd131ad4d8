"""Checkpoints of arrays: results come back bit by bit in their order, and what was not written whole is forgotten."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.store.checkpoint_arrays import RECORD, ArrayCheckpoint

RESULTS = [
    [np.array([[0.1, 1 / 3], [np.nan, 5e-324]]), np.array(7)],
    [np.zeros((0, 3))],
    [np.arange(5, dtype=np.float64)[::2]],
]


def digest(k: int) -> bytes:
    """Of question k."""
    return bytes([k]) * 32


def kept(path: Path, count: int = 3) -> ArrayCheckpoint:
    """A checkpoint with the first results."""
    made = ArrayCheckpoint(path, "a")
    for k in range(count):
        assert made.recall(digest(k)) is None
        made.keep(digest(k), RESULTS[k])
    return made


def known(path: Path, questions: list[int]) -> list[int]:
    """Which of the questions are answered from the file, each as it was kept."""
    again, found = ArrayCheckpoint(path, "a", resume=True), []
    for k in questions:
        result = again.recall(digest(k))
        if result is None:
            again.keep(digest(k), RESULTS[k])
            continue
        assert len(result) == len(RESULTS[k])
        for one, own in zip(result, RESULTS[k], strict=True):
            assert one.dtype == own.dtype and one.shape == own.shape
            assert one.tobytes() == np.ascontiguousarray(own).tobytes()
        found.append(k)
    return found


def test_results_come_back_bit_by_bit(tmp_path: Path) -> None:
    """Shapes, types, nan and denormals, in the order in which they were asked for; then there are none left."""
    kept(tmp_path / "x.partial")
    assert known(tmp_path / "x.partial", [0, 1, 2]) == [0, 1, 2]
    again = ArrayCheckpoint(tmp_path / "x.partial", "a", resume=True)
    assert [again.recall(digest(k)) is None for k in (0, 1, 2, 3)] == [False, False, False, True]


@pytest.mark.parametrize("lost", [1, 20, 60])
def test_a_killed_process_loses_what_it_was_writing(tmp_path: Path, lost: int) -> None:
    """Cut off anywhere in the last result, the ones before are there, and what is kept next follows them."""
    path = tmp_path / "x.partial"
    kept(path)
    path.write_bytes(path.read_bytes()[:-lost])
    assert known(path, [0, 1, 2]) == [0, 1]
    assert known(path, [0, 1, 2]) == [0, 1, 2]


def test_spoilt_bytes_are_not_believed(tmp_path: Path) -> None:
    """A result whose sum is wrong, and all after it, are worked out again."""
    path = tmp_path / "x.partial"
    kept(path, 1)
    size = path.stat().st_size
    kept(path)
    raw = bytearray(path.read_bytes())
    raw[size + 60] ^= 1
    path.write_bytes(bytes(raw))
    assert known(path, [0, 1, 2]) == [0]


def test_a_spoilt_length_asks_for_no_memory(tmp_path: Path) -> None:
    """A result that says to be larger than the file is not there."""
    path = tmp_path / "x.partial"
    kept(path, 1)
    size = path.stat().st_size
    kept(path)
    raw = bytearray(path.read_bytes())
    key, _, crc = RECORD.unpack_from(raw, size)
    RECORD.pack_into(raw, size, key, 2**62, crc)
    path.write_bytes(bytes(raw))
    assert known(path, [0, 1, 2]) == [0]


def test_another_question_ends_what_is_known(tmp_path: Path) -> None:
    """Where the work goes another way than before, nothing of the old way is taken."""
    path = tmp_path / "x.partial"
    kept(path)
    assert known(path, [0, 2, 1]) == [0]
    assert known(path, [0, 2, 1]) == [0, 2, 1]


def test_it_stops_growing(tmp_path: Path) -> None:
    """Beyond its size nothing is kept, small results neither: they would come back in the wrong place."""
    made = ArrayCheckpoint(tmp_path / "x.partial", "a", most=1000)
    for k, size in enumerate((50, 500, 1)):
        made.keep(digest(k), [np.zeros(size)])
    again = ArrayCheckpoint(tmp_path / "x.partial", "a", resume=True)
    assert [again.recall(digest(k)) is None for k in (0, 1)] == [False, True]


def test_without_resume_it_begins_anew(tmp_path: Path) -> None:
    """What lies there is neither read nor added to; `kept` says whether there is something of this request."""
    path = tmp_path / "x.partial"
    assert not ArrayCheckpoint(path, "a", resume=True).kept()
    kept(path)
    assert ArrayCheckpoint(path, "a").kept() and not ArrayCheckpoint(path, "b").kept()
    again = ArrayCheckpoint(path, "a")
    assert again.recall(digest(0)) is None
    again.keep(digest(2), RESULTS[2])
    assert known(path, [2]) == [2]
    again.clear()
    again.clear()
    assert not list(tmp_path.iterdir())


def test_another_request_is_refused_and_a_broken_file_said(tmp_path: Path) -> None:
    """Exit codes 2 and 4, with the way out."""
    path = tmp_path / "x.partial"
    kept(path)
    with pytest.raises(UsageError, match="another request"):
        ArrayCheckpoint(path, "b", resume=True).recall(digest(0))
    path.write_bytes(b"\x00\n" + path.read_bytes())
    with pytest.raises(InputError) as caught:
        ArrayCheckpoint(path, "a", resume=True, command=["diagnose", "--seed", "3"]).recall(digest(0))
    assert caught.value.hint == "r2s2r diagnose --seed 3"
