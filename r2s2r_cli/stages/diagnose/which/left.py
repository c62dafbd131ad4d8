"""What hypotheses leave: how much worse today's pieces are predicted than those of healthy runs.

Gains compare hypotheses with each other, and where all of them are wrong one of them still gains. What is left is an
absolute number: a piece that noise and floor explain costs half its data, so what it costs beyond that is an error. A
healthy robot's pieces cost something as well, because no floor and no noise is quite right: that is what is taken off,
the usual part of it in proportion to the data of a piece, since a noise stated 10 % too large is worth 20 nats in each
of them. A piece in which the robot fell at another instant costs any number of nats, so no piece says more than PIECE.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from r2s2r_cli.stages.diagnose.which.arena import Arena
from r2s2r_cli.stages.diagnose.which.before import Healthy
from r2s2r_cli.stages.diagnose.which.mixture import usual
from r2s2r_cli.stages.diagnose.which.score import Score

PIECE = 10.0
"""[nats]"""
PIECE_SD = 2.0
"""[nats] By so much pieces of a healthy robot differ, even where the few that there are happen to cost alike (2.5 to 10
in the calibration sets)."""


@dataclass(frozen=True)
class Left:
    """Nats that the pieces cost beyond what as many of the healthy runs do. refit: under the refit nominal model; best:
    each under the hypothesis that predicts it best. sd: of both, from how much pieces differ, by
    PIECE_SD at least; nan for fewer than two pieces."""

    refit: float
    best: float
    sd: float

    @property
    def beyond(self) -> float:
        """What is left under the best hypotheses in its sd; 0 where nothing is known of that."""
        return self.best / self.sd if self.sd > 0 else 0.0


def expected(arena: Arena) -> np.ndarray:
    """What pieces cost where noise and floor explain them, (piece,) [nats]."""
    return usual(arena.logdets, arena.sizes)


def left(
    at_least: np.ndarray, sizes: np.ndarray, refit: Score, others: Sequence[Score], healthy: Healthy | None
) -> Left:  # fmt: skip
    """Of scores without their groups. at_least: `expected` of the arena before its floor was widened; sizes: data of
    its pieces. Without healthy runs pieces are held to what noise and floor explain."""
    then = np.zeros(0)
    if healthy is not None:
        excess, own_sizes = healthy_excess(healthy), healthy.arena.sizes
        of_each = float(np.median(excess / own_sizes))
        then, at_least = _bounded(excess - of_each * own_sizes), at_least + of_each * sizes
    own = _bounded(-refit.elpd - at_least)
    best = _bounded(-np.max([refit.elpd, *(one.elpd for one in others)], axis=0) - at_least)
    count = len(own)
    usually, sd = 0.0, _differ(own) * np.sqrt(count)
    if healthy is not None:
        usually, sd = float(then.mean()), _differ(then) * count * np.sqrt(1 / count + 1 / len(then))
    return Left(float(own.sum()) - count * usually, float(best.sum()) - count * usually, float(sd))


def _differ(pieces: np.ndarray) -> float:
    return max(float(np.std(pieces, ddof=1)), PIECE_SD) if len(pieces) > 1 else float("nan")


def healthy_excess(healthy: Healthy) -> np.ndarray:
    """What pieces of the healthy runs cost beyond what noise and floor explain, (piece,) [nats]."""
    return np.asarray(-healthy.score.elpd - expected(healthy.arena))


def _bounded(nats: np.ndarray) -> np.ndarray:
    return np.clip(nats, -PIECE, PIECE)
