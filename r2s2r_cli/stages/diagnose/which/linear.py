"""Held-out gains in the linearised problem: what an effect predicts where nothing is rough, and what it did before.

The same fit begun elsewhere ends 20 nats off, and that is as much as many an effect is worth. So beside the fits stands
this: the response of an effect as it was simulated about the refit nominal model, times an amplitude, and the nuisances
by their secants (`line`). Amplitude and nuisances are found without a gait, and judged on it.

No simulator is quite the robot, and some effect always makes up for a little of that. It does so in the healthy runs as
well: so an effect gains no more than it would be worth that its amplitude now is another one than theirs. What has gone
wrong since is a change.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.diagnose.which.fit import Fit
from r2s2r_cli.stages.diagnose.which.line import Line
from r2s2r_cli.stages.diagnose.which.score import ENOUGH
from r2s2r_cli.stages.diagnose.which.screen import Response

CHUNK = 16
"""Responses simulated at a time: white residuals of a long evidence are large."""
AMPLITUDE_SD = 2.0
"""Of the size that the screening found best: how far the prior of an amplitude reaches from 0."""
AGED = 0.1
"""Of the same: how far an amplitude moves from day to day with nothing wrong."""


def linear_gains(arena: Arena, base: Fit, responses: Sequence[Response], healthy: Healthy | None = None) -> np.ndarray:
    """Held-out log density over the refit nominal model, at most half the squared distance of the amplitudes of now and
    of the healthy runs over its sd, (response,) [nats]. No piece says more than ENOUGH."""
    now = Line(arena, base)
    then = None if healthy is None else Line(healthy.arena, healthy.base)
    nominal = now.nominal()
    found = np.zeros(len(responses))
    for first in range(0, len(responses), CHUNK):
        some = responses[first : first + CHUNK]
        asked = [(one.candidate, one.size) for one in some]
        there = now.changes(asked)
        known = None if then is None else then.changes(asked)
        for k, one in enumerate(some):
            costs = now.beside(one.candidate, there[k], AMPLITUDE_SD)
            gain = float(np.clip(nominal - costs, -ENOUGH, ENOUGH).sum())
            if then is not None and known is not None:
                mine = now.amplitude(one.candidate, there[k], AMPLITUDE_SD)
                before = then.amplitude(one.candidate, known[k], AMPLITUDE_SD)
                gain = min(gain, 0.5 * (mine[0] - before[0]) ** 2 / (mine[1] ** 2 + before[1] ** 2 + AGED**2))
            found[first + k] = gain
    return found


def by_element(responses: Sequence[Response], nats: np.ndarray) -> dict[str, dict[int | None, float]]:
    """The gains of responses that can be seen, by effect and number of the element (None: none, or all alike)."""
    found: dict[str, dict[int | None, float]] = {}
    for one, gain in zip(responses, nats.tolist(), strict=True):
        if one.testable:
            own = found.setdefault(one.candidate.effect, {})
            own[one.candidate.number] = max(own.get(one.candidate.number, -np.inf), gain)
    return found
