"""Killed with SIGKILL at any moment: artifacts are whole or absent, recordings lose at most the last row."""

from __future__ import annotations

import shutil
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from random import Random

import pytest

from r2s2r_cli.store.atomic import sweep
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.read import checked_header, read_artifact
from r2s2r_cli.store.recover import recover_file
from r2s2r_cli.store.seal import seal
from tests.store.conftest import Copy
from tests.store.test_seal import check_rows
from tests.support import recorder
from tests.support.builders import simulation
from tests.support.layouts import same
from tests.support.nursery import Nursery
from tests.support.soak import drawn
from tests.support.versions import current, write_toy

Check = Callable[[Path, dict], None]
MANY = drawn(50, 200)
ROWS = 300


def only_artifacts(folder: Path) -> list[Path]:
    """What remains after sweeping: all of it artifacts, every one whole."""
    sweep(folder)
    found = sorted(folder.iterdir())
    for path in found:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            checked_header(path)
    return found


def check_write(folder: Path, answer: dict) -> None:
    """The artifact is the last one reported, or the one after it; before the first there may be none."""
    found = only_artifacts(folder)
    assert [path.name for path in found] in ([], ["simulation.h5"])
    versions = [simulation(frames) for frames in (8, 9, 10)]
    reported = answer["reported"]
    if not found:
        assert reported == 0
        return
    _, data = read_artifact(found[0])
    allowed = [versions[number % 3] for number in (reported - 1, reported) if number >= 0]
    assert any(same(data, version) for version in allowed)


def check_record(folder: Path, answer: dict) -> None:
    """Every row that `append` took is in the recovered recording, and at most one more."""
    sweep(folder)
    journal, target = folder / "10-record.h5.journal", folder / "10-record.h5"
    if not journal.exists():
        assert answer["reported"] == 0 and list(folder.iterdir()) == []
        return
    with IsolatedReader() as reader:
        rows = recover_file(journal, reader).rows
    sensors = rows.get(recorder.SENSORS, 0)
    assert answer["reported"] <= sensors <= answer["reported"] + 1
    if sensors == 0:
        assert not [path for path in folder.iterdir() if path.suffix == ".h5"]
        return
    whole = recorder.counts(sensors)
    if rows != whole:  # the last sensor row is there, its images are not: they were not appended yet
        assert sensors == answer["reported"] + 1
        whole = recorder.counts(sensors - 1)
        assert all(rows.get(key, 0) - whole.get(key, 0) in (0, 1) for key in rows)
    else:
        check_rows(target, sensors)
    assert target in only_artifacts_and_kept(folder)


def only_artifacts_and_kept(folder: Path) -> list[Path]:
    """As `only_artifacts`, with the bytes of a torn first row put aside."""
    for path in folder.glob("*-damaged"):
        path.unlink()
    return only_artifacts(folder)


def check_seal(folder: Path, answer: dict) -> None:
    """Whatever was reached, recovery ends with all rows in the artifact and no journal."""
    del answer
    sweep(folder)
    journal, target = folder / "10-record.h5.journal", folder / "10-record.h5"
    if target.exists():
        checked_header(target)
    if journal.exists():
        seal(journal, target)
    check_rows(target, ROWS)
    assert only_artifacts(folder) == [target]


def prepare(job: str, folder: Path, template: Path) -> Path:
    """An empty folder, or one with a journal of `ROWS` rows."""
    folder.mkdir()
    if job == "seal":
        if not template.exists():
            recorder.write(template, ROWS)
        shutil.copy(template, folder / "10-record.h5.journal")
    return folder


CHECKS: dict[str, Check] = {"write": check_write, "record": check_record, "seal": check_seal}


def lasting(nursery: Nursery, tmp_path: Path, job: str) -> float:
    """How long `job` takes here and now [s], the shorter of two runs, so that kills fall into all of its parts."""
    taken = []
    for number in range(2):
        folder = prepare(job, tmp_path / f"whole{number}", tmp_path / "template.journal")
        begun = time.monotonic()
        assert nursery.run(job, folder)["finished"]
        taken.append(time.monotonic() - begun)
        shutil.rmtree(folder)
    return min(taken)


def kill_at_random(nursery: Nursery, tmp_path: Path, job: str, count: int) -> None:
    """Kill `job` at `count` seeded random moments, and check what is left each time."""
    random = Random(job)
    killed = 0
    longest = lasting(nursery, tmp_path, job)
    for number in range(count):
        folder = prepare(job, tmp_path / str(number), tmp_path / "template.journal")
        answer = nursery.run(job, folder, delay=random.uniform(0, longest))
        killed += not answer["finished"]
        CHECKS[job](folder, answer)
        shutil.rmtree(folder)
    assert killed > count / 3, "the job was done before most kills: they proved nothing"


@pytest.mark.slow
@pytest.mark.parametrize("job", CHECKS)
def test_killed_at_random_moments(nursery: Nursery, tmp_path: Path, job: str) -> None:
    """Fifty kills each of writing, recording and sealing, in a soak test 200."""
    kill_at_random(nursery, tmp_path, job, MANY)


def kill_at_steps(nursery: Nursery, tmp_path: Path, job: str, steps: range) -> int:
    """Kill `job` before each of these disk-changing system calls; how many kills came before the end."""
    killed = 0
    for step in steps:
        folder = prepare(job, tmp_path / str(step), tmp_path / "template.journal")
        answer = nursery.run(job, folder, step=step)
        CHECKS[job](folder, answer)
        shutil.rmtree(folder)
        if answer["finished"]:
            assert answer["code"] == 0
            break
        killed += 1
    return killed


@pytest.mark.parametrize(("job", "stride"), [("write", 37), ("record", 1), ("seal", 7)])
def test_killed_before_system_calls(nursery: Nursery, tmp_path: Path, job: str, stride: int) -> None:
    """Kills before single writes, syncs, links, replacements and removals."""
    assert kill_at_steps(nursery, tmp_path, job, range(0, stride * 12, stride)) == 12


@pytest.mark.slow
@pytest.mark.parametrize("job", ["write", "seal"])
def test_killed_before_every_system_call(nursery: Nursery, tmp_path: Path, job: str) -> None:
    """The same before every fifth one, in a soak test before each, up to the end of the job (writing: over the first
    two artifacts)."""
    stride = drawn(5, 1)
    killed = kill_at_steps(nursery, tmp_path, job, range(0, 320 if job == "write" else 100_000, stride))
    assert killed > 50 / stride


def test_a_migration_killed_anywhere_can_be_repeated(nursery: Nursery, tmp_path: Path) -> None:
    """The artifact is the old one or the new one, whole; the second attempt ends with the new one and one old file."""
    from r2s2r_cli.store.migrate import migrate_file

    template = tmp_path / "template.h5"
    write_toy(template)
    step, finished = 0, False
    while not finished:
        folder = tmp_path / str(step)
        folder.mkdir()
        path = Path(shutil.copy(template, folder / "90-toy.h5"))
        finished = nursery.run("migrate", folder, step=step)["finished"]
        with current(3):
            sweep(folder)
            assert checked_header(path).schema_version in (1, 3)
            migrate_file(path)
            assert read_header(path).schema_version == 3
        assert (folder / "90-toy.h5.v1").read_bytes() == template.read_bytes() and len(list(folder.iterdir())) == 2
        step += 7
    assert step > 21


def test_a_restoration_killed_anywhere_can_be_repeated(nursery: Nursery, tmp_path: Path, fresh: Copy) -> None:
    """The damaged file is never gone, and the second attempt restores it."""
    original = fresh("policy").read_bytes()
    damaged = original[:300] + b"?" + original[301:]
    step, finished = 0, False
    while not finished:
        folder = tmp_path / str(step)
        folder.mkdir()
        path = folder / "policy.h5"
        path.write_bytes(damaged)
        finished = nursery.run("restore", folder, step=step)["finished"]
        sweep(folder)
        assert damaged in [p.read_bytes() for p in folder.iterdir()]
        with IsolatedReader() as reader:
            recover_file(path, reader)
        assert path.read_bytes() == original and (folder / "policy.h5.damaged").read_bytes() == damaged
        step += 2
    assert step > 4
