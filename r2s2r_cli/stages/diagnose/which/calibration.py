"""From gains to probabilities: one temperature and a few offsets, learned from sets whose truth was known."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import ABSOLUTE
from r2s2r_cli.stages.diagnose.which.candidates import NO_REPLAY
from r2s2r_cli.stages.diagnose.which.found import NONE, UNKNOWN

FILE = "calibration.json"
"""Beside this module; made by the calibration run of the blind trials, and frozen before any blind set exists."""


@dataclass(frozen=True)
class Calibration:
    """What turns evidence into probabilities.

    temperature [nats]: of the softmax over names. usual [nats]: about what chance gives to the best of a catalogue;
    usual_share: what a nat below it counts. luck, luck_times: no gain counts beyond luck [nats] and so many times what
    all data together say, since what was left out cannot gain what they do not show; marginal: what a nat of that
    counts beside it, marginal_most [nats] at most, from where on the effect is beyond doubt. parity: nats of gain that
    a nat of the parity stage is worth, which needs no simulator and errs far less, beyond by_chance [nats], which it
    says for the best of a whole catalogue where nothing is wrong; most [nats]: of them that count, since a finding that
    stands out says that something is wrong, and which of its look-alikes it is the replay tells better, where there is
    one. none, equivalent [nats]: what `none`
    gains, and more where the equivalence test finds no gap; gap: what it loses for every nat that the refit model costs
    more than in healthy runs. beside, unknown_share, left: what `unknown` has of the best effect's score, of what a
    wider floor gains beside it, and of every nat that it leaves; unknown [nats]: what that must exceed. bias [nats]:
    of a name, what its gains are short of.
    commit, commit_unknown: probability from which an effect or `unknown` is the verdict.
    unfit: how far beyond those of healthy runs pieces may lie under the best effect of each [sd]: farther, no effect of
    the catalogue is enough, and `unknown` has at least unfit_share.
    conformal: names whose probability is at least this are in the 90 % set. words: where it comes from; sets: how many
    it rests on, 0 for the defaults. lapse: how often the evidence says nothing of the truth, so that no name is ever
    certain.
    """

    temperature: float = 25.0
    parity: float = 15.0
    by_chance: float = 0.0
    most: float = float("inf")
    usual: float = 0.0
    usual_share: float = 1.0
    marginal: float = 0.0
    marginal_most: float = float("inf")
    luck: float = float("inf")
    luck_times: float = 2.0
    none: float = 20.0
    equivalent: float = 6.0
    gap: float = 0.0
    unknown: float = 25.0
    unknown_share: float = 0.3
    left: float = 0.0
    beside: float = 0.0
    commit: float = 0.5
    commit_unknown: float = 0.5
    unfit: float = float("inf")
    unfit_share: float = 0.0
    conformal: float = 0.05
    lapse: float = 0.0
    bias: Mapping[str, float] = field(default_factory=dict)
    words: str = "uncalibrated: a temperature by hand"
    sets: int = 0

    def score(
        self, name: str, gain: float, *, marginal: float = 0.0, parity: float = 0.0,
        equivalent: bool = False, beyond: float = 0.0, best: float = 0.0,
    ) -> float:  # fmt: skip
        """What a name is worth without its bias [nats]. gain: held out; of `none` what chance reaches, of `unknown`
        what a wider floor gains. marginal: of an effect, on all data. equivalent: the equivalence test found no gap.
        beyond: what pieces cost more than those of healthy runs (`left.Left`): under the refit model for `none`, under
        the best effect for `unknown`. best: of `unknown`, the score of that effect: a stranger is told from it by what
        it leaves."""
        if name == UNKNOWN:
            return self.beside * best + self.unknown_share * gain + self.left * max(beyond, 0.0) - self.unknown
        if name != NONE:
            gain = min(gain, self.luck + self.luck_times * max(marginal, 0.0))
        gain = self.usual_share * min(gain, self.usual) + max(gain - self.usual, 0.0)
        if name == NONE:
            return gain + self.none + (self.equivalent if equivalent else 0.0) - self.gap * max(beyond, 0.0)
        most = float("inf") if name in NO_REPLAY else self.most
        gain += self.marginal * min(max(marginal, 0.0), self.marginal_most)
        return gain + self.parity * min(max(parity - self.by_chance, 0.0), most)

    def absolute(self) -> Calibration:
        """For a diagnosis without healthy runs."""
        words = f"{self.words}; those had healthy runs, here are none: findings of the parity stage count for less"
        return replace(self, parity=ABSOLUTE * self.parity, unfit=float("inf"), words=words)

    def refuses(self, left_sd: float) -> bool:
        """Whether what the best effect leaves [sd of healthy pieces] is too much for any effect of the catalogue."""
        return left_sd > self.unfit

    def commits(self, name: str, probability: float) -> bool:
        """Whether a first guess of this probability is a verdict."""
        return probability >= (self.commit_unknown if name == UNKNOWN else self.commit)

    def probabilities(self, scores: Mapping[str, float]) -> dict[str, float]:
        """Softmax of scores [nats] by name; a share `lapse` of it goes to all names alike."""
        names = list(scores)
        x = np.array([scores[name] + self.bias.get(name, 0.0) for name in names]) / self.temperature
        x = np.where(np.isfinite(x), x, -1e9)
        p = np.exp(x - x.max())
        p = (1.0 - self.lapse) * p / p.sum() + self.lapse / len(p)
        return dict(zip(names, p.tolist(), strict=True))

    def doubted(self, probabilities: Mapping[str, float], left_sd: float) -> dict[str, float]:
        """Probabilities by name, of which `unfit_share` goes to `unknown` where the catalogue does not fit (`refuses`),
        pairs of its effects included."""
        if not self.refuses(left_sd):
            return dict(probabilities)
        share = {name: (1.0 - self.unfit_share) * p for name, p in probabilities.items()}
        return share | {UNKNOWN: share.get(UNKNOWN, 0.0) + self.unfit_share}

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
