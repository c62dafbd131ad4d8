"""What speaks against a verdict, or against the numbers beside it, in words."""

from __future__ import annotations

from collections.abc import Sequence

from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.found import NONE, UNKNOWN, Ranked
from r2s2r_cli.stages.diagnose.which.material import Material
from schemas.results_diagnose import LOGGED


def of_first(ranking: Sequence[Ranked], pair: tuple[str, ...] | None) -> float:
    """Probability of the first name; of a pair that it is in that of both: what speaks for them is shared between their
    names."""
    both = pair if pair is not None and ranking[0].effect in pair else (ranking[0].effect,)
    return sum(one.probability for one in ranking if one.effect in both)


def unheard(
    ranking: Sequence[Ranked], calibration: Calibration, pair: tuple[str, ...], *, logs: bool = True
) -> tuple[str, ...]:  # fmt: skip
    """Names of a pair that logs would show by themselves and do not: a pair needs them of both. logs: they were looked
    at."""
    said = {one.effect: one.parity for one in ranking}
    return tuple(name for name in pair if logs and name in LOGGED and said.get(name, 0.0) <= calibration.by_chance)


def unwitnessed(
    ranking: Sequence[Ranked], calibration: Calibration, pair: tuple[str, ...] | None, *, logs: bool = True
) -> tuple[str, ...]:  # fmt: skip
    """Why the likeliest name is no verdict, where it would be one with a witness, or is not one of a pair. logs: they
    were looked at."""
    first = ranking[0]
    likely = first.effect not in (NONE, UNKNOWN) and calibration.commits(of_first(ranking, pair))
    if not likely:
        return ()
    if calibration.witnessed(first.effect, first.gain, first.parity, first.marginal, logs=logs):
        silent = unheard(ranking, calibration, pair, logs=logs) if pair is not None and first.effect in pair else ()
        return tuple(f"{name} is no second cause: the sensors beside what the camera sees do not show it"
                     for name in silent)  # fmt: skip
    if first.gain > 0.0 and first.marginal > 0.0:
        text = (
            f"the replay speaks for {first.effect} ({first.gain:+.1f} nats on what was left out), but not the sensors "
            f"beside what the camera sees ({first.parity:.1f} nats): it may make up for something, and is no verdict"
        )
    elif first.gain > 0.0:
        text = (
            f"what was left out speaks for {first.effect} ({first.gain:+.1f} nats), but all data together do not "
            f"({first.marginal:+.1f} nats), nor does the parity stage; it may be one event, and is no verdict"
        )
    else:
        text = (
            f"{first.effect} explains what it was fitted to, but nothing else speaks for it: neither what was left out "
            f"({first.gain:+.1f} nats) nor the parity stage; it may be one event, and is no verdict"
        )
    return (text,)


def warnings_of(m: Material, rows: Sequence[int]) -> tuple[str, ...]:
    """Of the fits in these rows, and of the floor."""
    said = []
    for i in rows:
        fit = m.fits[i]
        if not fit.moved:
            said.append(f"the fit of {fit.hypothesis.label} never left its start: its size says nothing")
        if fit.on_bound:
            said.append(f"{', '.join(fit.on_bound)} ended on a bound: another size, or another effect")
    if m.wider > 1.0:
        said.append(
            f"what the best effect leaves is {m.wider:g} times the floor: scores count errors of that size as possible"
        )
    return tuple(said)
