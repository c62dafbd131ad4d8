"""From journal to artifact: every row, once, and never over something else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store import seal as module
from r2s2r_cli.store.journal import Field, Journal, Stream
from r2s2r_cli.store.journal_read import fixed_place, read_field, read_head, records
from r2s2r_cli.store.newer import newer_r2s2r
from r2s2r_cli.store.read import read_artifact
from r2s2r_cli.store.seal import Late, seal
from r2s2r_cli.store.write import write_artifact
from schemas.versions import KINDS, MIGRATIONS
from tests.support.builders import provenance, recording
from tests.support.layouts import materialised
from tests.support.recorder import COLOR, RUN, SENSORS, append, counts, head, image, write


def paths(folder: Path) -> tuple[Path, Path]:
    """Journal and artifact."""
    return folder / "10-record.h5.journal", folder / "10-record.h5"


def content(target: Path) -> dict[str, dict[str, Any]]:
    """All values of the sealed recording."""
    return materialised(read_artifact(target, "recording", blobs=True)[1])


def check_rows(target: Path, rows: int) -> None:
    """The recording holds exactly the rows that `write(rows)` appended."""
    found = content(target)
    sensors, camera = found[f"{RUN}/sensors"], found[f"{RUN}/camera"]
    numbers = np.arange(rows, dtype=float)
    assert np.array_equal(sensors["capacitance"], np.stack([numbers, -numbers], axis=1))
    assert camera["color"] == [image(i) for i in range(0, rows, 3)]
    assert camera["depth"] == [image(i + 1) for i in range(0, rows, 5)]
    assert len(camera["t"]) == len(camera["color"]) and len(camera["t_depth"]) == len(camera["depth"])


def test_all_rows_of_all_streams_are_sealed(tmp_path: Path) -> None:
    """Two streams of one group at different rates and one of another group; then the journal is gone."""
    journal, target = paths(tmp_path)
    write(journal, 700)  # more than one block of rows
    result = seal(journal, target)
    check_rows(target, 700)
    assert result.rows == counts(700) and (result.torn_bytes, result.lost_bytes) == (0, 0)
    assert list(tmp_path.iterdir()) == [target]


def test_what_is_known_late_is_sealed_with_it(tmp_path: Path) -> None:
    """Report, duration and drawings go into the provenance, attributes to their group; a run not begun is left out."""
    journal, target = paths(tmp_path)
    begun = head()
    with Journal(journal, replace(begun, groups={**begun.groups, "runs/never": dict(begun.groups[RUN])})) as rows:
        append(rows, 0)
    late = Late(12.5, {"runs": 1}, ("10-record.html",), {RUN: {"start_unix": 7.0}})
    result = seal(journal, target, late=late)
    assert result.header is not None
    made = result.header.provenance
    assert (made.wall_s, made.report, made.drawings) == (12.5, {"runs": 1}, ("10-record.html",))
    _, data = read_artifact(target, "recording")
    assert data.runs() == ["walk"] and data.groups[RUN].attributes["start_unix"] == 7.0


def test_a_stream_without_rows_beside_one_with_some_is_empty(tmp_path: Path) -> None:
    """Killed after the first picture and before its depth: the group is whole, its depth has no frame."""
    journal, target = paths(tmp_path)
    with Journal(journal, head()) as rows:
        rows.append(COLOR, {"t": 0.0, "color": image(0)})
    seal(journal, target)
    camera = content(target)[f"{RUN}/camera"]
    assert camera["color"] == [image(0)] and camera["depth"] == [] and len(camera["t_depth"]) == 0
    assert f"{RUN}/sensors" not in content(target)


def test_a_recovery_after_sealing_knows_its_own_artifact(tmp_path: Path) -> None:
    """Killed between sealing with a report and tidying up: the journal's artifact is recognised without the report."""
    journal, target = paths(tmp_path)
    write(journal, 10)
    kept = journal.read_bytes()
    first = seal(journal, target, late=Late(1.0, {"runs": 1}))
    journal.write_bytes(kept)
    again = seal(journal, target, recovered=True)
    assert again.header == first.header and not journal.exists()


def test_provenance_is_the_recorder_s(tmp_path: Path) -> None:
    """The artifact says how it was recorded, not how it was sealed."""
    journal, target = paths(tmp_path)
    write(journal, 1, seed=7)
    result = seal(journal, target)
    assert result.header is not None and result.header.provenance == provenance(stage="record", seed=7)


def test_recovered_runs_are_marked(tmp_path: Path) -> None:
    """After a crash the run says so, otherwise it says nothing."""
    for name, recovered in (("a", True), ("b", False)):
        journal, target = paths(tmp_path / name)
        write(journal, 1)
        seal(journal, target, recovered=recovered)
        assert content(target)[RUN]["attributes"].get("recovered", False) is recovered


def test_a_stream_without_rows_has_no_group(tmp_path: Path) -> None:
    """A camera that never sent a frame leaves no empty group behind."""
    journal, target = paths(tmp_path)
    with Journal(journal, head()) as open_journal:
        append(open_journal, 1)
    seal(journal, target)
    assert set(content(target)) == {RUN, f"{RUN}/sensors"}


def test_a_torn_last_row_is_left_out(tmp_path: Path) -> None:
    """The rows before it are sealed and the loss is counted."""
    journal, target = paths(tmp_path)
    write(journal, 5)
    journal.write_bytes(journal.read_bytes()[:-3])
    result = seal(journal, target)
    assert result.torn_bytes > 0 and result.rows == {**counts(5), f"{RUN}/sensors": 4}


@pytest.mark.parametrize("torn", [0, 3], ids=["whole", "torn"])
def test_damage_at_the_end_is_no_torn_row(tmp_path: Path, torn: int) -> None:
    """Records that are all there, with a wrong checksum, are damaged bytes, which are kept; what is cut off is not."""
    journal, target = paths(tmp_path)
    write(journal, 9)
    places = list(records(journal))
    damaged = bytearray(journal.read_bytes())
    for place in places[-4:-1]:
        damaged[place.offset + place.length - 1] ^= 1
    damaged[places[-1].offset + 9] ^= 0 if torn else 1
    journal.write_bytes(damaged[: len(damaged) - torn])
    result = seal(journal, target)
    last = places[-1].length + places[-1].offset - places[-1].start
    assert result.torn_bytes == (last - torn if torn else 0)
    assert result.lost_bytes == len(damaged) - places[-5].offset - places[-5].length - (last if torn else 0)
    assert sum(result.rows.values()) == len(places) - 4
    (kept,) = tmp_path.glob("*-damaged*")
    assert kept.read_bytes() == bytes(damaged[: len(damaged) - torn])


def test_a_damaged_stretch_keeps_the_journal(tmp_path: Path) -> None:
    """Rows around the damage are sealed, and the bytes stay, under names that overwrite nothing."""
    for number in (1, 2):
        journal, target = paths(tmp_path)
        write(journal, 9)
        damaged = bytearray(journal.read_bytes())
        damaged[-400] ^= 1
        journal.write_bytes(damaged)
        result = seal(journal, target)
        assert result.lost_bytes > 0 and sum(result.rows.values()) == sum(counts(9).values()) - 1
        target.unlink()
        kept = sorted(tmp_path.glob("*-damaged*"))
        assert len(kept) == number and kept[-1].read_bytes() == bytes(damaged)


@pytest.mark.parametrize("torn", [0, 5])
def test_a_journal_without_a_row_leaves_no_artifact(tmp_path: Path, torn: int) -> None:
    """Nothing was recorded: the journal goes; the bytes of a torn first row are kept."""
    journal, target = paths(tmp_path)
    write(journal, 0)
    with journal.open("ab") as file:
        file.write(b"R2SJ?"[:torn])
    result = seal(journal, target)
    assert result.header is None and not target.exists() and not journal.exists()
    assert len(list(tmp_path.iterdir())) == (1 if torn else 0)


def test_another_artifact_of_that_name_is_never_replaced(tmp_path: Path) -> None:
    """The journal stays, and so does what is in its way."""
    journal, target = paths(tmp_path)
    write_artifact(target, recording(), provenance())
    before = target.read_bytes()
    write(journal, 3)
    with pytest.raises(ArtifactError, match="exists already"):
        seal(journal, target)
    assert target.read_bytes() == before and journal.exists()


def test_a_kill_between_sealing_and_tidying_up_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Artifact and journal both there, from the same recording: the second attempt removes the journal only."""
    journal, target = paths(tmp_path)
    write(journal, 6)
    monkeypatch.setattr(module, "_remove", _killed)
    with pytest.raises(KeyboardInterrupt):
        seal(journal, target)
    monkeypatch.undo()
    before = target.read_bytes()
    assert seal(journal, target).rows == counts(6)
    assert target.read_bytes() == before and not journal.exists()


def test_the_same_provenance_with_other_rows_is_another_recording(tmp_path: Path) -> None:
    """Rows that the artifact does not have keep their journal."""
    journal, target = paths(tmp_path)
    write(journal, 6)
    seal(journal, target)
    write(journal, 7)
    with pytest.raises(ArtifactError, match="exists already"):
        seal(journal, target)
    assert journal.exists()


def test_a_journal_of_an_older_version_is_migrated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """r2s2r was upgraded between crash and recovery: the rows go through the same steps as artifacts do."""
    journal, target = paths(tmp_path)
    write(journal, 4)
    spec = KINDS["recording"].model_copy(update={"version": KINDS["recording"].version + 1})
    monkeypatch.setitem(KINDS, "recording", spec)

    def step(groups: Any) -> Any:
        walk = groups.pop(RUN)
        return {**groups, RUN: type(walk)(walk.datasets, {**walk.attributes, "source": "migrated"})}

    with pytest.raises(ArtifactError, match="another version") as caught:
        seal(journal, target)
    assert caught.value.hint == newer_r2s2r()
    monkeypatch.setitem(MIGRATIONS, ("recording", spec.version - 1), step)
    result = seal(journal, target)
    assert result.header is not None and result.header.schema_version == spec.version
    assert content(target)[RUN]["attributes"]["source"] == "migrated"


@pytest.mark.parametrize(("rows", "kept"), [(0, False), (1, False), (2, True)])
def test_a_torn_table_stops_no_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int, kept: bool
) -> None:
    """Cut off within the table that names the cable of each sensor: every reading is sealed, the torn table is not.
    Killed before it tidies up, it knows its own artifact again."""
    journal, target = paths(tmp_path)
    begun = head()
    table = Stream(SENSORS, (Field("cable", "int64"),), {}, "table")
    with Journal(journal, replace(begun, streams=(*begun.streams, table))) as open_journal:
        for cable in range(rows):
            open_journal.append(f"{SENSORS}:table", {"cable": cable + 3})
        for number in range(6):
            append(open_journal, number)
    monkeypatch.setattr(module, "_remove", _killed)
    with pytest.raises(KeyboardInterrupt):
        seal(journal, target)
    monkeypatch.undo()
    assert seal(journal, target).header is not None and not journal.exists()
    check_rows(target, 6)
    assert ("cable" in content(target)[SENSORS]) == kept
    if kept:
        assert content(target)[SENSORS]["cable"].tolist() == [3, 4]


def _killed(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_a_field_lies_where_the_journal_has_it(tmp_path: Path) -> None:
    """The place of every field of a fixed size gives the bytes that reading it row by row gives; behind an encoded one
    no field has a place."""
    write(tmp_path / "a.journal", 40)
    found, _ = read_head(tmp_path / "a.journal")
    data = (tmp_path / "a.journal").read_bytes()
    seen = set()
    with (tmp_path / "a.journal").open("rb") as file:
        for place in records(tmp_path / "a.journal"):
            stream = found.streams[place.stream]
            for field in stream.fields:
                there = fixed_place(stream, field.name)
                value = read_field(file, place.offset, stream, field.name)
                if there is None:
                    assert field.dtype == "blobs"
                    continue
                first = place.offset + there[0]
                assert data[first : first + there[1]] == np.asarray(value).tobytes()
                seen.add((place.stream, field.name))
    assert len(seen) == 4
    behind = Stream("a", (Field("x", "blobs"), Field("t", "float64")), {})
    assert fixed_place(behind, "t") is None and fixed_place(behind, "x") is None
    with pytest.raises(KeyError):
        fixed_place(behind, "y")
