"""Artifacts to work on."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from r2s2r_cli.store.isolated import IsolatedReader
from schemas.versions import KINDS
from tests.support.make_golden import golden_path, make
from tests.support.nursery import Nursery

Copy = Callable[[str], Path]


@pytest.fixture
def golden(tmp_path: Path) -> Copy:
    """A function that puts a copy of the golden artifact of a kind into the test's folder."""

    def copy(kind: str) -> Path:
        return Path(shutil.copyfile(golden_path(kind, KINDS[kind].version), tmp_path / f"{kind}.h5"))

    return copy


@pytest.fixture
def fresh(tmp_path: Path) -> Copy:
    """A function that writes the artifact of a kind as this version does, for what must hold byte by byte."""

    def write(kind: str) -> Path:
        path = tmp_path / f"{kind}.h5"
        make(kind, path)
        return path

    return write


@pytest.fixture(scope="session")
def reader() -> Iterator[IsolatedReader]:
    """One child process for all tests of a session."""
    with IsolatedReader() as shared:
        yield shared


@pytest.fixture(scope="session")
def nursery() -> Iterator[Nursery]:
    """One process that forks all victims."""
    process = Nursery()
    yield process
    process.close()
