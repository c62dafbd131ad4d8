"""What an import says of every format, in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.stages.import_ import import_source
from r2s2r_cli.views.recording import ground_offset, import_rows
from tests.support.import_samples import (
    SIDECAR,
    frame_json,
    sample_robot,
    small_csv,
    write_authors_folder,
    write_tum_folder,
)


def _source(kind: str, folder: Path) -> Path:
    if kind == "authors_folder":
        return write_authors_folder(folder / "walk", [frame_json(1676990000.0 + 0.1 * i) for i in range(8)])
    if kind == "tum_rgbd":
        stamps = (5.0 + 0.1 * np.arange(8)).tolist()
        return write_tum_folder(folder / "walk", stamps, stamps)
    path = folder / "walk.csv"
    path.write_text(small_csv())
    path.with_suffix(".toml").write_text(SIDECAR)
    return path


@pytest.mark.parametrize("kind", ["trajectory_csv", "authors_folder", "tum_rgbd"])
def test_the_report_of_every_format_becomes_rows(kind: str, tmp_path: Path) -> None:
    """Rods and ground are said where end caps were observed, and only there; frames always."""
    report = import_source(_source(kind, tmp_path), robot=sample_robot()).report
    rows = dict(import_rows(report))
    assert report.format == kind
    assert rows["frames kept"].startswith(f"{report.kept} of {report.rows} rows")
    assert ("rod 0" in rows) == ("ground offset" in rows) == (kind == "trajectory_csv")


def test_the_side_of_the_ground_follows_the_sign() -> None:
    """A positive offset lifts caps that lie too low, a negative one lowers caps that lie too high."""
    assert ground_offset(0.004) == "+4.0 mm to add to z: the lowest cap lies 4.0 mm too low on average"
    assert ground_offset(-0.746) == "-746.0 mm to add to z: the lowest cap lies 746.0 mm too high on average"
