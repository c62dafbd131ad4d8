"""What to run next: the gait of a library after which one is expected to be surest of the right candidate.

Candidates are the names that remain, nothing wrong among them, each as probable as the ranking says and each in turn
taken as the truth (`next_settled.py`); how far a gait tells them apart is counted as the ranking counts
(`next_apart.py`). Commands are those of an ideal controller, the same for all candidates, as in the replay of a
recorded run. Where no gait tells them apart and nothing wrong is the likeliest, one is chosen by what it does for the
claim that there is no gap (`next_narrow.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.imagined import LONGEST, Targets, imagined, targets_of
from r2s2r_cli.stages.diagnose.next_apart import apart
from r2s2r_cli.stages.diagnose.next_narrow import narrowest
from r2s2r_cli.stages.diagnose.next_settled import settled, unsettled, worth
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.found import NONE
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.which import Compared

REMAINING = 3
"""Effects that are told from each other and from nothing wrong: simulations, and so seconds, go with their number."""
WORTH_IT = 0.02
"""Expected probability of the right candidate that a gait must add: less is not worth a run, nor sure to be there with
a few draws of each truth."""
LEAST = 1e-9
"""Probability of a candidate that the ranking has at 0, whose logarithm is asked for."""


@dataclass(frozen=True)
class GaitLibrary:
    """Policies that can be suggested: target vectors (step, actuated) by name, as `record` takes them."""

    gaits: dict[str, Targets] = field(default_factory=dict)


@dataclass(frozen=True)
class NextGait:
    """name, targets: the policy. separates: the most probable candidate, taken as the truth, with every other one and
    the nats that it is told from that by; `none` is the refit nominal model. nats: what the gait is worth
    (`next_settled.worth`); now: the best of the gaits that were run, were it run again. narrows: target
    intervals by which it narrows the bound of `no_gap`, where it was chosen for that; then it separates nothing."""

    name: str
    targets: Targets
    separates: tuple[tuple[str, str, float], ...]
    nats: float
    now: float | None
    narrows: int | None = None


def next_gait(
    evidence: Evidence, compared: Compared, library: GaitLibrary, *, calibration: Calibration,
    told: Callable[[str, int, int], None],
) -> NextGait | None:  # fmt: skip
    """None where there is no gait to choose from, or none is worth a run. calibration: of the ranking."""
    if not library.gaits:
        return None
    told("next gait", 0, 1)
    found = _separating(evidence, compared, library, calibration) or _narrowing(evidence, compared, library)
    told("next gait", 1, 1)
    return found


def _separating(
    evidence: Evidence, compared: Compared, library: GaitLibrary, calibration: Calibration
) -> NextGait | None:
    fits, p = _remaining(compared)
    if len(fits) < 2:
        return None
    own = {f"as run: {run.name}": targets_of(run.caps.intervals.target) for run in evidence.only(evidence.fit)}
    nats = {
        name: apart(compared.arena, imagined(compared.arena, targets[:LONGEST], name=name), fits)
        for name, targets in {**library.gaits, **own}.items()
    }
    names = [_name(fit) for fit in fits]
    sure = {
        name: settled(p, own_nats, calibration.temperature, none=names.index(NONE),
                      nothing=-calibration.none / calibration.temperature)
        for name, own_nats in nats.items()
    }  # fmt: skip
    before = unsettled(p)
    best = chosen(before, {name: one for name, one in sure.items() if name in library.gaits})
    if best is None:
        return None
    value = {name: worth(before, one, calibration.temperature) for name, one in sure.items()}
    return NextGait(
        best, library.gaits[best], tuple((names[0], names[j], float(nats[best][0, j])) for j in range(1, len(names))),
        value[best], max((value[name] for name in own if name in value), default=None),
    )  # fmt: skip


def _narrowing(evidence: Evidence, compared: Compared, library: GaitLibrary) -> NextGait | None:
    """Where the verdict is open for nothing but the bound. Without healthy runs these do more: the floor is a guess."""
    which = compared.which
    if which.verdict != "ambiguous" or which.ranking[0].effect != NONE or not evidence.healthy:
        return None
    best = narrowest(compared.arena, compared.base, library.gaits, which.no_gap.floor)
    return None if best is None else NextGait(best[0], library.gaits[best[0]], (), 0.0, None, narrows=best[1])


def chosen(before: float, sure: Mapping[str, float]) -> str | None:
    """The gait after which the expected probability of the truth is largest, sure by name; None where no gait adds
    enough to that of before."""
    best = max(sure, key=lambda name: sure[name], default=None)
    return None if best is None or sure[best] < before + WORTH_IT else best


def _remaining(compared: Compared) -> tuple[list[Fit], np.ndarray]:
    """The refit nominal model and the best fits of the effects in the 90 % set, one a name and at least one, most
    probable first, and how probable they are. `unknown` predicts nothing, and some effects change no prediction."""
    fits: dict[str, Fit] = {NONE: compared.base}
    for fit in compared.fits:
        if len(fit.hypothesis.parts) == 1:
            fits.setdefault(_name(fit), fit)
    ranked = {one.effect: max(one.probability, LEAST) for one in compared.which.ranking if one.effect in fits}
    effects = [name for name in ranked if name != NONE]
    within = [name for name in effects if name in compared.which.set90][:REMAINING] or effects[:1]
    kept = [name for name in ranked if name == NONE or name in within]
    return [fits[name] for name in kept], np.array([ranked[name] for name in kept])


def _name(fit: Fit) -> str:
    return fit.hypothesis.effects[0] if fit.hypothesis.parts else NONE
