"""What each kind of evidence is worth: probabilities learned without it from a calibration bank, and judged on a blind
one.

An ablation of what is weighed, not of what is computed: start values, the screening and the fits had all of it. What
the fits themselves are worth asks for verdicts made without (`blind run --set`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from r2s2r_cli.blind.score.calibrate import Learned, learn
from r2s2r_cli.blind.score.cases import Case
from r2s2r_cli.blind.score.facts import UNKNOWN, Truth
from r2s2r_cli.errors import InputError
from schemas.results_blind_worth import BlindWorthRow

LEAST_P = 1e-6
"""Of a truth that has no name: what the log loss counts."""
Without = Callable[[Case], Case]


@dataclass(frozen=True)
class Ranked:
    """A judged set with the names that are ranked, most probable first, and what is committed to, None: nothing."""

    truth: Truth
    case: Case
    order: tuple[str, ...]
    probability: dict[str, float]
    named: str | None

    @property
    def clear(self) -> bool:
        """A single effect that can be told."""
        return self.truth.kind == "single" and self.truth.stratum == "clear"

    @property
    def right(self) -> bool:
        """The truth is first."""
        return self.order[0] == self.case.truth


def worth(cases: Sequence[Case], judged: Sequence[tuple[Truth, Case]]) -> tuple[BlindWorthRow, ...]:
    """All evidence first, then without each kind. Raises InputError for too few sets to learn from, or no clear set."""
    everything: list[Ranked] = []
    rows = []
    for what, without in KINDS.items():
        own, _ = learn([without(one) for one in cases], where="--learned")
        found = [_ranked(truth, without(one), own) for truth, one in judged]
        if not any(one.clear for one in found):
            raise InputError("there is no clear single effect to judge by", where="FILE...", expected="at least one",
                             received=f"{len(judged)} sets", hint="r2s2r blind score --published FILE...")  # fmt: skip
        everything = everything or found
        rows.append(_row(what, found, everything))
    return tuple(rows)


def _ranked(truth: Truth, one: Case, own: Learned) -> Ranked:
    p = own.probabilities(one)
    order = tuple(sorted(p, key=lambda name: -p[name]))
    first = order[0]
    named = one.may_name(first) and p[first] >= own.commit
    return Ranked(truth, one, order, p, first if named else None)


def _row(what: str, found: Sequence[Ranked], everything: Sequence[Ranked]) -> BlindWorthRow:
    clear = [one for one in found if one.clear]
    named = [one for one in clear if one.named is not None]
    before = [one.right for one in everything if one.clear]
    return BlindWorthRow(
        without=what, clear=len(clear), top1=sum(one.right for one in clear),
        top3=sum(one.case.truth in one.order[:3] for one in clear), named=len(named),
        right=sum(one.named == one.case.truth for one in named),
        none=sum(one.truth.kind == "none" for one in found),
        alarms=sum(one.truth.kind == "none" and one.named is not None for one in found),
        strangers=sum(one.case.truth == UNKNOWN for one in found),
        strangers_named=sum(one.case.truth == UNKNOWN and one.named is not None for one in found),
        lost=sum(b and not one.right for b, one in zip(before, clear, strict=True)),
        won=sum(one.right and not b for b, one in zip(before, clear, strict=True)),
        log_loss=float(np.mean([-np.log(max(one.probability.get(one.case.truth, 0.0), LEAST_P)) for one in found])),
    )  # fmt: skip


def _parity_alone(one: Case) -> Case:
    return replace(one, said=np.zeros_like(one.said), left_out=None, strange=0.0, left_sd=0.0, replayed=False)


def _all_data_alone(one: Case) -> Case:
    return replace(one, left_out=None)


def _left_out_alone(one: Case) -> Case:
    return one if one.left_out is None else replace(one, said=one.left_out, left_out=None)


KINDS: dict[str, Without] = {
    "nothing": lambda one: one,
    "the parity stage": lambda one: replace(one, parity=np.zeros_like(one.parity), logs=False),
    "the replay (parity alone)": _parity_alone,
    "left-out gaits, and the witness (all data together instead)": _all_data_alone,
    "all data together (left-out gaits instead)": _left_out_alone,
    "what a wider floor explains": lambda one: replace(one, strange=0.0),
    "what is left beyond healthy runs": lambda one: replace(one, left_sd=0.0),
}
"""By what they leave out."""
