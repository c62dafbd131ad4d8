"""The example of a robot on the desk: measured on the bench, calibrated, driven, recorded, compared with the truth."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.examples.load import load

run = load("11_record_on_the_rig", "run")


@pytest.mark.slow
def test_recorded_lengths_are_the_true_ones_within_the_sensors_error(tmp_path: Path) -> None:
    """About its bias of the day a sensor is off by 2 mm rms, the quadratic error and noise of the world; the bias is
    the 5 mm (one standard deviation, nine sensors) of a calibration that is a day old, and that of its bench."""
    lines: list[str] = []
    run.main(tmp_path, lines.append, targets=2, protocols=("boards",))
    _, row = lines
    protocol, samples, bias, _, about, _, largest, _ = row.split()
    assert (protocol, int(samples) > 500) == ("boards", True)
    assert 1.0 < float(bias) < 5.0 * 2.0
    assert float(about) < 2.5
    assert float(largest) < 25.0
    assert (tmp_path / "rig-lengths.png").read_bytes()[:4] == b"\x89PNG"
