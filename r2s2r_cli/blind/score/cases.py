"""A set of a calibration bank as what its verdict says for every name, beside the right one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.blind.score.facts import NO_GAP_FACTOR, NO_REPLAY, NONE, UNKNOWN, Truth

BY_CHANCE = 4.0
"""[nats] That the parity stage says for the best of a whole catalogue where nothing is wrong: less than that says
nothing, and weighed like more it outdoes gains that are real."""
LUCK, LUCK_TIMES = 10.0, 2.0
"""What gains on left-out gaits count at most: so many nats and so many times what all data say. In a set with nothing
wrong a cap's grip gained 75 nats left out and 9 in all: without a gait the refit model was led astray, not the effect
right."""
MARGINAL_MOST = 30.0
"""[nats] of the marginal likelihood that count: beyond, an effect is there, and gains on left-out gaits say which."""
MOST = 8.0
"""[nats] beyond that which count: look-alikes share a finding, and 48 nats for one with 36 for the other, weighed
several times, outvoted the replay, which tells them apart."""


@dataclass(frozen=True)
class Case:
    """One set. names: what was ranked; score, parity, marginal (n,) [nats]: without the numbers that are learned,
    parity beyond BY_CHANCE, MOST at most where a replay tells, the marginal of verdicts that do not say it as much as
    the score. equivalent: the test found no gap. truth: the right name, not among
    `names` where the screening had lost it. gap, left [nats]: what pieces cost beyond those of healthy runs, under the
    refit model and under the best effect; 0 where they cost less. left_sd: the latter in its sd. gain, said: what score
    and marginal are before LUCK and MARGINAL_MOST bound them; predicts: names that gain more in the replay than chance
    gives, or need none, (n,); None: as if nothing was bounded, and all of them."""

    names: tuple[str, ...]
    score: np.ndarray
    parity: np.ndarray
    marginal: np.ndarray
    equivalent: bool
    truth: str
    gap: float = 0.0
    left: float = 0.0
    left_sd: float = 0.0
    gain: np.ndarray | None = None
    said: np.ndarray | None = None
    predicts: np.ndarray | None = None

    @property
    def rival(self) -> np.ndarray:
        """Which names are no effects, (n,)."""
        return np.array([name in (NONE, UNKNOWN) for name in self.names])


def case(truth: Truth, document: dict[str, Any]) -> Case | None:
    """Of a label and a verdict's document; None for pairs, which have two right names."""
    if truth.right is None:
        return None
    rows = [row for row in document["ranking"] if row["elpd_gain"] > -1e8]
    names = tuple(row["effect"] for row in rows)
    chance = float(document["chance_nats"])
    told = any(row.get("marginal_nats") is not None for row in rows)
    said = np.array([float((row.get("marginal_nats") if told else row["elpd_gain"]) or 0.0) for row in rows])
    gain = np.array([chance if row["effect"] == NONE else float(row["elpd_gain"]) for row in rows])
    rival = np.array([name in (NONE, UNKNOWN) for name in names])
    needless = np.array([name in (NONE, UNKNOWN, *NO_REPLAY) for name in names])
    score = np.where(rival, gain, np.minimum(gain, LUCK + LUCK_TIMES * np.maximum(said, 0.0)))
    upper, floor = document.get("refit_upper_m"), document["floor_m"]
    equivalent = upper is not None and float(upper) < NO_GAP_FACTOR * float(floor)
    parity = np.array([
        min(max(float(row.get("parity_nats", 0.0)) - BY_CHANCE, 0.0), np.inf if row["effect"] in NO_REPLAY else MOST)
        for row in rows
    ])  # fmt: skip
    gap, left = (max(float(document.get(key) or 0.0), 0.0) for key in ("gap_nats", "left_nats"))
    left_sd = left / float(document.get("left_sd_nats") or np.inf)
    return Case(
        names, score, parity, np.clip(said, 0.0, MARGINAL_MOST), equivalent, truth.right, gap, left, left_sd,
        gain=gain, said=said, predicts=needless | (gain > chance),
    )  # fmt: skip
