"""Where the cause sits, by both kinds of evidence: the names that compete for the gap, and the probes that have none.

A name that is committed to says its own channel and element, so that a diagnosis does not contradict itself. Where
several names remain, a channel is as probable as all its names together. Where none fits, the logs say, as far as they
show what no law has, else the probes. A gap under the floor has no size, but where an effect is likelier than nothing
it has a place. Both kinds stay in `Diagnosis.where` and the ranking as they are.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.where.found import Where
from r2s2r_cli.stages.diagnose.which.found import NONE, UNKNOWN, Ranked, Which

T = TypeVar("T", bound=Hashable)
ON_A_STRING = frozenset({"motor", "cable", "sensor"})
"""Elements of one string: a cable, the sensor beside it, the motor that winds it."""


@dataclass(frozen=True)
class Seat:
    """channel: of the design; element: the part; None where nothing says."""

    channel: str | None = None
    element: Element | None = None


def seat(which: Which, where: Where | None, actuated: Sequence[int] = ()) -> Seat:
    """Of a verdict and, where they were fitted, the probes. actuated: cable of every motor, empty: of its number."""
    if which.verdict == "no_gap" and which.ranking[0].effect in (NONE, UNKNOWN):
        return Seat()
    if which.verdict in ("effect", "pair"):
        first = next((one for one in which.ranking if one.effect in which.effects), None)
        return Seat() if first is None else Seat(first.channel, first.element)
    names = [one for one in which.ranking if one.channel is not None]
    if which.verdict == "unknown" and which.stranger is not None:
        return Seat(which.stranger.channel, which.stranger.element)
    if which.verdict == "unknown" and where is not None and where.channel is not None:
        return Seat(where.channel, where.element)
    channel = _likeliest((one.channel, one.probability) for one in names)
    own = [one for one in names if one.channel == channel]
    return Seat(channel, _element(own, actuated))


def _element(names: list[Ranked], actuated: Sequence[int]) -> Element | None:
    """The one that the names of a channel speak for together, as far as they speak of one; of the motor, cable and
    sensor of one string that of the most probable name."""
    told = [(_string(one.element, actuated), one.probability, one.element) for one in names if one.element is not None]
    key = _likeliest((key, probability) for key, probability, _ in told)
    return next((element for own, _, element in told if own == key), None)


def _string(element: Element, actuated: Sequence[int]) -> tuple[object, ...]:
    index = element.index
    if element.kind == "motor" and index is not None and actuated:
        index = actuated[index]
    return ("string" if element.kind in ON_A_STRING else element.kind, index)


def _likeliest(weighed: Iterable[tuple[T, float]]) -> T | None:
    """What has most of all weights; the first of equals."""
    total: dict[T, float] = {}
    for one, weight in weighed:
        total[one] = total.get(one, 0.0) + weight
    return max(total, key=lambda one: total[one], default=None)
