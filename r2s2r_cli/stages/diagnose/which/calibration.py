"""From gains to probabilities: one temperature and a few offsets, learned from sets whose truth was known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import ABSOLUTE
from r2s2r_cli.stages.diagnose.which.found import NONE, UNKNOWN
from schemas.results_diagnose import LAWLESS, LOGGED, NO_REPLAY

FILE = "calibration.json"
"""Beside this module; made by the calibration run of the blind trials, and frozen before any blind set exists."""


@dataclass(frozen=True)
class Calibration:
    """What turns evidence into probabilities.

    temperature [nats]: of the softmax over `none` and the effects. parity: nats of gain that a nat of the parity stage
    is worth, which needs no simulator, beyond by_chance [nats], which it says for the best of a whole catalogue where
    nothing is wrong; where a replay can tell, no more of them than the effect gains in it. held: share of a gain that
    left-out gaits must say, the rest is of all data. none [nats]: what the best effect must exceed.
    stranger: log odds of a cause that the catalogue does not have; wider: by what ln(1 + x / few) raises them, x what a
    wider floor gains beside the best effect [nats]; few [nats]: from about where on it says something.
    unfit: how far beyond those of healthy runs pieces may lie under the best effect of each [sd]: farther, no effect of
    the catalogue is enough, and `unknown` has at least unfit_share.
    commit: probability from which an effect is the verdict.
    cautious: the lesser of both counts alone.
    conformal: names whose probability is at least this are in the 90 % set, one in fifty or more. words: where it comes
    from; sets: how many it rests on, 0 for the defaults. lapse: how often the evidence says nothing of the truth, so
    that no name is ever certain.
    """

    temperature: float = 25.0
    parity: float = 15.0
    by_chance: float = 0.0
    held: float = 0.3
    none: float = 20.0
    stranger: float = -2.0
    wider: float = 0.0
    few: float = 10.0
    unfit: float = float("inf")
    unfit_share: float = 0.0
    commit: float = 0.5
    cautious: bool = False
    conformal: float = 0.05
    lapse: float = 0.0
    words: str = "uncalibrated: a temperature by hand"
    sets: int = 0

    def score(self, name: str, marginal: float = 0.0, *, left_out: float = 0.0, parity: float = 0.0) -> float:
        """What a name is worth [nats]. marginal: what the effect gains on all data, left_out: on gaits that were left
        out; nothing where it loses: how much it would harm does not say how little it is there. parity: what the parity
        stage says for it: a finding is an error of the comparison where an effect that would show in the replay gains
        nothing there (ADR 19)."""
        if name == NONE:
            return self.none
        if self.cautious:
            marginal = left_out = min(marginal, left_out)
        gain = (1.0 - self.held) * max(marginal, 0.0) + self.held * max(left_out, 0.0)
        heard = max(parity - self.by_chance, 0.0)
        return gain + self.parity * (heard if name in NO_REPLAY else min(heard, gain))

    def witnessed(self, name: str, left_out: float, parity: float, marginal: float, *, logs: bool = True) -> bool:
        """Whether anything speaks for an effect that did not help to fit it: gaits that were left out, or the parity
        stage [nats]. Without that it is no verdict, however well it explains what it was fitted to; nor is it where
        left-out gaits alone speak for it, and all data together (marginal) do not. What logs show by themselves they
        must show (LOGGED), where they were looked at: a replay that prefers other sensors makes up for something."""
        if parity > self.by_chance:
            return True
        return left_out > 0.0 and marginal > 0.0 and not (logs and name in LOGGED)

    def absolute(self) -> Calibration:
        """For a diagnosis without healthy runs: nothing says which gains make up for the simulator and were there
        before, nor what usually is left."""
        words = (
            f"{self.words}; those had healthy runs, here are none: findings of the parity stage count for less, and "
            "gains no more than left-out data say"
        )
        return replace(self, parity=ABSOLUTE * self.parity, unfit=float("inf"), cautious=True, words=words)

    def refuses(self, left_sd: float) -> bool:
        """Whether what the best effect leaves [sd of healthy pieces] is too much for any effect of the catalogue."""
        return left_sd > self.unfit

    def commits(self, probability: float) -> bool:
        """Whether an effect of this probability is a verdict."""
        return probability >= self.commit

    def probabilities(self, scores: Mapping[str, float]) -> dict[str, float]:
        """Of `none` and effects, where one of them is the cause: softmax of scores [nats] by name; a share `lapse` of
        it goes to all names alike."""
        names = list(scores)
        x = np.array([scores[name] for name in names]) / self.temperature
        x = np.where(np.isfinite(x), x, -1e9)
        p = np.exp(x - x.max())
        p = (1.0 - self.lapse) * p / p.sum() + self.lapse / len(p)
        return dict(zip(names, p.tolist(), strict=True))

    def with_unknown(
        self, probabilities: Mapping[str, float], unexplained: float, left_sd: float, *, lawless: bool = False
    ) -> dict[str, float]:  # fmt: skip
        """Probabilities by name, pairs included, of which `unknown` takes its share. unexplained: what a wider floor
        gains beside the best effect [nats], -inf where that was not asked: then there is no stranger, whatever is
        left. lawless: the logs show what no law of the catalogue has (`parity.stranger`)."""
        if np.isneginf(unexplained):
            return {**probabilities, UNKNOWN: 0.0}
        odds = np.exp(self.stranger + self.wider * np.log1p(max(np.nan_to_num(unexplained), 0.0) / self.few))
        share = float(odds / (1.0 + odds))
        if self.refuses(left_sd):
            share = max(share, self.unfit_share)
        share = max(share, LAWLESS) if lawless else share
        return {name: (1.0 - share) * p for name, p in probabilities.items()} | {UNKNOWN: share}

    def within(self, probabilities: Mapping[str, float]) -> tuple[str, ...]:
        """The 90 % set, most probable first; never empty."""
        order = sorted(probabilities, key=lambda name: -probabilities[name])
        kept = [name for name in order if probabilities[name] >= self.conformal]
        return tuple(kept or order[:1])


def calibration() -> Calibration:
    """The one of the package, or the defaults, which say so."""
    place = resources.files(__package__).joinpath(FILE)
    if not place.is_file():
        return Calibration()
    known = json.loads(place.read_text(encoding="utf-8"))
    return Calibration(**{name: known[name] for name in Calibration.__dataclass_fields__ if name in known})
