"""From verdicts on a calibration bank to the numbers that turn gains into probabilities.

p(name) ~ exp((score + bias) / temperature). The score of an effect is its held-out gain, of which the first USUAL nats
count a share (`usual_share`), since chance gives as much to whatever is tried, `marginal` times what it gains on all
data together, and `parity` times what the parity stage says for it; that of `none` what the best of the catalogue gains
by chance, and `none`, and `equivalent` more where the equivalence test finds no gap, less `gap` for every nat that
today's pieces cost beyond those of healthy runs; that of `unknown` a share (`beside`) of the best effect's score, since
a stranger often looks a little like one, a share (`unknown_share`) of what a wider floor gains beside it, and `left`
for every nat that the best effect leaves, less `unknown`. Linear in 1 / temperature and the products with it, but for
which effect is the best, which is found in turns with them (TURNS): a multinomial regression, biases drawn to 0, in
which any name is the truth once in 20 sets (LAPSE). Thresholds come from probabilities of sets left out of the fit. To
commit to a name and to `unknown` are claims of different weight: each has its own. That of names is for sets in which
the catalogue has the cause; how often strangers are taken for one of them is another figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.blind.score.cases import BY_CHANCE, LUCK, LUCK_TIMES, MARGINAL_MOST, MOST, Case
from r2s2r_cli.blind.score.facts import NO_REPLAY, NONE, UNKNOWN
from r2s2r_cli.errors import InputError

LEAST_SETS = 12
LEARNED = (
    "sharpness", "parity", "none", "equivalent", "gap", "unknown", "unknown_share", "left", "usual", "beside",
    "marginal",
)  # fmt: skip
"""Numbers beside the biases, in the order of the columns; all of them in the exponent."""
AT = {name: k for k, name in enumerate(LEARNED)}
BEFORE = (1.0, 0.7, 0.0, 0.0, 0.05, -1.0, 0.3, 0.05, 0.5, 0.8, 0.5)
"""What they are before anything is learned, gains in the unit of SHARPNESS."""
BEFORE_SD = (2.0, 0.3, 2.0, 1.0, 0.1, 2.0, 0.3, 0.1, 0.5, 0.3, 0.5)
POSITIVE = ("sharpness", "parity", "gap", "unknown_share", "left", "usual", "beside", "marginal")
TURNS = 4
"""In which the numbers and the best effect of every set are found."""
FOLDS = 10
COVER = 0.90
PRECISION = {"commit": 0.90, "commit_unknown": 0.75}
"""How often a verdict that commits shall be right: to an effect, to `unknown` (the reference, section 4). That there is
no gap is a test of its own."""
LEAST_SURE = 0.5
"""A verdict is likelier than not, however often less likely ones were right."""
BELIEVED = 10.0
"""Sets' worth of belief that probabilities are as often right as they say: few sets alone would set any threshold."""
BIAS_SD = 0.5
"""Of a bias over the temperature: how much more often a name wins than its gains say, before anything is learned."""
LAPSE = 0.05
"""How often the evidence says nothing of the truth, whatever it says: without this one set in which a stranger looks
just like an effect decides what all evidence is worth."""
SHARPNESS = 1.0 / 15.0
"""The unit in which 1 / temperature is fitted [1/nats]."""
USUAL = 8.0
"""[nats] About what the best of a catalogue gains where nothing is wrong."""
Apart = list[tuple[Case, dict[str, float]]]
"""Sets with probabilities by numbers that other sets taught."""


@dataclass(frozen=True)
class Learned:
    """What sets teach. numbers: LEARNED and the biases of `effects`, (LEARNED + effect,). commit: by the keys of
    PRECISION. unfit: `unfit` and `unfit_share` of `Calibration`, empty where no set teaches them."""

    numbers: np.ndarray
    effects: tuple[str, ...]
    commit: dict[str, float]
    unfit: dict[str, float]

    def probabilities(self, one: Case) -> dict[str, float]:
        """Of every name of a set."""
        p = _softmax(_design(one, self.effects, self.numbers) @ self.numbers)
        if one.left_sd > self.unfit.get("unfit", np.inf):
            share = self.unfit["unfit_share"]
            p = (1.0 - share) * p + share * np.array([name == UNKNOWN for name in one.names])
        return dict(zip(one.names, p.tolist(), strict=True))


def learn(cases: Sequence[Case], *, known: Sequence[str] = (), where: str = "BANK") -> tuple[Learned, Apart]:
    """The numbers, and every set with probabilities by those of nine tenths of the others, without what is learned of
    `unfit`. known: effects that no set need have. where: in the error. Raises InputError for too few sets."""
    if len(cases) < LEAST_SETS:
        raise InputError(
            "there are too few sets to calibrate with", where=where,
            expected=f"at least {LEAST_SETS}", received=str(len(cases)),
            hint="r2s2r blind make --bank calibration --count 120 --key cal.key cal",
        )  # fmt: skip
    effects = tuple(sorted({*known, *(name for one in cases for name in one.names)} - {NONE, UNKNOWN}))
    apart = [pair for fold in range(FOLDS) for pair in _left_out(cases, effects, fold)]
    first, right, sure = _first(apart)
    commit = {
        key: _commit(sure[of], right[of], wanted)
        for (key, wanted), of in zip(PRECISION.items(), _claims(first, apart), strict=True)
    }
    return Learned(_fit(cases, effects), effects, commit, _unfit(cases)), apart


def calibrated(cases: Sequence[Case], *, words: str) -> dict[str, Any]:
    """The numbers of `stages/diagnose/which/calibration.json`, with what they reach on sets that were left out (but for
    `unfit`, which few sets teach: all of them).

    Raises InputError for too few sets.
    """
    own, apart = learn(cases)
    _, right, _ = _first(apart)
    held = np.sort([p.get(one.truth, 0.0) for one, p in apart])
    # Split conformal: with the k-th smallest as threshold at least COVER of new sets keep their truth.
    k = int(np.floor((len(held) + 1) * (1.0 - COVER)))
    learned = dict(zip(LEARNED, own.numbers.tolist(), strict=False))
    sharp = max(learned["sharpness"] * SHARPNESS, 1e-6)
    return {
        "temperature": 1.0 / sharp,
        "parity": learned["parity"] / sharp,
        "by_chance": BY_CHANCE,
        "most": MOST,
        "usual": USUAL,
        "usual_share": learned["usual"] * SHARPNESS / sharp,
        "marginal": learned["marginal"] * SHARPNESS / sharp,
        "marginal_most": MARGINAL_MOST,
        "luck": LUCK,
        "luck_times": LUCK_TIMES,
        "none": learned["none"] / sharp,
        "equivalent": learned["equivalent"] / sharp,
        "gap": learned["gap"] * SHARPNESS / sharp,
        "unknown": -learned["unknown"] / sharp,
        "unknown_share": learned["unknown_share"] * SHARPNESS / sharp,
        "left": learned["left"] * SHARPNESS / sharp,
        "beside": learned["beside"],
        "bias": {name: float(b) / sharp for name, b in zip(own.effects, own.numbers[len(LEARNED) :], strict=True)},
        **own.commit,
        **own.unfit,
        "conformal": float(held[k - 1]) if k else 0.0,
        "lapse": LAPSE,
        "words": words,
        "sets": len(cases),
        "left_out": {
            "top1": float(right.mean()),
            "log_loss": float(np.mean([-np.log(max(p.get(one.truth, 0.0), 1e-6)) for one, p in apart])),
        },
    }


def _unfit(cases: Sequence[Case]) -> dict[str, float]:
    """What the best effect leaves [sd] in strangers alone, half-way between the most that it leaves in any other set
    and the least beyond, and how probable a stranger is there (Laplace's rule of succession); empty for none."""
    most = max((one.left_sd for one in cases if one.truth != UNKNOWN), default=0.0)
    beyond = [one.left_sd for one in cases if one.truth == UNKNOWN and one.left_sd > most]
    return {"unfit": (most + min(beyond)) / 2, "unfit_share": (len(beyond) + 1) / (len(beyond) + 2)} if beyond else {}


def _design(one: Case, effects: Sequence[str], known: np.ndarray) -> np.ndarray:
    """What multiplies LEARNED and the biases in the exponent of every name, (name, LEARNED + effect). known: LEARNED as
    far as they are, by which the best effect is found."""
    X = np.zeros((len(one.names), len(LEARNED) + len(effects)))
    told = zip(one.names, one.score, one.parity, one.marginal, strict=True)
    for row, (name, score, parity, marginal) in zip(X, told, strict=True):
        if name == UNKNOWN:
            row[AT["unknown"]] = 1.0
            row[AT["unknown_share"]], row[AT["left"]] = score * SHARPNESS, one.left * SHARPNESS
            continue
        row[AT["sharpness"]], row[AT["usual"]] = max(score - USUAL, 0.0) * SHARPNESS, min(score, USUAL) * SHARPNESS
        if name == NONE:
            row[AT["none"]], row[AT["equivalent"]], row[AT["gap"]] = 1.0, float(one.equivalent), -one.gap * SHARPNESS
        else:
            row[AT["parity"]], row[AT["marginal"]] = parity, marginal * SHARPNESS
            row[len(LEARNED) + effects.index(name)] = 1.0
    worth = X[:, : len(LEARNED)] @ known[: len(LEARNED)]
    replayed = [w for w, name in zip(worth, one.names, strict=True) if name not in (NONE, UNKNOWN, *NO_REPLAY)]
    if UNKNOWN in one.names:
        X[one.names.index(UNKNOWN), AT["beside"]] = max(replayed, default=0.0)
    return X


def _fit(cases: Sequence[Case], effects: Sequence[str]) -> np.ndarray:
    """Most probable numbers (LEARNED + effect,) after BEFORE and the biases' BIAS_SD."""
    found = np.r_[BEFORE, np.zeros(len(effects))]
    for _ in range(TURNS):
        found = _fit_with(cases, effects, found)
    return found


def _fit_with(cases: Sequence[Case], effects: Sequence[str], so_far: np.ndarray) -> np.ndarray:
    """The same with the best effects that the numbers so far say."""
    from scipy.optimize import minimize

    known = [one for one in cases if one.truth in one.names]
    most = max((len(one.names) for one in known), default=1)
    X, there = np.zeros((len(known), most, len(LEARNED) + len(effects))), np.zeros((len(known), most), dtype=bool)
    for k, one in enumerate(known):
        X[k, : len(one.names)], there[k, : len(one.names)] = _design(one, effects, so_far), True
    truth = np.array([one.names.index(one.truth) for one in known], dtype=int)
    right = X[np.arange(len(known)), truth]
    mean = np.r_[BEFORE, np.zeros(len(effects))]
    weight = np.r_[np.array(BEFORE_SD) ** -2.0, np.full(len(effects), 1.0 / BIAS_SD**2)]

    rows, names = np.arange(len(known)), there.sum(axis=1)

    def cost(w: np.ndarray) -> tuple[float, np.ndarray]:
        x = np.where(there, X @ w, -np.inf)
        e = np.exp(x - x.max(axis=1, keepdims=True))
        p = e / e.sum(axis=1, keepdims=True)
        told = (1.0 - LAPSE) * p[rows, truth]
        whole = told + LAPSE / names
        value = 0.5 * float(weight @ (w - mean) ** 2) - float(np.log(whole).sum())
        pull = right - np.einsum("kn,knp->kp", p, X)
        return value, weight * (w - mean) - ((told / whole)[:, None] * pull).sum(axis=0)

    bounds = [(1e-3, None) if name in POSITIVE else (None, None) for name in LEARNED] + [(None, None)] * len(effects)
    return np.asarray(minimize(cost, mean, jac=True, bounds=bounds, method="L-BFGS-B").x)


def _first(apart: Apart) -> tuple[list[str], np.ndarray, np.ndarray]:
    """First guesses, whether each is right, and its probability, (set,) each."""
    first = [max(p, key=lambda name: p[name]) for _, p in apart]
    right = np.array([name == one.truth for name, (one, _) in zip(first, apart, strict=True)])
    return first, right, np.array([p[name] for name, (_, p) in zip(first, apart, strict=True)])


def _left_out(cases: Sequence[Case], effects: Sequence[str], fold: int) -> Apart:
    """Sets of one fold with probabilities by the numbers that the others teach."""
    held = [one for i, one in enumerate(cases) if i % FOLDS == fold]
    w = _fit([one for i, one in enumerate(cases) if i % FOLDS != fold], effects)
    return [
        (one, dict(zip(one.names, _softmax(_design(one, effects, w) @ w).tolist(), strict=True))) for one in held
    ]  # fmt: skip


def _claims(first: Sequence[str], apart: Apart) -> tuple[np.ndarray, np.ndarray]:
    """Which first guesses are an effect where no stranger is the cause, `unknown`, in the order of PRECISION, (set,)
    each."""
    none, unknown = (np.array([one == name for one in first], dtype=bool) for name in (NONE, UNKNOWN))
    stranger = np.array([one.truth == UNKNOWN for one, _ in apart], dtype=bool)
    return ~(none | unknown | stranger), unknown


def _commit(sure: np.ndarray, right: np.ndarray, precision: float) -> float:
    """The least probability from which on the first guess is right in this share of the sets, as these and BELIEVED
    say; 1 where there is none."""
    order = np.argsort(-sure)
    count = np.arange(1, len(order) + 1)
    share = (np.cumsum(right[order]) + BELIEVED * np.cumsum(sure[order]) / count) / (count + BELIEVED)
    good = np.flatnonzero((share >= precision) & (sure[order] >= LEAST_SURE))
    return float(sure[order[good[-1]]]) if len(good) else 1.0


def _softmax(x: np.ndarray) -> np.ndarray:
    e = np.exp(x - x.max())
    return np.asarray((1.0 - LAPSE) * e / e.sum() + LAPSE / len(x))
