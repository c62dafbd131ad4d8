"""The journal: every row that was appended can be read, whatever happened to the bytes around it."""

from __future__ import annotations

import io
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from r2s2r_cli.errors import ArtifactError, UsageError
from r2s2r_cli.store import journal as module
from r2s2r_cli.store.journal import Field, Journal, JournalHead, Stream
from r2s2r_cli.store.journal_read import read_field, read_head, records, unwatched
from tests.support.recorder import COLOR, RUN, SENSORS, append, head, image, sensor_row, write

IN_A_FOLDER = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def decode(stream: Stream, payload: bytes) -> dict[str, Any]:
    """The row that a record holds."""
    file = io.BytesIO(payload)
    return {field.name: read_field(file, 0, stream, field.name) for field in stream.fields}


def rows(path: Path) -> list[tuple[int, dict[str, Any]]]:
    """(stream number, row) of every whole record."""
    streams = read_head(path)[0].streams
    content = path.read_bytes()
    return [(p.stream, decode(streams[p.stream], content[p.offset : p.offset + p.length])) for p in records(path)]


def sensor_numbers(path: Path) -> list[int]:
    """Numbers of the sensor rows that can be read, after checking that each row is itself."""
    found = [row for stream, row in rows(path) if stream == 0]
    for row in found:
        number = int(row["capacitance"][0])
        assert row["t"] == 0.01 * number and row["capacitance"].tolist() == [number, -number]
    return [int(row["capacitance"][0]) for row in found]


def test_rows_come_back_in_order(tmp_path: Path) -> None:
    """Numbers, arrays and images of all streams are what was appended."""
    path = tmp_path / "x.journal"
    total = write(path, 20)
    found = rows(path)
    assert len(found) == total and sensor_numbers(path) == list(range(20))
    assert [row["color"] for stream, row in found if stream == 1] == [image(i) for i in range(0, 20, 3)]
    assert read_head(path)[0] == head()


@IN_A_FOLDER
@given(st.integers(0, 10_000))
def test_cut_anywhere_only_the_torn_row_is_lost(tmp_path: Path, cut: int) -> None:
    """Whatever length of the file survived, all rows that are whole in it are read, and nothing else."""
    path = tmp_path / "x.journal"
    path.unlink(missing_ok=True)
    write(path, 30)
    content = path.read_bytes()
    ends = [place.offset + place.length for place in records(path)]
    start = read_head(path)[1]
    cut = start + cut % (len(content) - start + 1)
    path.write_bytes(content[:cut])
    assert len(rows(path)) == sum(end <= cut for end in ends)


@IN_A_FOLDER
@given(st.data())
def test_damage_in_the_middle_costs_the_damaged_rows_only(tmp_path: Path, draw: st.DataObject) -> None:
    """A flipped bit anywhere behind the head loses at most the row it lies in; no row is read wrong or twice."""
    path = tmp_path / "x.journal"
    path.unlink(missing_ok=True)
    write(path, 12)
    before = rows(path)
    content, start = bytearray(path.read_bytes()), read_head(path)[1]
    content[draw.draw(st.integers(start, len(content) - 1))] ^= 1 << draw.draw(st.integers(0, 7))
    path.write_bytes(content)
    after = rows(path)
    assert len(after) == len(before) - 1
    key = [(stream, {k: np.asarray(v).tolist() for k, v in row.items()}) for stream, row in before]
    assert all((stream, {k: np.asarray(v).tolist() for k, v in row.items()}) in key for stream, row in after)


@IN_A_FOLDER
@given(st.data())
def test_a_damaged_head_is_an_error(tmp_path: Path, draw: st.DataObject) -> None:
    """A flipped bit in the head is refused, or the head reads the same."""
    path = tmp_path / "x.journal"
    path.unlink(missing_ok=True)
    write(path, 1)
    content, start = bytearray(path.read_bytes()), read_head(path)[1]
    content[draw.draw(st.integers(0, start - 1))] ^= 1 << draw.draw(st.integers(0, 7))
    path.write_bytes(content)
    try:
        assert read_head(path)[0] == head()
    except ArtifactError as error:
        assert "journal" in error.what and error.hint


def test_an_image_that_looks_like_a_record_is_not_taken_for_one(tmp_path: Path) -> None:
    """A journal inside an image is data: its rows are not read as rows."""
    inner = tmp_path / "inner.journal"
    write(inner, 3)
    path = tmp_path / "x.journal"
    with Journal(path, head()) as journal:
        journal.append(COLOR, {"t": 0.0, "color": inner.read_bytes()})
        append(journal, 1)
    assert [stream for stream, _ in rows(path)] == [1, 0]


def test_a_second_journal_of_the_same_name_is_refused(tmp_path: Path) -> None:
    """An unsealed recording is never overwritten, and the error says how to seal it."""
    path = tmp_path / "10-record.h5.journal"
    write(path, 2)
    before = path.read_bytes()
    with pytest.raises(ArtifactError, match="in the way") as caught:
        Journal(path, head())
    assert "recover" in caught.value.hint and path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_a_journal_being_written_cannot_be_sealed(tmp_path: Path) -> None:
    """While the recorder has it open, nobody else gets it; after its end, anybody."""
    path = tmp_path / "x.journal"
    with Journal(path, head()), pytest.raises(UsageError, match="running"), unwatched(path):
        pass
    with unwatched(path):
        pass


@pytest.mark.parametrize(
    "row",
    [
        {"t": 0.0},
        {"t": 0.0, "capacitance": np.zeros(3)},
        {"t": 0.0, "capacitance": np.zeros(2), "extra": 1},
        {"t": "now", "capacitance": np.zeros(2)},
    ],
    ids=["a field is missing", "other shape", "unknown field", "text"],
)
def test_a_row_of_another_form_is_refused_and_harms_nothing(tmp_path: Path, row: dict[str, Any]) -> None:
    """The rows before and after are whole."""
    path = tmp_path / "x.journal"
    with Journal(path, head()) as journal:
        append(journal, 1)
        with pytest.raises(ValueError, match=r"."):
            journal.append(SENSORS, row)
        append(journal, 2)
    assert sensor_numbers(path) == [1, 2]


def test_a_row_too_large_to_be_read_again_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What `records` would take for damage cannot be appended; the largest row that can comes back."""
    monkeypatch.setattr(module, "MAX_RECORD", 4000)
    path = tmp_path / "x.journal"
    largest = bytes(4000 - 8 - 4)
    with Journal(path, head()) as journal:
        with pytest.raises(ValueError, match="at most"):
            journal.append(COLOR, {"t": 0.0, "color": largest + b"x"})
        journal.append(COLOR, {"t": 0.0, "color": largest})
    assert [row["color"] for _, row in rows(path)] == [largest]


def test_ctrl_c_between_rows_leaves_whole_rows(tmp_path: Path) -> None:
    """KeyboardInterrupt ends the recording; what was appended is there."""
    path = tmp_path / "x.journal"
    with pytest.raises(KeyboardInterrupt), Journal(path, head()) as journal:
        append(journal, 1)
        signal.raise_signal(signal.SIGINT)
        append(journal, 2)
    assert sensor_numbers(path) == [1]


@given(
    st.sampled_from(["float64", "float32", "int64", "int32", "uint8", "uint64", "bool"]), st.integers(0, 3), st.data()
)
def test_every_dtype_and_shape_is_kept(dtype: str, axes: int, draw: st.DataObject) -> None:
    """A row's array comes back with dtype, shape and every bit."""
    shape = tuple(draw.draw(st.integers(0, 3)) for _ in range(axes))
    raw = draw.draw(st.binary(min_size=8 * 27, max_size=8 * 27))
    count = int(np.prod(shape, dtype=int))
    bits = np.frombuffer(raw, np.uint8) % 2 if dtype == "bool" else np.frombuffer(raw, np.uint8)
    array = bits[: count * np.dtype(dtype).itemsize].view(dtype).reshape(shape)
    stream = Stream(RUN, (Field("x", dtype, shape), Field("b", "blobs")), {})
    back = decode(stream, module._encode(stream, {"x": array, "b": b"tail"}))
    assert isinstance(back["x"], np.ndarray) and back["x"].dtype == array.dtype and back["x"].shape == shape
    assert back["x"].tobytes() == array.tobytes() and back["b"] == b"tail"


def test_empty_and_foreign_files_are_no_journals(tmp_path: Path) -> None:
    """Neither is read as one without rows."""
    for content in (b"", b"t_s,x\n0,1\n", b"r2s2r-journal 1 99999999999999999999 1\n", b"r2s2r-journal 1 -1 0\n"):
        (tmp_path / "x.journal").write_bytes(content)
        with pytest.raises(ArtifactError):
            read_head(tmp_path / "x.journal")


def test_a_pipe_in_the_place_of_a_journal_is_not_waited_for(tmp_path: Path) -> None:
    """To open one without a writer would block for ever: the test would never end."""
    pipe = tmp_path / "10-record.h5.journal"
    os.mkfifo(pipe)
    with pytest.raises(ArtifactError, match="no regular file") as caught, unwatched(pipe):
        pass
    assert caught.value.hint == f"ls -la {pipe}" and caught.value.received


def test_sensor_row_tells_its_number() -> None:
    """The rows that these tests write are all different."""
    assert len({str(sensor_row(i)) for i in range(50)}) == 50 == len({image(i) for i in range(50)})
    assert isinstance(head(), JournalHead)
