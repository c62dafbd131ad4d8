"""A set of a calibration bank as what its verdict says for every name, beside the right one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.blind.score.facts import NONE, UNKNOWN, Truth
from schemas.results_diagnose import BY_CHANCE, LOGGED, NO_REPLAY

HELD = 0.3
"""Of what an effect gains the share that left-out gaits say; the rest is what all data do, which rank better. They are
no less right where they lose, but one step off a cliff costs a right effect any number of nats, so losses do not count.
"""
FEW = 10.0
"""[nats] From about which on what a wider floor explains says something of a stranger; gains span decades."""


@dataclass(frozen=True)
class Case:
    """One set. names: `none` and the effects that were ranked; said (n,) [nats]: what all data together say for each,
    at least 0; left_out (n,) [nats]: what gaits say that each was not fitted to, at least 0; parity (n,) [nats]: beyond
    BY_CHANCE. truth: the right name, not among `names` where the screening had lost it, or no catalogue has it
    (`unknown`). strange: ln(1 + x / FEW) of what a wider floor gains beside the best effect, x [nats]; left_sd: what
    that leaves, in sd of healthy pieces, 0 where that is less than in healthy runs. replayed: False, nothing but the
    parity stage is asked; logs: False, it is not. lawless: the logs show what no law has."""

    names: tuple[str, ...]
    said: np.ndarray
    parity: np.ndarray
    truth: str
    strange: float = 0.0
    left_sd: float = 0.0
    left_out: np.ndarray | None = None
    replayed: bool = True
    logs: bool = True
    lawless: bool = False

    @property
    def gain(self) -> np.ndarray:
        """What counts, (n,) [nats]: all data and, where it is known what left-out gaits say, HELD of them."""
        return self.said if self.left_out is None else (1.0 - HELD) * self.said + HELD * self.left_out

    @property
    def heard(self) -> np.ndarray:
        """What counts of the parity stage, (n,) [nats]: where a replay can tell, as much as the effect gains there."""
        alone = np.array([not self.replayed or name in NO_REPLAY for name in self.names])
        return np.where(alone, self.parity, np.minimum(self.parity, self.gain))

    def may_name(self, name: str) -> bool:
        """Whether it is an effect for which something speaks that it was not fitted to (`Calibration.witnessed`)."""
        if name in (NONE, UNKNOWN):
            return False
        i = self.names.index(name)
        if self.parity[i] > 0.0:
            return True
        if self.logs and name in LOGGED:
            return False
        return self.left_out is None or bool(self.left_out[i] > 0.0 and self.said[i] > 0.0)


def case(truth: Truth, document: dict[str, Any]) -> Case | None:
    """Of a label and a verdict's document; None for pairs, which have two right names. Verdicts of before they said
    what all data say count what left-out gaits say."""
    if truth.right is None:
        return None
    rows = [row for row in document["ranking"] if row["elpd_gain"] > -1e8]
    stranger = next((row for row in rows if row["effect"] == UNKNOWN), {"elpd_gain": 0.0})
    rows = [row for row in rows if row["effect"] != UNKNOWN]
    names = tuple(row["effect"] for row in rows)
    told = any(row.get("marginal_nats") is not None for row in rows)
    left_out = np.array([float(row["elpd_gain"]) for row in rows])
    said = np.array([float(row.get("marginal_nats") or 0.0) for row in rows]) if told else left_out
    parity = np.array([max(float(row.get("parity_nats", 0.0)) - BY_CHANCE, 0.0) for row in rows])
    strange = float(np.log1p(max(float(stranger["elpd_gain"]), 0.0) / FEW))
    left = max(float(document.get("left_nats") or 0.0), 0.0) / float(document.get("left_sd_nats") or np.inf)
    logs = any(float(row.get("parity_nats") or 0.0) > 0.0 for row in rows)
    return Case(names, np.maximum(said, 0.0), parity, truth.right, strange, left, np.maximum(left_out, 0.0), logs=logs,
                lawless=document.get("stranger_sd2") is not None)  # fmt: skip
