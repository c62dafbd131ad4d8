"""Findings of the logs have units, and the digits that mean something."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from r2s2r_cli.stages.diagnose.parity.expected import EXPECTED
from r2s2r_cli.stages.diagnose.parity.parity import finding_of
from r2s2r_cli.stages.diagnose.parity.quantities import Key
from r2s2r_cli.stages.diagnose.parity.series import Measured
from r2s2r_cli.stages.diagnose.report import _parity


def said(check: str, value: float, *, knock: object = None, healthy: bool = False) -> str:
    """What a report says of that check of cap 2, as if it were 3 sd from what is expected."""
    key: Key = (check, "cap", 2)
    base = SimpleNamespace(of={key: Measured(0.0, 0.001)}) if healthy else None
    made = finding_of(key, Measured(value, 0.01), base, SimpleNamespace(gain={}, knock=knock))  # type: ignore[arg-type]
    assert made is not None
    ((words, sd, effect),) = _parity(SimpleNamespace(parity=SimpleNamespace(significant=[replace(made, z=3.0)])))  # type: ignore[arg-type]
    assert sd == 3.0 and effect == (made.suspicions[0].effect if made.suspicions else "")
    return words


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
    assert words in said(check, value)


def test_a_knock_says_when() -> None:
    """What follows the number is kept; healthy runs are said."""
    words = said("knock", 0.008, knock=SimpleNamespace(t=2.0, run="a", whole=0.009), healthy=True)
    assert words.endswith("is 8.0 mm, 0 mm in healthy runs; at 2.00 s of a they move by 9 mm (+3.0 sd)")


def test_every_check_without_a_unit_is_a_share_a_logarithm_or_a_ratio() -> None:
    """So that no bare number is shown."""
    bare = {name for name, one in EXPECTED.items() if one.unit == "1"}
    assert bare == {name for name, one in EXPECTED.items() if one.reads}
