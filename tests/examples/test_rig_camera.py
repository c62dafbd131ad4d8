"""The example of the rig's camera: its picture, and its parts of the noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.examples.load import load

run = load("10_rig_camera", "run")


@pytest.mark.slow
def test_every_part_of_the_noise_is_there_alone() -> None:
    """White and correlated noise have 1.2 mm z², steps and edges nothing on plain floor but a constant."""
    floor = (slice(0, 100), slice(0, 640))
    errors = {title: run.errors(run.only(part))[floor] for title, part in run.PARTS.items()}
    white, shared, steps, edges = errors.values()
    assert np.nanstd(white) == pytest.approx(1.2 * 1.44**2, rel=0.05)
    assert np.nanstd(shared) == pytest.approx(1.2 * 1.44**2, rel=0.15)
    assert np.nanstd(steps) < 1e-9 and np.nanstd(edges) < 1e-9


@pytest.mark.slow
def test_it_draws_and_prints(tmp_path: Path) -> None:
    """The picture is made, and three lines of cost are printed under a head."""
    lines: list[str] = []
    run.main(tmp_path, lines.append, count=2)
    assert (tmp_path / "rig-camera.png").read_bytes()[:4] == b"\x89PNG"
    assert len(lines) == 4 and all(line.endswith(" ms") for line in lines[1:])
