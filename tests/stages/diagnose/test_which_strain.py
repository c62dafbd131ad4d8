"""How far nuisances are pulled from where they were known to be."""

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.fit import Fits
from r2s2r_cli.stages.diagnose.which.hypothesis import Hypothesis
from r2s2r_cli.stages.diagnose.which.prior import strain
from tests.support.linear_arena import LinearArena


def test_strain_is_what_the_prior_of_the_shared_nuisances_takes() -> None:
    """Two sd in one and one in the other; what is of one run alone is no strain of the robot."""
    arena = LinearArena(0.0)
    arena.mean, arena.precision = np.array([1.0, 0.0]), np.diag([4.0, 0.25])
    (one,) = Fits(arena).begun([(Hypothesis(), np.array([2.0, 2.0]), np.zeros(0))])  # type: ignore[arg-type]
    assert strain(arena, one) == pytest.approx(0.5 * (2.0**2 + 1.0**2))  # type: ignore[arg-type]
    arena.shared = 1
    assert strain(arena, one) == pytest.approx(2.0)  # type: ignore[arg-type]
