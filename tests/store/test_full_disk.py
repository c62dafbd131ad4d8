"""A full disk: an error in words, nothing half-written, and everything that was there is still there."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path
from random import Random

import h5py
import numpy as np
import pytest

from r2s2r_cli.artifact import Group
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.hdf5_file import Sink, writable
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.journal import Journal
from r2s2r_cli.store.migrate import migrate_file
from r2s2r_cli.store.read import checked_header, read_artifact
from r2s2r_cli.store.recover import recover_file
from r2s2r_cli.store.seal import seal
from r2s2r_cli.store.write import write_artifact
from tests.store.conftest import Copy
from tests.store.test_crash import check_record, check_write
from tests.store.test_seal import check_rows
from tests.support import recorder
from tests.support.builders import provenance, recording, simulation
from tests.support.layouts import same
from tests.support.nursery import Nursery
from tests.support.small_disk import PAGE, SmallDisk, small_disk
from tests.support.versions import current, write_toy


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    """A disk of 1 MB."""
    with small_disk(tmp_path / "disk", 1 << 20) as mounted:
        yield mounted


def test_writing_with_any_limit_of_file_size(nursery: Nursery, tmp_path: Path) -> None:
    """Wherever the writer is stopped, it ends with 4, does not crash, and leaves no unfinished file."""
    whole = write_artifact(tmp_path / "x.h5", simulation(10), provenance())
    size = whole.body_offset + whole.body_bytes
    codes = []
    for limit in range(0, size + 2000, 2600):
        folder = tmp_path / str(limit)
        folder.mkdir()
        answer = nursery.run("write", folder, limit=limit)
        codes.append(answer["code"])
        assert not list(folder.glob(".*"))
        check_write(folder, answer)
    assert set(codes) == {0, 4} and codes == sorted(codes, reverse=True)


def test_recording_with_any_limit_of_file_size(nursery: Nursery, tmp_path: Path) -> None:
    """The rows before the limit are all there and the recorder ends with 4."""
    for limit in (0, 100, 5000, 20_000, 20_001, 20_029, 54_321):
        folder = tmp_path / str(limit)
        folder.mkdir()
        answer = nursery.run("record", folder, limit=limit)
        assert answer["code"] == 4
        check_record(folder, answer)


def test_writing_on_a_full_disk(nursery: Nursery, disk: SmallDisk) -> None:
    """With any number of free pages: the artifact stands, or there is none and no temp file either."""
    write_artifact(disk.path / "simulation.h5", simulation(8), provenance())
    before = (disk.path / "simulation.h5").read_bytes()
    codes = []
    for pages in range(0, 24, 6):
        disk.fill(leave=pages * PAGE)
        codes.append(nursery.run("write", disk.path)["code"])
        assert disk.names() == {"simulation.h5"}
        checked_header(disk.path / "simulation.h5")
        if codes[-1] == 4:
            (disk.path / "simulation.h5").write_bytes(before)
    assert set(codes) == {0, 4}


def test_the_message_says_how_much_is_free(disk: SmallDisk) -> None:
    """What, where, expected, received, and a command that shows the disk."""
    disk.fill()
    with pytest.raises(ArtifactError, match="disk is full") as caught:
        write_artifact(disk.path / "x.h5", recording(), provenance())
    assert caught.value.exit_code == 4 and "MB free" in caught.value.received
    assert caught.value.hint == f"df -h {disk.path}" and disk.names() == set()


def test_recording_goes_on_when_there_is_space_again(disk: SmallDisk) -> None:
    """Rows before the full disk and after it are sealed; the one that did not fit raised an error."""
    path = disk.path / "10-record.h5.journal"
    with Journal(path, recorder.head()) as journal:
        for number in range(100):
            recorder.append(journal, number)
        disk.fill()
        with pytest.raises(ArtifactError, match="disk is full"):
            for _ in range(1000):
                journal.append(recorder.SENSORS, recorder.sensor_row(-1))
        size = path.stat().st_size
        disk.empty()
        journal.append(recorder.SENSORS, recorder.sensor_row(-2))
    assert path.stat().st_size > size
    rows = seal(path, disk.path / "10-record.h5")
    assert rows.torn_bytes == rows.lost_bytes == 0
    _, data = read_artifact(disk.path / "10-record.h5")
    numbers = data.groups[recorder.RUN + "/sensors"]["capacitance"][:, 0]
    assert numbers[:100].tolist() == list(range(100)) and set(numbers[100:-1]) <= {-1.0} and numbers[-1] == -2


def test_a_disk_that_refuses_to_sync_is_the_disks_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """File systems that reserve no space say so when bytes are to reach the disk: an error in words all the same."""
    path = tmp_path / "10-record.h5.journal"

    def refused(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with Journal(path, recorder.head()) as journal:
        recorder.append(journal, 0)
        monkeypatch.setattr("r2s2r_cli.store.journal.SYNC_INTERVAL_S", -1.0)
        with monkeypatch.context() as patched, pytest.raises(ArtifactError, match="disk is full"):
            patched.setattr(os, "fdatasync", refused)
            recorder.append(journal, 1)
    assert seal(path, tmp_path / "10-record.h5").header is not None


def test_a_journal_that_finds_no_space_leaves_nothing(disk: SmallDisk) -> None:
    """Where not even its head can be written there is no journal in the way of the next attempt."""
    disk.fill()
    with pytest.raises(ArtifactError):
        Journal(disk.path / "x.journal", recorder.head())
    assert disk.names() == set()
    disk.empty()
    Journal(disk.path / "x.journal", recorder.head()).close()


def test_sealing_without_space_keeps_the_journal(disk: SmallDisk) -> None:
    """The journal is untouched, and sealing works once there is space."""
    journal, target = disk.path / "10-record.h5.journal", disk.path / "10-record.h5"
    recorder.write(journal, 300)
    before = journal.read_bytes()
    disk.fill(leave=3 * PAGE)
    with pytest.raises(ArtifactError, match="disk is full"):
        seal(journal, target)
    assert disk.names() == {journal.name} and journal.read_bytes() == before
    disk.empty()
    seal(journal, target)
    check_rows(target, 300)


def test_migrating_without_space_keeps_the_artifact(disk: SmallDisk) -> None:
    """The old artifact has both its names, and is whole."""
    path = disk.path / "90-toy.h5"
    write_toy(path)
    before = path.read_bytes()
    disk.fill(leave=PAGE)
    with current(3):
        with pytest.raises(ArtifactError, match="disk is full"):
            migrate_file(path)
        assert path.read_bytes() == before
        disk.empty()
        migrate_file(path)
    assert disk.names() == {"90-toy.h5", "90-toy.h5.v1"}


@pytest.mark.parametrize("place", [300, -2000], ids=["head, restorable", "body, to be rescued"])
def test_recovering_without_space_loses_nothing(
    disk: SmallDisk, golden: Copy, reader: IsolatedReader, place: int
) -> None:
    """The damaged file stays, no half rescue is left, and the error names the disk."""
    path = disk.path / "recording.h5"
    damaged = bytearray(golden("recording").read_bytes())
    damaged[place] ^= 1
    path.write_bytes(damaged)
    disk.fill(leave=PAGE)
    with pytest.raises(ArtifactError, match="disk is full"):
        recover_file(path, reader)
    assert path.read_bytes() == bytes(damaged)
    assert all(name.startswith("recording.h5") for name in disk.names())
    assert not [name for name in disk.names() if name.endswith(".npz")]


def test_a_dataset_that_the_disk_has_no_room_for_is_not_called_damaged(disk: SmallDisk, reader: IsolatedReader) -> None:
    """Others fit and are read; a rescue without this one, which is whole, would say that its data are lost."""
    path = disk.path / "simulation.h5"
    data = simulation(10_000)
    frames = {name: np.zeros_like(value) for name, value in data.groups["runs/walk/frames"].datasets.items()}
    data.groups["runs/walk/frames"] = Group(frames)
    write_artifact(path, data, provenance())
    with h5py.File(path, "r+") as file:
        file["runs/walk/policy/target"][0, 0] = 0.5
    assert path.stat().st_size < disk.free() < frames["p_WE"].nbytes
    with pytest.raises(ArtifactError, match="disk is full") as caught:
        recover_file(path, reader)
    assert caught.value.where == f"{path}.rescued.npz"
    assert disk.names() == {"simulation.h5"}


def test_the_sink_serves_hdf5_what_the_disk_refused(tmp_path: Path) -> None:
    """After the disk has refused, HDF5 still reads back every byte that it wrote, and can go on to its end."""
    random = Random(0)
    truth = bytearray()
    sink = Sink(tmp_path / "x")
    for number in range(300):
        if number == 100:
            sink.failure = OSError(28, "No space left on device")
        start, data = random.randrange(5000), random.randbytes(random.randrange(1, 400))
        sink.seek(start)
        sink.write(data)
        truth.extend(bytes(max(0, start + len(data) - len(truth))))
        truth[start : start + len(data)] = data
        start, length = random.randrange(6000), random.randrange(1, 500)
        sink.seek(start)
        assert sink.read(length) == bytes(truth[start : start + length]).ljust(length, b"\0")
    assert sink.seek(0, 2) == len(truth)
    sink.close()


def test_a_refusal_is_raised_at_the_end_at_the_latest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nobody asks between the blocks, closing the file raises what the disk said, and HDF5 is sound after it."""
    whole = os.pwrite

    def refuse(descriptor: int, data: bytes, offset: int) -> int:
        if offset > 3000:
            raise OSError(28, "No space left on device")
        return whole(descriptor, data, offset)

    monkeypatch.setattr(os, "pwrite", refuse)
    with pytest.raises(OSError, match="No space") as caught, writable(tmp_path / "x.h5", "w") as (file, _):
        file["a"] = np.arange(100_000)
        file.flush()
        file["b"] = np.arange(100_000)
    assert caught.value.errno == 28
    monkeypatch.undo()
    with writable(tmp_path / "y.h5", "w") as (file, check):
        file["a"] = np.arange(3)
        check()
    with h5py.File(tmp_path / "y.h5") as file:
        assert file["a"][()].tolist() == [0, 1, 2]


def test_simulations_of_two_lengths_differ() -> None:
    """What the crash tests tell versions apart by."""
    assert not same(simulation(8), simulation(9))
