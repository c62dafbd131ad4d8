"""Writing: whole or not at all, and never something that the schema does not allow."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Blobs, Group, Rows
from r2s2r_cli.errors import ArtifactError
from r2s2r_cli.store.header import read_header
from r2s2r_cli.store.write import write_artifact
from tests.support.builders import policy, provenance, recording

FINE: dict[str, Any] = {"target": np.zeros((2, 6)), "hold": np.zeros(2), "timeout": np.ones(2)}
HEAD: dict[str, Any] = {"robot": "threebar", "repeat": 1}


def artifact(datasets: dict[str, Any], attributes: dict[str, Any], path: str = "policies/p") -> ArtifactData:
    """A policy artifact, right or wrong."""
    return ArtifactData("policy", {path: Group(datasets, attributes)})


WRONG = {
    "unknown dataset": artifact({**FINE, "speed": np.zeros(2)}, HEAD),
    "unknown group": artifact(FINE, HEAD, "gaits/p"),
    "name of a run that is no name": artifact(FINE, HEAD, "policies/../p"),
    "missing dataset": artifact({"target": FINE["target"], "hold": FINE["hold"]}, HEAD),
    "missing attribute": artifact(FINE, {"robot": "threebar"}),
    "unknown attribute": artifact(FINE, {**HEAD, "mood": "fine"}),
    "other dtype": artifact({**FINE, "hold": np.zeros(2, "float32")}, HEAD),
    "whole numbers for real ones": artifact({**FINE, "hold": np.zeros(2, int)}, HEAD),
    "other number of rows": artifact({**FINE, "hold": np.zeros(3)}, HEAD),
    "other number of axes": artifact({**FINE, "hold": np.zeros((2, 1))}, HEAD),
    "text for a number": artifact(FINE, {**HEAD, "repeat": "1"}),
    "NaN as attribute": artifact(FINE, {**HEAD, "repeat": float("nan")}),
    "NUL in text": artifact(FINE, {**HEAD, "robot": "three\0bar"}),
    "fewer rows than promised": artifact({**FINE, "hold": Rows([np.zeros(1)], (2,), np.dtype(float))}, HEAD),
    "more rows than promised": artifact({**FINE, "hold": Rows([np.zeros(3)], (2,), np.dtype(float))}, HEAD),
    "a block of another width": artifact({**FINE, "target": Rows([np.zeros((2, 5))], (2, 6), np.dtype(float))}, HEAD),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_departs_from_the_schema_is_not_written(tmp_path: Path, name: str) -> None:
    """A bug of the caller raises ValueError and leaves no file."""
    with pytest.raises(ValueError, match=r"."):
        write_artifact(tmp_path / "policies.h5", WRONG[name], provenance())
    assert list(tmp_path.iterdir()) == []


def test_fewer_images_than_promised_are_refused(tmp_path: Path) -> None:
    """A count of images that does not come true leaves no file."""
    run = recording().groups["runs/walk"]
    camera = Group({"t": np.arange(2.0), "color": Blobs([b"x"], 2)}, {"width": 1, "height": 1})
    with pytest.raises(ValueError, match="promised"):
        write_artifact(tmp_path / "x.h5", ArtifactData("recording", {"runs/walk": run, "runs/walk/camera": camera}),
                       provenance())  # fmt: skip
    assert list(tmp_path.iterdir()) == []


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    """An artifact that cannot be replaced is still the old one, byte by byte."""
    path = tmp_path / "policies.h5"
    write_artifact(path, policy(), provenance())
    before = path.read_bytes()
    with pytest.raises(ValueError, match="dtype"):
        write_artifact(path, WRONG["other dtype"], provenance())
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]


def test_a_promised_hash_that_is_not_met_writes_nothing(tmp_path: Path) -> None:
    """Whoever knows the content hash beforehand gets that content or an error."""
    path = tmp_path / "policies.h5"
    with pytest.raises(ValueError, match="promised"):
        write_artifact(path, policy(), provenance(), content_sha256="0" * 64)
    assert not path.exists()
    header = write_artifact(path, policy(), provenance())
    assert write_artifact(path, policy(), provenance(), content_sha256=header.content_sha256) == header


def streaming(action: Any) -> ArtifactData:
    """A recording whose second image is made by `action`."""

    def images() -> Iterator[bytes]:
        yield b"first"
        yield action()

    run = recording().groups["runs/walk"]
    camera = Group({"t": np.arange(2.0), "color": Blobs(images(), 2)}, {"width": 1, "height": 1})
    return ArtifactData("recording", {"runs/walk": run, "runs/walk/camera": camera})


def test_ctrl_c_while_writing_leaves_nothing_and_gets_through(tmp_path: Path) -> None:
    """SIGINT in the middle of an artifact is raised after HDF5 is closed; the handler is the old one again."""
    before = signal.getsignal(signal.SIGINT)

    def interrupt() -> bytes:
        signal.raise_signal(signal.SIGINT)
        return b"second"

    with pytest.raises(KeyboardInterrupt):
        write_artifact(tmp_path / "x.h5", streaming(interrupt), provenance())
    assert list(tmp_path.iterdir()) == [] and signal.getsignal(signal.SIGINT) is before


def test_a_source_that_cannot_be_read_is_blamed_itself(tmp_path: Path) -> None:
    """Where a file that is copied in fails, the error names that file and not the artifact."""
    gone = tmp_path / "0001.png"
    with pytest.raises(ArtifactError) as caught:
        write_artifact(tmp_path / "x.h5", streaming(gone.read_bytes), provenance())
    assert caught.value.where == str(gone) and list(tmp_path.iterdir()) == []


def test_a_folder_without_permission_is_an_error_in_words(tmp_path: Path) -> None:
    """Where the target's parent is a file, nothing is written and the error says what to look at."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(ArtifactError) as caught:
        write_artifact(tmp_path / "file" / "x.h5", policy(), provenance())
    assert caught.value.exit_code == 4 and caught.value.hint


def test_title_goes_into_the_head(tmp_path: Path) -> None:
    """A title of one's own replaces that of the kind."""
    write_artifact(tmp_path / "x.h5", policy(), provenance(), title="gaits of Tuesday")
    assert read_header(tmp_path / "x.h5").title == "gaits of Tuesday"
