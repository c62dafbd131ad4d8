"""Winches that lag turn where a stretch begins as the commands before it have left them."""

import numpy as np
import pytest
import torch

from r2s2r_cli.effects import with_off_values
from r2s2r_cli.effects.motor_lag import MotorLag
from r2s2r_cli.stages.diagnose.which.turning import STEP_S, turning
from tests.support.engine import threebar_engine


@pytest.mark.parametrize("tau", [0.03, 0.15])
@pytest.mark.parametrize("since", [0.05, 0.2])
def test_a_lagging_winch_has_come_so_far(tau: float, since: float) -> None:
    """Reeled in for 0.05 s and 0.2 s at full command: speed (1 - exp(-t / tau)). Stopped as long ago: what is left of
    it. Without a lag it stands as soon as the command does."""
    plain, numbers, _ = threebar_engine()
    structure = plain.with_effects(MotorLag())
    theta = with_off_values(structure, numbers)
    lagging = theta.with_values({"motor_lag.tau_s": torch.full_like(theta.extra["motor_lag.tau_s"], tau)})
    own = float(lagging.speed_in[0, 0])
    steps = round(since / STEP_S)

    def past(rows: int) -> np.ndarray:
        u = np.zeros((1, 3, rows, structure.n_actuated))
        u[:, 0, -steps:] = 1.0  # begun
        u[:, 1, :-steps] = 1.0  # stopped
        return u

    found = turning(structure, lagging, past)
    assert found is not None and found.shape == (1, 3, structure.n_actuated)
    whole = own * (1 - np.exp(-6.0))  # six time constants are looked back
    assert found[0, 0].numpy() == pytest.approx(own * (1 - np.exp(-since / tau)), abs=own - whole)
    assert found[0, 1].numpy() == pytest.approx(own * np.exp(-since / tau), abs=own - whole)
    assert not found[0, 2].any()
    quick = turning(structure, theta, past)
    assert quick is not None and quick[0, 0].numpy() == pytest.approx(own) and not quick[0, 1].any()
    assert turning(plain, numbers, past) is None
