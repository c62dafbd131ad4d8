"""The picture of an estimate."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.estimate import estimate
from r2s2r_cli.views.estimate import centre_of_mass, draw_estimate
from schemas.estimate import EstimateSettings
from tests.stages.estimate.builders import recording, threebar
from tests.stages.estimate.planted import planted


def test_every_run_is_drawn_and_the_drawing_is_repeatable() -> None:
    """One PNG a run, the same bytes for the same values."""
    data, _ = estimate(recording(planted(100)), threebar(), EstimateSettings())
    first, second = (list(draw_estimate(data, threebar())) for _ in range(2))
    assert [run for run, _ in first] == ["planted"]
    assert first[0][1].startswith(b"\x89PNG")
    assert first == second


def test_a_run_without_commands_is_drawn() -> None:
    """Intervals, segments and commands are optional in an estimate, so also in its picture."""
    data, _ = estimate(recording(planted(101)), threebar(), EstimateSettings())
    keep = ("intervals", "segments", "commands")
    bare = ArtifactData("estimate", {k: g for k, g in data.groups.items() if not k.endswith(keep)})
    assert len(dict(draw_estimate(bare, threebar()))["planted"]) > 10_000


def test_centre_of_mass_of_symmetric_rods_is_their_middle() -> None:
    """Rods whose parts lie symmetrically have their centre of mass in the middle; a heavy odd end pulls it there."""
    data, _ = estimate(recording(planted(102)), threebar(), EstimateSettings())
    frames, robot = data.groups["runs/planted/frames"], threebar()
    assert centre_of_mass(frames, robot) == pytest.approx(np.mean(frames["p_WR"], axis=1), abs=1e-4)
    rods = list(robot.rods)
    parts = rods[0].parts
    rods[0] = rods[0].model_copy(
        update={"parts": (*parts, parts[0].model_copy(update={"mass_kg": 1e6, "offset_m": 0.1625}))}
    )
    heavy = robot.model_copy(update={"rods": tuple(rods)})
    assert centre_of_mass(frames, heavy) == pytest.approx(frames["p_WE"][:, 1], abs=1e-4)
