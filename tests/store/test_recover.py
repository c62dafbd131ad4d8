"""Recovery: what the digests prove is restored, what can be read is rescued, nothing is lost or overwritten."""

from __future__ import annotations

import json
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from random import Random

import h5py
import numpy as np
import pytest

from r2s2r_cli.errors import ArtifactError, DamageWarning, R2S2RError
from r2s2r_cli.store.header import MAGIC, block, read_header
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.read import checked_header, read_artifact
from r2s2r_cli.store.recover import recover_file
from r2s2r_cli.store.write import write_artifact
from schemas.versions import KINDS
from tests.store.conftest import Copy
from tests.support import builders, recorder
from tests.support.layouts import same
from tests.support.mutate import KINDS_OF_DAMAGE, mutate
from tests.support.soak import drawn

Damage = Callable[[bytearray, int], None]


def in_head(data: bytearray, body: int) -> None:
    """One bit of the JSON in the head."""
    del body
    data[len(MAGIC) + 200] ^= 1


def head_gone(data: bytearray, body: int) -> None:
    """The whole user block zeroed."""
    data[:body] = bytes(body)


def padding(data: bytearray, body: int) -> None:
    """The last spaces of the user block, and bytes behind the body: nothing reads them."""
    data[body - 9 : body - 1] = b"\0" * 8
    data += b"tail"


RESTORABLE: list[Damage] = [in_head, head_gone, padding]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("damage", RESTORABLE)
def test_what_the_digests_prove_is_restored(fresh: Copy, reader: IsolatedReader, kind: str, damage: Damage) -> None:
    """The file is again the one that was written, byte by byte, and the damaged one has a name of its own."""
    path = fresh(kind)
    original, data = path.read_bytes(), bytearray(path.read_bytes())
    damage(data, read_header(path).body_offset)
    path.write_bytes(data)
    result = recover_file(path, reader)
    assert result.changed and path.read_bytes() == original
    assert path.with_name(f"{path.name}.damaged").read_bytes() == bytes(data)
    assert not recover_file(path, reader).changed


def test_an_intact_artifact_is_left_alone(golden: Copy, reader: IsolatedReader) -> None:
    """Nothing is written."""
    path = golden("recording")
    result = recover_file(path, reader)
    assert not result.changed and [p.name for p in path.parent.iterdir()] == [path.name]


def test_changed_descriptions_are_written_again_from_the_schema(fresh: Copy, reader: IsolatedReader) -> None:
    """All numbers are proven by the head: the artifact comes back with the content and the provenance that it had."""
    path = fresh("recording")
    sealed, before = read_artifact(path, blobs=True)
    with h5py.File(path, "r+") as file:
        file["runs/walk/caps/t"].attrs["description"] = np.bytes_("something else")
        file.attrs["note"] = np.bytes_("mine")
    assert "restored" in recover_file(path, reader).words
    header, after = read_artifact(path, blobs=True)
    assert header == sealed and same(before, after)


def rescued(path: Path, reader: IsolatedReader) -> tuple[ArtifactError, dict[str, np.ndarray], dict]:
    """The error, arrays and report of an artifact that cannot be restored; it stays as it is."""
    before = path.read_bytes()
    with pytest.raises(ArtifactError, match="cannot be restored") as caught:
        recover_file(path, reader)
    assert path.read_bytes() == before
    archive = path.with_name(f"{path.name}.rescued.npz")
    with zipfile.ZipFile(archive) as file:
        report = json.loads(file.read("README.json"))
    with np.load(archive, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files if name != "README.json"}
    return caught.value, arrays, report


def test_one_damaged_dataset_costs_that_dataset_only(golden: Copy, reader: IsolatedReader) -> None:
    """All others are in the rescue with exactly their values; the lost one is named."""
    path = golden("recording")
    with h5py.File(path) as file:
        expected = {n: file[n][()] for n in read_header(path).datasets}
        place = file["runs/walk/caps/p_WE"].id.get_chunk_info(0).byte_offset
    data = bytearray(path.read_bytes())
    data[place + 5] ^= 1
    path.write_bytes(data)
    error, arrays, report = rescued(path, reader)
    assert "runs/walk/caps/p_WE" in error.received and set(report["lost"]) == {"runs/walk/caps/p_WE"}
    assert set(arrays) == set(expected) - set(report["lost"]) == set(report["proven"])
    for name, array in arrays.items():
        assert array.dtype == expected[name].dtype and array.tobytes() == expected[name].tobytes()
    assert report["attributes"]["runs/walk"]["robot"] == "threebar"
    assert report["head"]["provenance"]["argv"] == ["r2s2r", "import", "walk.csv"]


def test_what_another_program_made_is_hinted_by_no_command_of_it(tmp_path: Path, reader: IsolatedReader) -> None:
    """Its command line can be pasted nowhere: what was rescued is shown."""
    path = tmp_path / "policies.h5"
    write_artifact(path, builders.policy(), builders.provenance(stage="collect", argv=("make.py", "out")))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.9)])
    error, _, _ = rescued(path, reader)
    assert error.hint == f"unzip -p {path}.rescued.npz README.json"


def test_a_file_cut_off_gives_what_was_before_the_cut(golden: Copy, reader: IsolatedReader) -> None:
    """HDF5 opens no file that is too short; its first datasets are rescued all the same."""
    path = golden("estimate")
    with h5py.File(path) as file:
        expected = {n: file[n][()] for n in read_header(path).datasets}
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.9)])
    _, arrays, report = rescued(path, reader)
    assert 0 < len(arrays) < len(expected) and set(report["lost"]) == set(expected) - set(arrays)
    assert all(arrays[name].tobytes() == expected[name].tobytes() for name in arrays)
    assert not list(path.parent.glob(".*"))


def test_a_number_that_was_edited_is_not_passed_off_as_sealed(golden: Copy, reader: IsolatedReader) -> None:
    """Readable and changed is not rescued as proven; the damaged file keeps it."""
    path = golden("policy")
    with h5py.File(path, "r+") as file:
        file["policies/walk/target"][0, 0] = 0.5
    _, arrays, report = rescued(path, reader)
    assert report["lost"] == {"policies/walk/target": "the data changed after sealing"}
    assert "policies/walk/target" not in arrays


def test_without_head_and_with_damage_nothing_is_called_proven(golden: Copy, reader: IsolatedReader) -> None:
    """The digests of single datasets stood in the head: what is read now is marked as unproven."""
    path = golden("policy")
    with h5py.File(path, "r+") as file:
        file["policies/walk/target"][0, 0] = 0.5
    data = bytearray(path.read_bytes())
    in_head(data, 0)
    path.write_bytes(data)
    _, arrays, report = rescued(path, reader)
    assert report["proven"] == [] and set(report["unproven"]) == set(arrays) and report["head"] is None


def test_rescuing_twice_gives_one_rescue(golden: Copy, reader: IsolatedReader) -> None:
    """The same rescue is not written twice, another one gets another name."""
    path = golden("policy")
    original = path.read_bytes()
    for number, value in ((1, 0.5), (1, 0.5), (2, 0.25)):
        path.write_bytes(original)
        with h5py.File(path, "r+") as file:
            file["policies/walk/target" if number == 1 else "policies/rest/target"][0, 0] = value
        with pytest.raises(ArtifactError):
            recover_file(path, reader)
        assert len(list(path.parent.glob("*.npz"))) == number


@pytest.mark.parametrize("name", ["policy.h5", "r[1].h5"])
def test_no_rescue_is_lost_to_a_later_one(golden: Copy, reader: IsolatedReader, name: str) -> None:
    """Whatever became of the first rescue, and whatever the file is called, another one takes a free name."""
    path = golden("policy").rename(golden("policy").with_name(name))
    original = path.read_bytes()
    kept: list[bytes] = []
    for value in (0.5, 0.25, 0.125):
        path.write_bytes(original)
        with h5py.File(path, "r+") as file:
            file["policies/walk/target" if value == 0.5 else "policies/rest/target"][0, 0] = value
            if value == 0.125:
                file["policies/walk/target"][0, 0] = value
        with pytest.raises(ArtifactError) as caught:
            recover_file(path, reader)
        archive = Path(caught.value.where.rpartition("rescued into ")[2])
        assert archive.exists() and archive.read_bytes() not in kept
        kept.append(archive.read_bytes())
        if value == 0.25:
            path.with_name(f"{name}.rescued.npz").rename(path.with_name("moved.npz"))
    assert sorted(kept) == sorted(one.read_bytes() for one in path.parent.glob("*.npz"))


@pytest.mark.parametrize("content", [b"", b"x" * 9000, b"\x89HDF\r\n\x1a\n" + bytes(9000)])
def test_what_is_no_artifact_is_said_to_be_none(tmp_path: Path, reader: IsolatedReader, content: bytes) -> None:
    """Other files are refused and stay."""
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    with pytest.raises(ArtifactError, match="no artifact"):
        recover_file(path, reader)
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_a_journal_becomes_its_artifact(tmp_path: Path, reader: IsolatedReader) -> None:
    """The name of the journal says which one; the rows are counted."""
    recorder.write(tmp_path / "10-record.h5.journal", 8)
    result = recover_file(tmp_path / "10-record.h5.journal", reader)
    assert result.rows == recorder.counts(8) and [p.name for p in tmp_path.iterdir()] == ["10-record.h5"]
    _, data = read_artifact(tmp_path / "10-record.h5")
    assert data.groups[recorder.RUN].attributes["recovered"] is True


def check_no_loss(path: Path, original: bytes, reader: IsolatedReader) -> str:
    """Recover one damaged file. Its bytes are still there afterwards, and what is restored is the original content."""
    damaged = path.read_bytes()
    try:
        outcome = recover_file(path, reader).words
    except R2S2RError as error:
        assert error.exit_code == 4 and error.what and error.hint
        outcome = "refused"
    assert damaged in [p.read_bytes() for p in path.parent.glob(f"{path.name}*")]
    if outcome != "refused":
        path.with_name("original.h5").write_bytes(original)
        with warnings.catch_warnings():
            warnings.simplefilter("error", DamageWarning)
            header = checked_header(path, reader=reader)
        assert header.content_sha256 == read_header(path.with_name("original.h5")).content_sha256
    for archive in path.parent.glob("*.npz"):
        with zipfile.ZipFile(archive) as file:
            proven = json.loads(file.read("README.json"))["proven"]
        with np.load(archive) as arrays, h5py.File(path.with_name("golden.h5"), "r") as file:
            assert all(arrays[name].tobytes() == file[name][()].tobytes() for name in proven)
    assert not [p for p in path.parent.iterdir() if p.name.startswith(".")]
    return outcome


def fuzz(tmp_path: Path, golden: Copy, reader: IsolatedReader, count: int, seed: int) -> None:
    """Recover mutated artifacts of all kinds."""
    random = Random(seed)
    outcomes = set()
    for number in range(count):
        source = golden(random.choice(sorted(KINDS)))
        folder = tmp_path / str(number)
        folder.mkdir()
        path = folder / "x.h5"
        for name in ("x.h5", "golden.h5"):
            (folder / name).write_bytes(source.read_bytes())
        mutate(path, random.choice(KINDS_OF_DAMAGE), random)
        outcomes.add(check_no_loss(path, source.read_bytes(), reader).split(":")[0])
    assert {"refused", "restored"} <= outcomes


def test_recovering_mutated_artifacts_loses_nothing(tmp_path: Path, golden: Copy, reader: IsolatedReader) -> None:
    """Eighteen mutants: restored to the sealed content, or refused with the damaged bytes kept."""
    fuzz(tmp_path, golden, reader, 18, seed=4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(drawn(2, 5)))
def test_recovering_many_mutated_artifacts_loses_nothing(
    tmp_path: Path, golden: Copy, reader: IsolatedReader, seed: int
) -> None:
    """The same of 200, in a soak test 500, a hundred a seed."""
    fuzz(tmp_path, golden, reader, 100, seed=50 + seed)


def test_block_of_a_header_is_what_stands_in_the_file(fresh: Copy) -> None:
    """Restoring rests on this: the block made from a header is the block that was written."""
    path = fresh("simulation")
    header = read_header(path)
    assert path.read_bytes()[: header.body_offset] == block(header)
