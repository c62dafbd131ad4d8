"""What tests of pictures share."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """What the pictures of a diagnosis and of a calibration draw, instead of files."""
    found: list[Figure] = []

    def kept(figure: Figure) -> bytes:
        found.append(figure)
        return b""

    for name in ("diagnose", "diagnose_robot", "diagnose_floor", "calibration"):
        monkeypatch.setattr(f"r2s2r_cli.views.{name}.png_bytes", kept)
    return found
