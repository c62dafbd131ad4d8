"""What the logs say against each other, for people: every number with its unit, to the digits that mean something."""

from __future__ import annotations

import math

from r2s2r_cli.stages.diagnose.parity.expected import EXPECTED
from r2s2r_cli.stages.diagnose.parity.finding import Finding
from schemas.people import quantity

SHARES = ("dropout", "sensor_gain", "load", "droop")
"""Checks whose numbers are shares."""
LOGARITHMS = ("winch_speed", "winch_rate", "in_over_out")
"""Checks whose numbers are logarithms of ratios."""
RATIOS = ("rod_length", "camera_scale")
"""Checks whose numbers are ratios near 1."""


def finding_words(one: Finding) -> str:
    """`the motion that is lost where a winch reverses is 12 mm, 0 mm as built (+2.9 sd)`."""
    what = EXPECTED[one.check].words.format(element=one.element.words())
    against = "in healthy runs" if one.differential else "as built"
    more = "".join(one.what.partition("; ")[1:])  # of a knock: when
    return f"{what} is {_number(one, one.value)}, {_number(one, one.expected)} {against}{more} ({one.z:+.1f} sd)"


def _number(one: Finding, value: float) -> str:
    if one.check in SHARES:
        return f"{quantity(100.0 * value, '1', 2)} %"
    if one.check in LOGARITHMS:
        return f"{quantity(value, '1', 2)} (a factor of {math.exp(value):.2f})"
    if one.check in RATIOS:
        return f"{value:.4f}"
    return quantity(value, one.unit, 2)
