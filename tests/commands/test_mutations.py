"""Mutated artifacts of every kind: a finding with what, where, expected, received and a hint, never a traceback."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from random import Random

import pytest

from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.verify import verify
from schemas.results import ValidateResult
from tests.commands.conftest import invoke
from tests.support.mutate import KINDS_OF_DAMAGE, mutate
from tests.support.soak import drawn

GOLDEN = sorted((Path(__file__).resolve().parents[1] / "golden").glob("*.h5"))
A_CALL = 50
"""Files of one call: they share a child process, which is what costs time."""


def _mutants(folder: Path, count: int, seed: int) -> dict[str, Path]:
    """Damaged copies by path, with the file that each was made from."""
    random = Random(seed)
    made = {}
    for i in range(count):
        damage, source = random.choice(KINDS_OF_DAMAGE), random.choice(GOLDEN)
        path = folder / f"{i:04d}-{damage}-{source.name}"
        shutil.copy(source, path)
        mutate(path, damage, random)
        made[str(path)] = source
    return made


def _check(folder: Path, count: int, seed: int) -> None:
    made = _mutants(folder, count, seed)
    names = list(made)
    for start in range(0, count, A_CALL):
        call = names[start : start + A_CALL]
        result = invoke("validate", *call, "--json")
        assert result.exit_code in (0, 3, 4)
        assert "Traceback" not in result.stderr
        document = ValidateResult.model_validate(json.loads(result.stdout))
        assert document.files == tuple(call)
        errors = {finding.file for finding in document.findings if finding.importance == "error"}
        for finding in document.findings:
            assert finding.what and finding.expected and finding.received and finding.hint
        for name in set(call) - errors:
            assert read_header(Path(name)).content_sha256 == read_header(made[name]).content_sha256
            assert verify(name)["content_ok"]
        assert (result.exit_code == 0) == (errors == set())


def test_mutated_artifacts_are_findings(tmp_path: Path) -> None:
    """Twenty mutants: each is an error, or the content hash proves that nothing readable changed."""
    _check(tmp_path, 20, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(drawn(3, 10)))
def test_many_mutated_artifacts_are_findings(tmp_path: Path, seed: int) -> None:
    """The same of 300, in a soak test of a thousand, a hundred a seed."""
    _check(tmp_path, 100, seed=100 + seed)
