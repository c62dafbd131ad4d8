"""What speaks against a fit, in words: rivals that predict as well, more than a motor can do, bounds that were hit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from r2s2r_cli.stages.identify.found import OURS, REPEATS, ParameterFound, ProfileFound
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.measures.baselines import NOTHING_MOVES
from r2s2r_cli.stages.measures.table import Row

WORDS = {OURS: "the identified simulator", REPEATS: "the identified simulator with what repeats"}
RATE = "motor_speed"
"""Names of winding rates begin like this; their unit is the no-load speed."""
BEYOND = 0.05
"""Of the width of an interval: ends of ranges are quantiles of draws."""
ON_BOUND = 1e-6
"""Relative distance from a bound that is none."""


def outdone(rows: Mapping[str, Row], closed_loop_m: float | None, own: str = OURS) -> tuple[str, ...]:
    """Rivals of smaller held-out error, as it is shown, and a free run with the controller that is worse than none.

    rows: predictors over the test intervals; closed_loop_m: mean error of that free run; own: the row that is our
    prediction."""
    ours, found = rows.get(own), list[str]()
    if ours is None or ours.key.rmse_m is None:
        return ()
    for name, row in rows.items():
        if name == own or row.key.rmse_m is None or _shown(row.key.rmse_m) >= _shown(ours.key.rmse_m):
            continue
        difference = ours.against(row)
        surely = difference is not None and _shown(difference.interval.lower) > 0.0
        how = "better than" if surely else "at least as well as"
        found.append(f"'{name}' predicts the held-out key frames {how} {WORDS.get(own, own)}")
    idle = rows[NOTHING_MOVES].free_m if NOTHING_MOVES in rows else None
    if closed_loop_m is not None and idle is not None and closed_loop_m > idle:
        found.append(
            "with the controller in the loop the free run is worse than 'nothing moves': it drifts out of step with "
            "the robot"
        )
    return tuple(found)


def _shown(error_m: float) -> float:
    """As the tables show it [mm]: what they show as equal is no more than rounding."""
    return round(1e3 * error_m, 1)


def contradicted(parameters: Sequence[ParameterFound], profiles: Sequence[ProfileFound]) -> tuple[str, ...]:
    """Numbers that lie outside the interval of their own profile likelihood: the fit is no minimum along them."""
    found = []
    for one in profiles:
        value, (low, high) = parameters[one.row].value, one.interval
        if value < low or value > high:  # false beside NaN, where the profile does not end
            ends = "..".join(f"{end:.4g}" if math.isfinite(end) else "" for end in (low, high))
            said = "The interval reported holds both" if parameters[one.row].identifiable else "No interval is reported"
            found.append(
                f"{parameters[one.row].free.name} {value:.4g} lies outside the 95 % interval of its own profile "
                f"likelihood, {ends}: the loss is rough there. {said}"
            )
    return tuple(found)


def ranging(parameters: Sequence[ParameterFound]) -> tuple[str, ...]:
    """One sentence for all numbers of which other starts or noise drawn anew lead further than their interval."""
    names = []
    for one in parameters:
        low, high = one.range  # false beside NaN: nobody looked
        slack = BEYOND * (one.upper - one.lower)
        if one.identifiable and (low < one.lower - slack or high > one.upper + slack):
            names.append(f"{one.free.name} ({low:.4g}..{high:.4g})")
    if not names:
        return ()
    return (
        f"other starts or noise drawn anew lead further than the 95 % interval: {', '.join(names)}; doubt these sd",
    )


def doubtful(parameters: Sequence[ParameterFound]) -> tuple[str, ...]:
    """One sentence for all winding rates beyond the no-load speed, and one for each bound that was hit."""
    free = [one for one in parameters if one.trust is not None]
    return (*_too_fast(free), *(_on_bound(one) for one in free if _hit(one)))


def _too_fast(parameters: Sequence[ParameterFound]) -> list[str]:
    fast = [one for one in parameters if one.free.name.startswith(RATE) and one.identifiable and one.value > 1.0]
    if not fast:
        return []
    rates = ", ".join(f"{one.free.name} {one.value:.3g}" for one in fast)
    unsure = [one.free.name for one in fast if one.lower <= 1.0]
    text = f"faster than the motor turns without load: {rates}"
    if unsure:
        text += f" (the 95 % interval of {', '.join(unsure)} reaches below 1)"
    why = (
        "no_load_rad_per_s or winch_radius_m in robot.toml is too small, or these rates make up for something that is "
        "not modelled, such as line that winds on line"
    )
    return [f"{text}. Either {why}: predict with them, do not report them as speeds"]


def _hit(one: ParameterFound) -> bool:
    """Whether the fit ended on a bound: also of a number that the runs turned out not to determine."""
    free = one.free
    away = min(one.value - free.lower, free.upper - one.value)
    return one.trust is Trust.ON_BOUND or (one.value != free.start and away <= ON_BOUND * max(abs(one.value), 1e-12))


def _on_bound(one: ParameterFound) -> str:
    free, name = one.free, one.free.name
    low = one.value - free.lower <= free.upper - one.value
    if one.trust is Trust.NOT_IDENTIFIABLE:
        return (
            f"{name} went to its bound {one.value:g} although the runs do not determine it: other numbers can make up "
            f"for it, so give it a value that is known, --fix {name}={free.mean:g}, or a narrower prior"
        )
    unit = "" if free.unit == "1" else f" {free.unit}"
    asked = "less" if low else "more"
    text = f"{name} lies on its bound {(free.lower if low else free.upper):g}{unit}: the runs ask for {asked}"
    wide = wider(free, below=low)
    if wide is None:
        return f"{text} than the number can be at all: something else is missing that it makes up for"
    return f'{text}, and the other numbers make up for what it may not be; add --free "+{name},{wide}" to see how much'


def wider(free: Free, *, below: bool) -> str | None:
    """Bounds LOWER..UPPER that go further on that side, as in a spec; None where the number ends there."""
    low, high = free.lower, free.upper
    reach = 0.5 * (high - low) if math.isfinite(high - low) else 1.0
    if below and free.coordinate is Coordinate.LINEAR and low < 0:
        low -= reach
    elif below:
        if low <= 0:
            return None
        low *= 0.5
    elif free.coordinate is Coordinate.LOGIT:
        if high >= 1:
            return None
        high = 0.5 * (high + 1.0)
    else:
        high += reach
    return "..".join(f"{end:.4g}" if math.isfinite(end) else "" for end in (low, high))
