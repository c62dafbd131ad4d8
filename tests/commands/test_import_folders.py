"""`r2s2r import FOLDER`: camera folders come in, are reported and drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.commands.conftest import document, invoke
from tests.support.import_samples import SIDECAR, frame_json, write_authors_folder, write_tum_folder


@pytest.fixture
def folders(project: Path) -> dict[str, Path]:
    """Both layouts, of the project's robot."""
    stamps = (5.0 + 0.1 * np.arange(6)).tolist()
    made = {
        "authors_folder": write_authors_folder(
            project / "walk", [frame_json(1676990000.0 + 0.1 * i) for i in range(6)]
        ),
        "tum_rgbd": write_tum_folder(project / "hall", stamps, stamps),
    }
    for folder in made.values():
        folder.with_name(folder.name + ".toml").write_text(SIDECAR.replace('"sample"', '"threebar"', 1))
    return made


@pytest.mark.parametrize("layout", ["authors_folder", "tum_rgbd"])
def test_a_camera_folder_is_imported_reported_and_drawn(layout: str, folders: dict[str, Path]) -> None:
    """Exit 0, a table without end caps, a picture and a page that holds it."""
    folder = folders[layout]
    result = invoke("import", folder.name)
    assert result.exit_code == 0, result.stderr
    assert "frames kept" in result.stdout
    assert "rod 0" not in result.stdout
    picture = Path(f"iterations/001/10-record-{folder.name}.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "data:image/png;base64," in Path("iterations/001/10-record.html").read_text()


def test_both_layouts_in_one_recording(folders: dict[str, Path]) -> None:
    """Two folders give two runs, each with its picture."""
    drawings = document("import", *(folder.name for folder in folders.values()))["drawings"]
    names = [Path(drawing).name for drawing in drawings]
    assert names == ["10-record-walk.png", "10-record-hall.png", "10-record.html"]
