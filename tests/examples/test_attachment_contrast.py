"""Cables at the rod ends against cables on the caps: a short version of the example."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from tests.examples.load import load

collapse, run = (load("06_attachment", name) for name in ("collapse", "run"))


def box(x: float, y: float, z: float) -> torch.Tensor:
    """Six points whose extents along turned axes are x, y, z."""
    ends = torch.tensor([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=torch.float64)
    generator = torch.Generator().manual_seed(0)
    turn = torch.linalg.qr(torch.randn(3, 3, generator=generator, dtype=torch.float64)).Q
    return 0.5 * ends * torch.tensor([x, y, z], dtype=torch.float64) @ turn + 0.7


def test_thickness_is_the_least_extent() -> None:
    """Whichever way the robot lies and wherever it is."""
    assert float(collapse.thickness(box(0.3, 0.004, 0.2))) == pytest.approx(0.004)
    assert float(collapse.thickness(box(0.3, 0.25, 0.2))) == pytest.approx(0.2)


def test_collapsed_and_stuck_are_two_things() -> None:
    """Flat on the way is collapsed, flat after the extension stuck; flat during the extension is neither."""
    tall, flat = box(0.3, 0.25, 0.2), box(0.3, 0.25, 0.001)
    ends = [tall] * collapse.EXTENSIONS
    runs = [
        [tall, tall, *ends], [tall, flat, *ends], [tall, flat, *([flat] * collapse.EXTENSIONS)],
        [tall, tall, flat, *ends[1:]],
    ]  # fmt: skip
    found = collapse.outcome(torch.stack([torch.stack(frames) for frames in runs]))
    assert found.collapsed.tolist() == [False, True, True, False]
    assert found.stuck.tolist() == [False, False, True, False]


def test_random_shapes_are_the_same_every_time() -> None:
    """A seed names the sequences; they are binary."""
    shapes = collapse.random_shapes(5, 4, 3)
    assert torch.equal(shapes, collapse.random_shapes(5, 4, 3))
    assert not torch.equal(shapes, collapse.random_shapes(5, 4, 4))
    assert set(shapes.unique().tolist()) == {0.0, 1.0}


@pytest.mark.slow
def test_only_cables_at_the_rod_ends_collapse_and_stick(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Eight sequences of eight shapes: rod ends collapse and stick in most, the caps' surface in none."""
    run.main(tmp_path, sequences=8, shapes=8, seed=1)
    lines = capsys.readouterr().out.splitlines()
    counts = {line[:44].strip(): [int(word) for word in line[44:].split() if word.isdigit()] for line in lines[2:6]}
    assert counts["surface, shapes in closed loop"][:4] == [0, 8, 0, 8]
    collapsed, _, stuck, _ = counts["rod_end, shapes in closed loop"][:4]
    assert collapsed >= 4
    assert stuck >= 3
    assert counts["surface, motor commands of rod_end"][2] == 0
    assert (tmp_path / "attachment-contrast.png").stat().st_size > 10_000
