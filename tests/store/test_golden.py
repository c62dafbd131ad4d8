"""Golden artifacts: what earlier versions wrote is read, validated and exported by this one."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pytest

from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.read import read_artifact
from schemas.results import ValidateResult
from schemas.versions import KINDS
from tests.commands.conftest import invoke
from tests.support.builders import BUILDERS, provenance
from tests.support.make_golden import GOLDEN, golden_path, make

FILES = sorted(GOLDEN.glob("*.h5"))
LARGEST = 100_000


def name(path: Path) -> str:
    """How tests show it."""
    return path.stem


def test_every_version_of_every_kind_has_a_golden_file() -> None:
    """A version without one could become unreadable unnoticed."""
    expected = {golden_path(kind, version) for kind, spec in KINDS.items() for version in range(1, spec.version + 1)}
    assert set(FILES) == expected and set(BUILDERS) == set(KINDS)


@pytest.mark.parametrize("path", FILES, ids=name)
def test_golden_files_are_small(path: Path) -> None:
    """Tens of kilobytes: they are in the repository for ever."""
    assert path.stat().st_size < LARGEST


@pytest.mark.parametrize("path", FILES, ids=name)
def test_golden_files_load(path: Path) -> None:
    """In the layout of the current version, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        header, data = read_artifact(path, blobs=True)
    kind, version = path.stem.rsplit("-", 1)
    assert (header.kind, header.schema_version, data.kind) == (kind, int(version), kind)
    assert header.provenance == provenance() and data.groups


@pytest.mark.parametrize("kind", KINDS)
def test_this_version_still_writes_what_it_wrote(tmp_path: Path, kind: str) -> None:
    """Same data, settings and version: the content hash of the golden file of the current version."""
    now = make(kind, tmp_path / "x.h5")
    assert now.content_sha256 == read_header(golden_path(kind, KINDS[kind].version)).content_sha256


def test_golden_files_validate() -> None:
    """Every check of every kind passes."""
    result = invoke("validate", *map(str, FILES), "--json")
    found = ValidateResult.model_validate(json.loads(result.stdout))
    assert result.exit_code == 0 and found.findings == () and len(found.files) == len(FILES)


@pytest.mark.parametrize("to", ["csv", "npz"])
@pytest.mark.parametrize("path", FILES, ids=name)
def test_golden_files_export(tmp_path: Path, path: Path, to: str) -> None:
    """Tables and arrays come out, and are not empty."""
    result = invoke("export", str(path), "--to", to, "--out", str(tmp_path), "--json")
    assert result.exit_code == 0, result.stderr
    files = json.loads(result.stdout)["files"]
    assert files and all(Path(file).stat().st_size > 0 for file in files)


@pytest.mark.parametrize("path", FILES, ids=name)
def test_golden_files_can_be_inspected(path: Path) -> None:
    """Header and tree are shown."""
    result = invoke("inspect", str(path))
    assert result.exit_code == 0 and read_header(path).content_sha256 in result.stdout
