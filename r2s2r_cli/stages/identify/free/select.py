"""What a user asks to be free: `--free SPEC`, one parameter each.

    SPEC = NAME[=START][,LOWER..UPPER][,~SD]

NAME: of the catalogue, or FAMILY.* for every element of a family: motor_speed.* is motor_speed.0, motor_speed.1 ...
START: where the fit begins, and the mean of the prior; default: robot.toml's. LOWER..UPPER: bounds; either end may be
left out (`..2`). ~SD: standard deviation of the prior, in the value's unit, of a positive number with a log coordinate
relative (~0.1 is 10 %), of a share with a logit coordinate in that; ~inf: no prior. The parts after the name may come
in any order. A plus before NAME: beside what is free anyway (`extend`). Examples: `friction`, `friction=0.5`,
`friction=0.5,0.2..1.5,~0.3`, `rest_length.*,~0.005`, `+mass`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.free.base import Coordinate, Free
from r2s2r_cli.stages.identify.free.catalogue import entries, require_effects, unknown
from r2s2r_cli.stages.identify.free.mapping import require_apart
from schemas.robot import Robot


@dataclass(frozen=True)
class Spec:
    """A spec in parts; None where the catalogue's holds."""

    name: str
    start: float | None = None
    lower: float | None = None
    upper: float | None = None
    prior_sd: float | None = None


def select(
    specs: Sequence[str], robot: Robot, effects: tuple[str, ...] = (), fixed: Collection[str] = ()
) -> tuple[Free, ...]:
    """The free numbers that the specs ask for, in their order; FAMILY.* without the elements that are fixed.

    Raises UsageError for a spec that cannot be read, an unknown name, a name twice, or two that set the same number
    (motor_speed and motor_speed.2: no number is a factor on another), for bounds that contradict each other, the start,
    or what the number can be at all, and for a start on a bound.
    """
    require_effects(effects)
    known = entries(robot)
    found: dict[str, Free] = {}
    for text in specs:
        spec = parse(text)
        for name in _names(spec.name, tuple(known)):
            if name != spec.name and name in fixed:
                continue
            if name in found:
                raise UsageError(f"{name} is asked for twice", where="--free", expected="each once", received=text,
                                 hint=f"r2s2r identify --free {name}")  # fmt: skip
            found[name] = _with(known[name].free, spec, text)
    require_apart([known[name] for name in found])
    return tuple(found.values())


def parse(text: str) -> Spec:
    """The parts of a spec. Raises UsageError for what is none."""
    head, *options = [part.strip() for part in text.split(",")]
    name, equals, start = (part.strip() for part in head.partition("="))
    if not name or (equals and not start):
        raise _unreadable(text, head or text)
    spec = Spec(name, start=_number(start, text) if equals else None)
    for option in options:
        if option.startswith("~") and spec.prior_sd is None:
            spec = replace(spec, prior_sd=_number(option[1:], text))
        elif ".." in option and spec.lower is None and spec.upper is None and option != "..":
            low, _, high = option.partition("..")
            spec = replace(
                spec, lower=_number(low, text) if low else None, upper=_number(high, text) if high else None
            )  # fmt: skip
        else:
            raise _unreadable(text, option)
    return spec


def _names(name: str, known: tuple[str, ...]) -> list[str]:
    """The names that one name or FAMILY.* stands for."""
    if not name.endswith(".*"):
        if name not in known:
            raise unknown(name, known)
        return [name]
    elements = [one for one in known if re.fullmatch(re.escape(name[:-1]) + r"(cap)?\d+", one)]
    if not elements:
        families = [f"{found[1]}.*" for one in known if (found := re.fullmatch(r"(.+)\.(cap)?\d+", one))]
        raise unknown(name, tuple(families))
    return elements


def _with(free: Free, spec: Spec, text: str) -> Free:
    """The catalogue's number with the user's start, bounds and prior. Raises UsageError."""
    made = replace(
        free,
        start=free.start if spec.start is None else spec.start,
        lower=free.lower if spec.lower is None else spec.lower,
        upper=free.upper if spec.upper is None else spec.upper,
        prior_sd=free.prior_sd if spec.prior_sd is None else spec.prior_sd,
    )
    unit = "" if free.unit == "1" else f" {free.unit}"
    if spec.start is not None or not made.lower <= made.mean <= made.upper:
        made = replace(made, off=None)  # whoever says where it begins says what they think it is
    range_of = f"{made.lower:g} to {made.upper:g}{unit}"
    possible = f"{free.lower:g} to {free.upper:g}{unit}"
    if not all(math.isfinite(value) for value in (made.start, made.lower, made.upper)):
        raise _contradiction(free, made, "a start or bound is no finite number", text, expected="finite numbers")
    if not made.lower < made.upper:
        raise _contradiction(free, made, "the lower bound is not below the upper", text, expected="LOWER below UPPER")
    lowest = 0.0 if free.coordinate is not Coordinate.LINEAR or free.lower >= 0 else -math.inf
    highest = 1.0 if free.coordinate is Coordinate.LOGIT else math.inf
    if made.lower < lowest or made.upper > highest:
        raise _contradiction(free, made, "a bound is beyond what the number can be", text, expected=possible)
    if made.start in (made.lower, made.upper):
        raise _contradiction(free, made, "the start lies on a bound", text, expected=f"strictly inside {range_of}")
    if not made.lower < made.start < made.upper:
        raise _contradiction(free, made, "the start is outside the bounds", text, expected=f"inside {range_of}")
    if not made.prior_sd > 0:
        raise _contradiction(free, made, "a prior needs a width", text, expected="~SD above 0, or ~inf for none")
    return made


def _contradiction(free: Free, made: Free, what: str, text: str, *, expected: str) -> UsageError:
    """made: what was asked for; of that stays in the hint what can."""
    low, high = (end if free.lower <= end <= free.upper else own
                 for end, own in ((made.lower, free.lower), (made.upper, free.upper)))  # fmt: skip
    low, high = (low, high) if low < high else (high, low) if high < low else (free.lower, free.upper)
    start = next((one for one in (made.start, free.start) if low < one < high), 0.5 * (low + high))
    return UsageError(
        f"{free.name}: {what}", where=f"--free {text}", expected=expected, received=text,
        hint=f"r2s2r identify --free {free.name}={start:g},{low:g}..{high:g}",
    )  # fmt: skip


def _number(word: str, text: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise _unreadable(text, word) from None


def _unreadable(text: str, part: str) -> UsageError:
    return UsageError(
        f"cannot read {part!r} of a free parameter", where=f"--free {text}",
        expected="NAME, NAME=START, and after commas LOWER..UPPER and ~SD", received=text,
        hint='r2s2r identify --free "friction=0.5,0.2..1.5,~0.3"',
    )  # fmt: skip
