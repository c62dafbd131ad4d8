"""The refit nominal model: along a curved valley it goes on while new derivatives gain, and ends where none do."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.nominal import GOES_ON, MOST_JACOBIANS, begun, nominal
from r2s2r_cli.stages.diagnose.which.fit import Fits
from tests.support.linear_arena import STRETCHES, LinearArena, kinds_of

STEEP, BEND = 10.0, 1.0
"""How much more the bent direction counts, and how much it is bent."""
TRUTH = np.array([0.3, -0.2])
FAR = np.array([-2.0, 2.0])


class ValleyArena(LinearArena):
    """What is simulated depends on u = (z0, STEEP (z1 + BEND z0^2)): a valley along a parabola. prepared: how often
    derivatives were taken; moved: how often the starts were."""

    def __init__(self) -> None:
        super().__init__(0.0)
        self.y += self.A @ (self._bent(TRUTH[None])[0] - TRUTH)
        self.precision = 1e-4 * np.eye(2)
        self.prepared = self.moved = 0

    def prepare(self, z: np.ndarray) -> None:
        """Derivatives at z."""
        self.prepared += 1
        by = np.array([[1.0, 0.0], [2.0 * STEEP * BEND * z[0], STEEP]])
        self.by_nuisance = kinds_of((self.A @ by).T).T

    def move_starts(self, away: np.ndarray) -> None:
        """There are none."""
        self.moved += 1
        assert away.shape == (STRETCHES, 0)

    def raw(
        self, values: np.ndarray, z: np.ndarray, only: object = None, away: np.ndarray | None = None
    ) -> list[np.ndarray]:  # fmt: skip
        """As of the linear arena, at u."""
        return super().raw(np.concatenate([self._bent(values), values[:, 2:]], axis=1), z, only, away)

    def _bent(self, values: np.ndarray) -> np.ndarray:
        return np.stack([values[:, 0], STEEP * (values[:, 1] + BEND * values[:, 0] ** 2)], axis=1)


def test_it_goes_on_while_new_derivatives_gain() -> None:
    """One set of derivatives stops on the way; with as many as it takes it ends as low as from the truth."""
    best = begun(arena := ValleyArena(), TRUTH)  # type: ignore[arg-type]
    arena.prepare(TRUTH)
    Fits(arena).run([best])  # type: ignore[arg-type]
    once = nominal(one := ValleyArena(), FAR, calibrate=False, first=False, ends=False)  # type: ignore[arg-type]
    often = nominal(many := ValleyArena(), FAR, calibrate=False, first=False, ends=True)  # type: ignore[arg-type]
    assert one.prepared == 1 and 2 < many.prepared <= MOST_JACOBIANS and many.moved == many.prepared - 1
    assert once.cost > best.cost + 10 * GOES_ON
    assert often.cost < best.cost + GOES_ON and np.allclose(often.z, TRUTH, atol=0.1)
