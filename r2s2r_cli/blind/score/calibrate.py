"""From verdicts on a calibration bank to the numbers that turn gains into probabilities.

Where the catalogue has the cause, p(name) ~ exp(score / temperature): of an effect what it gains, on all data together
and for a part (HELD) on gaits that were left out, and `parity` times what counts of what the parity stage says for it,
of `none` one number. Linear in 1 / temperature and the products with it: a multinomial regression, in which any name is
the truth once in 50 sets (LAPSE). How probable it is that the catalogue does not have the cause is a regression of its
own, on what a wider floor explains: how much is left under the best effect says nothing of that, but for what strangers
alone leave (`unfit`).

Thresholds come from probabilities of sets left out of the fit. That of names is for sets in which the catalogue has the
cause; how often strangers are taken for one of them is another figure.

A weight for each effect, the equivalence test and what pieces cost beyond those of healthy runs were worth nothing or
less on sets left out (docs/concepts/blind-trials.md), and do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from r2s2r_cli.blind.score.cases import FEW, HELD, Case
from r2s2r_cli.blind.score.facts import NONE, UNKNOWN
from r2s2r_cli.errors import InputError
from schemas.results_diagnose import BY_CHANCE, LAWLESS

LEAST_SETS = 12
LEARNED = ("sharpness", "parity", "none")
"""Numbers of the softmax, in the order of the columns; all of them in the exponent."""
BEFORE, BEFORE_SD = (1.0, 0.7, 0.0), (2.0, 0.3, 2.0)
"""What they are before anything is learned, gains in the unit of SHARPNESS."""
STRANGER, STRANGER_SD = (-2.0, 0.0), (1.0, 0.5)
"""The same of `stranger` and `wider`."""
FOLDS = 10
COVER = 0.90
LEAST_LIKELY = 0.02
"""Probability below which no name is held by the 90 % set, however many sets lose their truth by that."""
PRECISION = 0.90
"""How often a verdict that commits to an effect shall be right (the reference, section 4)."""
LEAST_SURE = 0.5
"""A verdict is likelier than not, however often less likely ones were right."""
BELIEVED = 10.0
"""Sets' worth of belief that probabilities are as often right as they say: few sets alone would set any threshold."""
LAPSE = 0.02
"""How often the evidence says nothing of the truth, whatever it says: without this one set in which another effect
looks just like the true one decides what all evidence is worth."""
SHARPNESS = 1.0 / 15.0
"""The unit in which 1 / temperature is fitted [1/nats]."""
Apart = list[tuple[Case, dict[str, float]]]
"""Sets with probabilities by numbers that other sets taught."""


@dataclass(frozen=True)
class Learned:
    """What sets teach. numbers: LEARNED; strange: `stranger` and `wider`; unfit: `unfit` and `unfit_share` of
    `Calibration`, empty where no set teaches them; commit: probability from which a name is a verdict."""

    numbers: np.ndarray
    strange: np.ndarray
    unfit: dict[str, float]
    commit: float

    def probabilities(self, one: Case) -> dict[str, float]:
        """Of every name of a set, and `unknown`."""
        beyond = one.left_sd > self.unfit.get("unfit", np.inf)
        return _probabilities(one, self.numbers, self.strange, least=self.unfit["unfit_share"] if beyond else 0.0)


def learn(cases: Sequence[Case], *, where: str = "BANK") -> tuple[Learned, Apart]:
    """The numbers, and every set with probabilities by those of nine tenths of the others, without what is learned of
    `unfit`. where: in the error. Raises InputError for too few sets."""
    if len(cases) < LEAST_SETS:
        raise InputError(
            "there are too few sets to calibrate with", where=where,
            expected=f"at least {LEAST_SETS}", received=str(len(cases)),
            hint="r2s2r blind make --bank calibration --count 120 --key cal.key cal",
        )  # fmt: skip
    apart = [pair for fold in range(FOLDS) for pair in _left_out(cases, fold)]
    first, right, sure = _first(apart)
    named = np.array([
        one.may_name(name) and one.truth != UNKNOWN for name, (one, _) in zip(first, apart, strict=True)
    ])  # fmt: skip
    here = np.array([1.0 - p[UNKNOWN] for _, p in apart])
    commit = _commit(sure[named], right[named], (sure / here)[named])
    return Learned(_fit(cases), _fit_strange(cases), _unfit(cases), commit), apart


def calibrated(cases: Sequence[Case], *, words: str, older: Sequence[Case] = ()) -> dict[str, Any]:
    """The numbers of `stages/diagnose/which/calibration.json`, with what they reach on sets that were left out (but for
    `unfit`, which few sets teach: all of them, and those `older` ones whose gains were counted in another way).

    Raises InputError for too few sets.
    """
    own, apart = learn(cases)
    _, right, _ = _first(apart)
    held = np.sort([p.get(one.truth, 0.0) for one, p in apart])
    # Split conformal: with the k-th smallest as threshold at least COVER of new sets keep their truth, but for effects
    # that nothing speaks for: listing every name of the catalogue would hold those, and say nothing.
    k = int(np.floor((len(held) + 1) * (1.0 - COVER)))
    learned = dict(zip(LEARNED, own.numbers.tolist(), strict=True))
    sharp = max(learned["sharpness"] * SHARPNESS, 1e-6)
    return {
        "temperature": 1.0 / sharp,
        "parity": learned["parity"] / sharp,
        "by_chance": BY_CHANCE,
        "held": HELD,
        "none": learned["none"] / sharp,
        **dict(zip(("stranger", "wider"), own.strange.tolist(), strict=True)),
        "few": FEW,
        **_unfit([*cases, *older]),
        "commit": own.commit,
        "conformal": max(float(held[k - 1]) if k else 0.0, LEAST_LIKELY),
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


def _probabilities(one: Case, numbers: np.ndarray, strange: np.ndarray, *, least: float = 0.0) -> dict[str, float]:
    """Of every name and `unknown`, which has `least` at least."""
    x = _design(one) @ numbers
    e = np.exp(x - x.max())
    p = (1.0 - LAPSE) * e / e.sum() + LAPSE / len(x)
    share = max(
        float(1.0 / (1.0 + np.exp(-strange[0] - strange[1] * one.strange))), least, LAWLESS if one.lawless else 0.0
    )
    return dict(zip(one.names, ((1.0 - share) * p).tolist(), strict=True)) | {UNKNOWN: share}


def _design(one: Case) -> np.ndarray:
    """What multiplies LEARNED in the exponent of every name, (name, LEARNED)."""
    none = np.array([name == NONE for name in one.names])
    return np.stack(
        [np.where(none, 0.0, one.gain * SHARPNESS), np.where(none, 0.0, one.heard), none.astype(float)], axis=1
    )


def _fit(cases: Sequence[Case]) -> np.ndarray:
    """Most probable numbers LEARNED after BEFORE."""
    known = [one for one in cases if one.truth in one.names]
    most = max((len(one.names) for one in known), default=1)
    X, there = np.zeros((len(known), most, len(LEARNED))), np.zeros((len(known), most), dtype=bool)
    for k, one in enumerate(known):
        X[k, : len(one.names)], there[k, : len(one.names)] = _design(one), True
    truth = np.array([one.names.index(one.truth) for one in known], dtype=int)
    right = X[np.arange(len(known)), truth]
    rows, names = np.arange(len(known)), there.sum(axis=1)

    def cost(w: np.ndarray) -> tuple[float, np.ndarray]:
        x = np.where(there, X @ w, -np.inf)
        e = np.exp(x - x.max(axis=1, keepdims=True))
        p = e / e.sum(axis=1, keepdims=True)
        told = (1.0 - LAPSE) * p[rows, truth]
        whole = told + LAPSE / names
        pull = right - np.einsum("kn,knp->kp", p, X)
        return -float(np.log(whole).sum()), -((told / whole)[:, None] * pull).sum(axis=0)

    return _most_probable(cost, BEFORE, BEFORE_SD, [(1e-3, None), (1e-3, None), (None, None)])


def _fit_strange(cases: Sequence[Case]) -> np.ndarray:
    """The most probable `stranger` and `wider` after STRANGER."""
    X = np.array([[1.0, one.strange] for one in cases])
    stranger = np.array([one.truth == UNKNOWN for one in cases], dtype=float)

    def cost(w: np.ndarray) -> tuple[float, np.ndarray]:
        x = X @ w
        return float((np.logaddexp(0.0, x) - stranger * x).sum()), X.T @ (1.0 / (1.0 + np.exp(-x)) - stranger)

    return _most_probable(cost, STRANGER, STRANGER_SD, [(None, None), (0.0, None)])


def _most_probable(
    cost: Callable[[np.ndarray], tuple[float, np.ndarray]], mean: Sequence[float], sd: Sequence[float],
    bounds: Sequence[tuple[float | None, float | None]],
) -> np.ndarray:  # fmt: skip
    """Where a cost with its gradient is least, normal beliefs of before added."""
    from scipy.optimize import minimize

    start, weight = np.array(mean), np.array(sd) ** -2.0

    def whole(w: np.ndarray) -> tuple[float, np.ndarray]:
        value, slope = cost(w)
        return value + 0.5 * float(weight @ (w - start) ** 2), slope + weight * (w - start)

    return np.asarray(minimize(whole, start, jac=True, bounds=bounds, method="L-BFGS-B").x)


def _first(apart: Apart) -> tuple[list[str], np.ndarray, np.ndarray]:
    """First guesses, whether each is right, and its probability, (set,) each."""
    first = [max(p, key=lambda name: p[name]) for _, p in apart]
    right = np.array([name == one.truth for name, (one, _) in zip(first, apart, strict=True)])
    return first, right, np.array([p[name] for name, (_, p) in zip(first, apart, strict=True)])


def _left_out(cases: Sequence[Case], fold: int) -> Apart:
    """Sets of one fold with probabilities by the numbers that the others teach."""
    others = [one for i, one in enumerate(cases) if i % FOLDS != fold]
    numbers, strange = _fit(others), _fit_strange(others)
    return [(one, _probabilities(one, numbers, strange)) for i, one in enumerate(cases) if i % FOLDS == fold]


def _commit(sure: np.ndarray, right: np.ndarray, expected: np.ndarray) -> float:
    """The least probability from which on the first guess is right in PRECISION of the sets, as these and BELIEVED say;
    1 where there is none. sure, right, expected (set,): the first guess, whether it is right, and how often such ones
    should be where the catalogue has the cause."""
    order = np.argsort(-sure)
    count = np.arange(1, len(order) + 1)
    share = (np.cumsum(right[order]) + BELIEVED * np.cumsum(expected[order]) / count) / (count + BELIEVED)
    good = np.flatnonzero((share >= PRECISION) & (sure[order] >= LEAST_SURE))
    return float(sure[order[good[-1]]]) if len(good) else 1.0
