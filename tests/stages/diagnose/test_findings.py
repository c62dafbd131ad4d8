"""Findings of the logs have units, and the digits that mean something."""

from __future__ import annotations

import pytest

from r2s2r_cli.stages.diagnose.findings import LOGARITHMS, RATIOS, SHARES, finding_words
from r2s2r_cli.stages.diagnose.parity.expected import EXPECTED
from r2s2r_cli.stages.diagnose.parity.finding import Element, Finding


def found(check: str, value: float, *, more: str = "", differential: bool = False) -> Finding:
    """A finding of that check, 3 sd from what is expected."""
    scale = EXPECTED[check]
    return Finding(check, Element("cap", 2), value, 0.01, scale.unit, scale.nominal, scale.built, differential, 3.0,
                   0.003, f"what is measured{more}")  # fmt: skip


@pytest.mark.parametrize(
    ("check", "value", "words"),
    [
        ("dropout", 0.2167, "missing or outliers is 22 %, 0 % as built (+3.0 sd)"),
        ("load", 0.09, "every other motor that runs is 9.0 %, 0 % as built"),
        ("winch_rate", 0.2018, "over that of all is 0.20 (a factor of 1.22), 0 (a factor of 1.00) as built"),
        ("cap_height", -0.003848, "than the others cap 2 stands is -3.8 mm, 0 mm as built"),
        ("latency", 0.1786, "beyond the usual lag is 0.18 s, 0 s as built"),
        ("slope_x", 0.01, "on which the caps stand is 0.57 deg, 0 deg as built"),
        ("rod_length", 1.0123456, "over that of robot.toml is 1.0123, 1.0000 as built"),
    ],
)
def test_a_number_has_its_unit_and_few_digits(check: str, value: float, words: str) -> None:
    """Of a length, a time, an angle, a share, a logarithm and a ratio."""
    assert words in finding_words(found(check, value))


def test_a_knock_says_when() -> None:
    """What follows the number is kept; healthy runs are said."""
    words = finding_words(found("knock", 0.008, more="; at 2.00 s of a they move by 9 mm", differential=True))
    assert words.endswith("is 8.0 mm, 0 mm in healthy runs; at 2.00 s of a they move by 9 mm (+3.0 sd)")


def test_every_check_without_a_unit_is_a_share_a_logarithm_or_a_ratio() -> None:
    """So that no bare number is shown."""
    bare = {name for name, one in EXPECTED.items() if one.unit == "1"}
    assert bare == {*SHARES, *LOGARITHMS, *RATIOS}
