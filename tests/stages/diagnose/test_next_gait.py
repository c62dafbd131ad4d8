"""What to run next: commands of an ideal controller."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.next_gait import SETTLE_S, _commands
from r2s2r_cli.stages.diagnose.stage import library_of
from tests.support.builders import robot


def test_commands_wind_each_cable_as_far_as_its_target_asks() -> None:
    """Speed times the integral of the command is the way between targets, and shorter means +1."""
    targets = ((0.0, 1.0), (0.5, 0.25))
    control, t = _commands(targets, 0.1, 0.05)
    wound = 0.05 * np.sum(control[:-1] * np.diff(t)[:, None], axis=0)
    assert wound == pytest.approx([0.1 * 0.5, 0.1 * 0.75])
    assert control[1].tolist() == [1.0, 0.0]
    assert t[-1] == pytest.approx(2.0 + 1.5 + 2 * SETTLE_S)


def test_the_library_has_the_excitations_and_what_was_planned() -> None:
    """Ramps, holds, reversals, repeats, random gaits; a planned policy by its own name."""
    made = library_of(robot(), {"straight": [[1.0] * 6, [0.0] * 6]}).gaits
    assert {"ramps", "holds", "reversals", "repeats", "straight"} <= set(made)
    assert made["straight"][1] == (0.0,) * 6
