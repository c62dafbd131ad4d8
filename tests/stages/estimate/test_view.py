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


@pytest.fixture(scope="module")
def estimated() -> ArtifactData:
    """A planted run; nobody changes it."""
    return estimate(recording(planted(100)), threebar(), EstimateSettings())[0]


def test_every_run_is_drawn_and_the_drawing_is_repeatable(estimated: ArtifactData) -> None:
    """One PNG a run, the same bytes for the same values."""
    data = estimated
    first, second = (list(draw_estimate(data, threebar())) for _ in range(2))
    assert [run for run, _ in first] == ["planted"]
    assert first[0][1].startswith(b"\x89PNG")
    assert first == second


def test_a_run_without_commands_is_drawn(estimated: ArtifactData) -> None:
    """Intervals, segments and commands are optional in an estimate, so also in its picture."""
    left_out = ("intervals", "segments", "commands")
    bare = ArtifactData("estimate", {k: g for k, g in estimated.groups.items() if not k.endswith(left_out)})
    assert len(dict(draw_estimate(bare, threebar()))["planted"]) > 10_000


def test_centre_of_mass_of_symmetric_rods_is_their_middle(estimated: ArtifactData) -> None:
    """Rods whose parts lie symmetrically have their centre of mass in the middle; a heavy odd end pulls it there."""
    frames, robot = estimated.groups["runs/planted/frames"], threebar()
    assert centre_of_mass(frames, robot) == pytest.approx(np.mean(frames["p_WR"], axis=1), abs=1e-4)
    rods = list(robot.rods)
    parts = rods[0].parts
    rods[0] = rods[0].model_copy(
        update={"parts": (*parts, parts[0].model_copy(update={"mass_kg": 1e6, "offset_m": 0.1625}))}
    )
    heavy = robot.model_copy(update={"rods": tuple(rods)})
    assert centre_of_mass(frames, heavy) == pytest.approx(frames["p_WE"][:, 1], abs=1e-4)
