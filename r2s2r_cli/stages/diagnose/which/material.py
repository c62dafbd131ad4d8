"""What a comparison of effects has computed, before anything is concluded from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.stages.diagnose.parity.stranger import Stranger
from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.left import Left
from r2s2r_cli.stages.diagnose.which.rivals import NoGap
from r2s2r_cli.stages.diagnose.which.score import Score
from r2s2r_cli.stages.diagnose.which.screen import Response


@dataclass(frozen=True)
class Material:
    """All that was computed. scores: of fits, without their groups; responses: of the screening, best first."""

    arena: Arena
    base: Fit
    refit: Score
    fits: tuple[Fit, ...]
    scores: tuple[Score, ...]
    responses: tuple[Response, ...]
    chance: float
    no_gap: NoGap
    wider: float
    left: Left
    unexplained: float
    groups: np.ndarray
    calibration: Calibration
    chronic: np.ndarray
    """What of the gain of each fit was there before (`before.chronic`) [nats]."""
    marginal: np.ndarray
    """What counts of what each fit gains on all data (`marginal_gains`), less what was there before [nats]."""
    whole: np.ndarray
    """The same with all that single pieces say."""
    asked: tuple[str, ...] | None = None
    """Ids of the effects that may be named; None: all."""
    parity: Mapping[str, Mapping[int | None, float]] = field(default_factory=dict)
    """What the parity stage says for effects, by element (`Parity.nats`) [nats]."""
    stranger: Stranger | None = None
    """What the logs show that no law of the catalogue has."""

    def said(self, i: int) -> float:
        """What the parity stage says for the fit i [nats]."""
        one = self.fits[i].hypothesis.parts[0]
        return self.says(one.effect, one.number)

    def says(self, effect: str, index: int | None = None) -> float:
        """The same of an effect at an element; of one without number the most of any."""
        own = self.parity.get(effect, {})
        return max([own.get(None, 0.0), *((own.get(index, 0.0),) if index is not None else own.values())])
