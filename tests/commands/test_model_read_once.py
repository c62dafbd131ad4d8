"""The head of an identification that is named with --model is read once: what was checked is what is noted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import r2s2r_cli.store.header as headers
from r2s2r_cli.commands.compare_inputs import Asked as CompareAsked
from r2s2r_cli.commands.diagnose_inputs import Asked as DiagnoseAsked
from r2s2r_cli.commands.simulate_inputs import Asked as SimulateAsked
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.write import write_artifact
from schemas.header import Header, InputRef
from tests.support import builders

Refs = Callable[[Project, Iteration, Path], list[InputRef]]


@pytest.mark.parametrize(
    "refs",
    [
        lambda here, place, model: CompareAsked(here, place, (f"a={model}", f"b={model}"), None).refs(),
        lambda here, place, model: DiagnoseAsked(here, place, model=model).refs(),
        lambda here, place, model: SimulateAsked(here, place, (), 4, 0, (), None, model).refs(),
    ],
    ids=["compare", "diagnose", "simulate"],
)
def test_a_named_identification_is_read_once(estimated: Path, monkeypatch: pytest.MonkeyPatch, refs: Refs) -> None:
    """Another file under its name between two readings would pass for the one that was checked."""
    model = estimated / "other.h5"
    made = write_artifact(model, builders.identification(), builders.provenance(stage="identify", inputs=()))
    read: list[Path] = []
    whole = headers.whole_header

    def counted(path: Path) -> Header:
        read.append(path)
        return whole(path)

    monkeypatch.setattr(headers, "whole_header", counted)
    here = Project.find(estimated)
    found = {ref.path: ref.sha256 for ref in refs(here, here.iteration(1), model)}
    assert found["other.h5"] == made.content_sha256
    assert read.count(model) == 1
