"""Mutated artifacts through the commands that read them: `inspect`, `export`, `estimate`, `status`, `migrate`."""

from __future__ import annotations

import json
import shutil
import warnings
from pathlib import Path
from random import Random

import pytest

from r2s2r_cli.errors import ArtifactError, DamageWarning
from r2s2r_cli.store.isolated import IsolatedReader
from r2s2r_cli.store.read import checked_header, load
from schemas.results import ErrorResult
from tests.commands.conftest import invoke
from tests.support.layouts import same
from tests.support.make_golden import GOLDEN
from tests.support.mutate import KINDS_OF_DAMAGE, mutate
from tests.support.soak import drawn

FILES = sorted(GOLDEN.glob("*.h5"))


def mutants(folder: Path, count: int, seed: int, files: list[Path]) -> list[tuple[Path, Path]]:
    """Damaged copies, each with the file that it was made from."""
    random = Random(seed)
    made = []
    for number in range(count):
        source, damage = random.choice(files), random.choice(KINDS_OF_DAMAGE)
        path = Path(shutil.copy(source, folder / f"{number:04d}-{damage}.h5"))
        mutate(path, damage, random)
        made.append((path, source))
    return made


def check_refused(result: object, command: str, path: Path) -> None:
    """An error document with its facts, a hint, and no traceback."""
    assert "Traceback" not in result.stderr, (command, path, result.stderr)  # type: ignore[attr-defined]
    assert result.exit_code in (3, 4), (command, path, result.stderr)  # type: ignore[attr-defined]
    error = ErrorResult.model_validate(json.loads(result.stdout))  # type: ignore[attr-defined]
    assert error.what and error.where and error.hint and (error.expected or error.received)


def check_reading(folder: Path, count: int, seed: int) -> None:
    """Reading refuses, or every value is the original's; the file is not touched."""
    with IsolatedReader() as reader, warnings.catch_warnings():
        warnings.simplefilter("ignore", DamageWarning)
        for path, source in mutants(folder, count, seed, FILES):
            before = path.read_bytes()
            try:
                header = checked_header(path, reader=reader)
            except ArtifactError as error:
                assert error.what and error.where and error.hint and (error.expected or error.received)
            else:
                sealed = checked_header(source)
                assert header == sealed
                assert same(load(path, header, blobs=True), load(source, sealed, blobs=True))
            assert path.read_bytes() == before


def check_commands(folder: Path, count: int, seed: int, *commands: tuple[str, ...]) -> None:
    """The commands refuse, or do as with the original."""
    for path, _ in mutants(folder, count, seed, FILES):
        before = path.read_bytes()
        for command in commands:
            out = folder / "out" / path.stem
            places = ("--out", str(out)) if command[0] == "export" else ()
            result = invoke(command[0], str(path), *command[1:], *places, "--json")
            if result.exit_code != 0:
                check_refused(result, command[0], path)
                assert not out.exists()
        assert path.read_bytes() == before


def test_reading_mutants(tmp_path: Path) -> None:
    """Twenty mutants of all kinds."""
    check_reading(tmp_path, 20, seed=11)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(drawn(3, 10)))
def test_reading_many_mutants(tmp_path: Path, seed: int) -> None:
    """The same of 300, in a soak test of a thousand, a hundred a seed."""
    check_reading(tmp_path, 100, seed=200 + seed)


def test_inspecting_and_exporting_mutants(tmp_path: Path) -> None:
    """Four mutants of all kinds."""
    check_commands(tmp_path, 4, 12, ("inspect",), ("export", "--to", "npz"))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(drawn(1, 4)))
def test_inspecting_and_exporting_many_mutants(tmp_path: Path, seed: int) -> None:
    """The same of 25, in a soak test of a hundred, 25 a seed, to tables as well."""
    check_commands(tmp_path, 25, 300 + seed, ("inspect",), ("export", "--to", "npz"), ("export", "--to", "csv"))


def check_pipeline(project: Path, folder: Path, count: int, seed: int) -> None:
    """A damaged recording or estimate in its place: no command of the pipeline takes it for a sound one."""
    record, estimate = (project / "iterations" / "001" / name for name in ("10-record.h5", "20-estimate.h5"))
    sound = {path: path.read_bytes() for path in (record, estimate)}
    for path, source in mutants(folder, count, seed, [record, estimate]):
        for place, content in sound.items():
            place.write_bytes(content)
        source.write_bytes(path.read_bytes())
        for command in (("estimate", "--force"), ("status",), ("migrate",)):
            result = invoke(*command, "--json")
            assert "Traceback" not in result.stderr, (command, path, result.stderr)
            assert result.exit_code in (0, 4), (command, path, result.stderr)
            json.loads(result.stdout)
            if command[0] == "estimate" and source == record:
                assert record.read_bytes() == path.read_bytes()


def test_a_damaged_artifact_in_its_place(estimated: Path, tmp_path: Path) -> None:
    """Three mutants in the place of a recording or estimate."""
    check_pipeline(estimated, tmp_path, 3, seed=13)


@pytest.mark.slow
def test_many_damaged_artifacts_in_their_place(estimated: Path, tmp_path: Path) -> None:
    """The same of ten, in a soak test of thirty."""
    check_pipeline(estimated, tmp_path, drawn(10, 30), seed=14)
