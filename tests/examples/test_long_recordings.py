"""The example that watches a long recording, on a short one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.examples.load import load

run = load("12_long_recordings", "run")


@pytest.mark.slow
def test_memory_and_clocks_stay(tmp_path: Path) -> None:
    """Half a minute in lock-step (in real time, as with the camera, a busy machine would be what is tested): neither
    process grows by more than a few MB after its first tenth, the recording's clock stays with the rig's within what
    lengths can tell, and the boards' gain no more than that."""
    found = run.main(tmp_path, lambda line: None, seconds=30.0, camera=False)
    assert 20.0 < found["duration_s"] < 90.0
    for who in ("recorder", "rig"):
        begin, end = found[f"{who}_begin_mb"], found[f"{who}_end_mb"]
        assert begin > 20.0 and end - begin < 0.1 * begin + 2.0
    assert abs(found["drift_recording_s"]) < 0.02
    assert all(abs(found[f"drift_board {i}_s"]) < 0.025 for i in range(3))


@pytest.mark.parametrize("looks", [3, 7, 300])
def test_memory_of_a_run_that_few_looks_caught(looks: int) -> None:
    """The clock of the rig's log goes on in jumps, and a short run is over after a few looks."""
    t = np.floor(np.linspace(0.0, 30.0, looks) / 8.0) * 8.0
    grows = np.linspace(50.0, 60.0, looks)
    found = run.memory(run.Watched(t, grows, grows + 30.0))
    assert 50.0 <= found["recorder_begin_mb"] < found["recorder_end_mb"] <= 60.0
    assert found["rig_end_mb"] - found["recorder_end_mb"] == pytest.approx(30.0)


def test_the_shift_between_two_clocks_is_found() -> None:
    """Lengths that were shifted by 0.37 s and stamped by a clock that gains 200 ppm are placed to the millisecond."""
    t_true = np.arange(0.0, 60.0, 0.02)
    true = 0.15 + 0.02 * np.sin(np.outer(t_true, [0.7, 1.3, 2.1]))
    t = np.arange(0.0, 50.0, 0.05)
    length = np.column_stack([np.interp(0.37 + t / (1 + 2e-4), t_true, column) for column in true.T])
    early, late = t < 10.0, t > 40.0
    begin = run.placed(t[early], length[early], t_true, true, np.arange(0.0, 1.0, 0.02))
    end = run.placed(t[late], length[late], t_true, true, np.arange(0.0, 1.0, 0.02))
    assert begin == pytest.approx(0.37 - 2e-4 * 5.0, abs=1e-3)
    assert begin - end == pytest.approx(2e-4 * 40.0, abs=2e-3)
