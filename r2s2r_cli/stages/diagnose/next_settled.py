"""How sure of the right candidate one is expected to be after a policy that nobody has run.

Each candidate may be the truth, as probable as the ranking says. If it is, what the policy tells it from each other one
by [nats] is added to the scores that the ranking has, and probabilities of these candidates follow as they do there:
over the temperature that sets of known truth have taught, and no effect worth less than one that gains nothing. The
expected probability of the truth after that is what a policy is chosen by (Lindley 1956; with the loss of one decision,
not of entropy).
"""

from __future__ import annotations

import numpy as np


def settled(p: np.ndarray, nats: np.ndarray, temperature: float, *, none: int, nothing: float = -np.inf) -> float:
    """Expected probability of the truth after a policy.

    p (candidate,): before. nats (truth, candidate): by which each is told from the others, 0 from itself. temperature
    [nats]: of the softmax. none: place of the refit nominal model. nothing: log odds to it of an effect that gains
    nothing: no effect falls below that, so that where nothing is wrong one ends less sure than nats alone say.
    """
    before = np.log(p) - np.log(p[none])
    after = before + (nats[:, none, None] - nats) / temperature
    least = np.minimum(before, nothing)
    least[none] = 0.0
    after = np.maximum(after, least)
    truth = np.diag(after) - np.logaddexp.reduce(after, axis=1)
    return float(p / p.sum() @ np.exp(truth))


def unsettled(p: np.ndarray) -> float:
    """The same before anything is run: expected probability of the truth, each as probable as it is said to be."""
    return float(np.sum((p / p.sum()) ** 2))


def worth(before: float, after: float, temperature: float) -> float:
    """What takes expected probabilities from before to after [nats]: as much as equally probable candidates would have
    to stand apart from each other, two or more."""
    odds = [np.log(np.clip(one, 1e-12, 1.0 - 1e-12)) - np.log1p(-np.clip(one, 1e-12, 1.0 - 1e-12))
            for one in (before, after)]  # fmt: skip
    return float(temperature * (odds[1] - odds[0]))
