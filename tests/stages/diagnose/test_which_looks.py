"""End caps for a camera: the same numbers as the engine's, though only the axes of the rods are turned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from r2s2r_cli.engine import end_caps
from r2s2r_cli.engine.flat import size, state_slots, unpack_state
from r2s2r_cli.stages.diagnose.which.looks import _mixed, _places, caps_of
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.identified import nominal
from tests.support.builders import robot

MODEL = Model(nominal(robot()), effects=())


@pytest.mark.parametrize("axial", [True, False])
def test_caps_are_those_of_the_engine(axial: bool) -> None:
    """Of random poses, to rounding; a state that left the finite numbers has no caps."""
    structure, theta = replace(MODEL.structure, axial=axial), MODEL.theta(MODEL.values0)
    slot = state_slots(structure)["q_WR"]
    rng = np.random.default_rng(0)
    flat = torch.as_tensor(rng.standard_normal((4, 7, size(state_slots(structure)))))
    q = flat[..., slot.start : slot.start + slot.size].unflatten(-1, slot.shape)
    q /= torch.linalg.vector_norm(q, dim=-1, keepdim=True)
    flat[2, 5] = torch.nan
    found = caps_of(structure, theta.p_BE, flat)
    plain = end_caps(theta, unpack_state(structure, flat.flatten(0, 1))).flatten(1).numpy()
    np.testing.assert_allclose(found, plain, rtol=0, atol=1e-15)
    assert np.isnan(found[2 * 7 + 5]).all()


def test_places_between_states_and_before_the_first() -> None:
    """A late sensor reads what was; before the first state it goes on along the first straight line, as seldom as that
    is right, and a camera has no such place. Beyond the last state nothing moves."""
    place = np.array([[-0.5, 0.0, 1.25, 9.0]])
    low, share = _places(place, 4, before=True)
    assert low.tolist() == [[0, 0, 1, 2]] and share[0] == pytest.approx([-0.5, 0.0, 0.25, 1.0])
    assert _places(place, 4)[1][0] == pytest.approx([0.0, 0.0, 0.25, 1.0])
    ramp = np.arange(4.0)[None, :, None]
    low, share = _places(place, 4, before=True)
    assert _mixed(ramp[:, low[0]], ramp[:, low[0] + 1], share)[0, :, 0] == pytest.approx([-0.5, 0.0, 1.25, 3.0])
