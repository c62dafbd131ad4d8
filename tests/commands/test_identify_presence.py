"""A size that is identified is no proof that the effect is there: it is said where one was fitted, with what asks."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from r2s2r_cli.commands.identify_outcome import Outcome
from r2s2r_cli.commands.identify_presence import whether_there
from r2s2r_cli.console import Console
from schemas.results_identify import IdentifyReport, ParameterFigures
from tests.commands.conftest import invoke
from tests.stages.identify.reports import report
from tests.support import builders

IDS = ("motor_lag", "friction_anisotropy", "ours")
RATIO = "friction_anisotropy.ratio"


def fitted(**trusts: str) -> dict[str, ParameterFigures]:
    """Numbers by name, with `__` for the dot, and what is said of their trust."""
    one = ParameterFigures(value=1.0, sd=0.1, lower=0.8, upper=1.2, range=None, unit="1", identifiable=True,
                           trust="identified", reason="", start=1.0, bounds=(0.0, 2.0))  # fmt: skip
    return {name.replace("__", "."): one.model_copy(update={"trust": trust}) for name, trust in trusts.items()}


def with_effect(trust: str = "identified") -> IdentifyReport:
    """A report that has a number of an effect beside its own."""
    said = report(builders.identification(repeating=True))
    return said.model_copy(update={"parameters": {**said.parameters, **fitted(friction_anisotropy__ratio=trust)}})


@pytest.mark.parametrize("trust", ["identified", "weak", "on a bound"])
def test_it_is_said_of_every_number_of_an_effect_that_the_runs_speak_of(trust: str) -> None:
    """Of effects that installed packages bring as well; not of the robot's own numbers, whatever their dots."""
    said = whether_there(fitted(ours__size=trust, motor_speed__2="identified", friction="weak"), IDS, 1)
    assert said is not None
    assert "The trust of ours.size is in the size" in said[0] and "motor_speed" not in said[0]


@pytest.mark.parametrize("trust", ["not identifiable", "fixed"])
def test_nothing_is_said_where_the_runs_do_not_speak_of_it(trust: str) -> None:
    """Nor where no number is one of an effect."""
    assert whether_there(fitted(motor_lag__tau_s=trust, friction="identified"), IDS, 1) is None


@pytest.mark.parametrize(
    ("typed", "refit", "diagnose"),
    [
        ("", "--with-effect none", ""),
        (f"--with-effect friction_anisotropy --free +{RATIO}=1.3 --fix friction_anisotropy.angle_rad=0 --force",
         "--with-effect none", ""),
        (f"--free {RATIO},1..2 --free friction", "--free friction --with-effect none", ""),
        ("--with-effect friction_anisotropy --with-effect payload:0 --train a:1-7 --project r --also 2 --json",
         "--with-effect payload:0 --train a:1-7 --project r --also 2", "--project r --also 2 "),
    ],
)  # fmt: skip
def test_the_commands_ask_of_a_simulator_without_the_effect(typed: str, refit: str, diagnose: str) -> None:
    """What else was asked for stays; what is of the effect goes; the diagnosis has the same runs."""
    said = whether_there(fitted(friction_anisotropy__ratio="weak"), IDS, 3, typed.split())
    assert said is not None
    assert said[1] == (f"r2s2r identify --iteration 3 {refit} && "
                       f"r2s2r diagnose --iteration 3 {diagnose}--effect friction_anisotropy")  # fmt: skip


def test_page_and_terminal_say_it(capsys: pytest.CaptureFixture[str]) -> None:
    """The terminal with the commands on a line of their own; neither where there is nothing to ask."""
    data, outcome = builders.identification(repeating=True), Outcome(2)
    outcome.show(with_effect(), Console())
    shown = capsys.readouterr()
    assert f"The trust of {RATIO} is in the size" in shown.out
    assert "hint: r2s2r identify --iteration 2 --with-effect none && r2s2r diagnose --iteration 2" in shown.err
    outcome.show(with_effect("fixed"), Console())
    shown = capsys.readouterr()
    assert "is in the size" not in shown.out and "hint:" not in shown.err
    page = dict(outcome.pictures(data, with_effect()))[".html"].decode()
    assert f"The trust of {RATIO} is in the size" in page and "--effect friction_anisotropy" in page


def test_the_commands_can_be_pasted(estimated: Path) -> None:
    """The first is accepted as it stands; the second needs what the first writes, and no more."""
    said = whether_there(fitted(friction_anisotropy__ratio="weak"), IDS, 1)
    assert said is not None
    refit, diagnose = (shlex.split(one)[1:] for one in said[1].split(" && "))
    again = invoke(*refit, "--dry-run")
    assert again.exit_code == 0, again.stderr
    missing = invoke(*diagnose, "--dry-run")
    assert missing.exit_code == 4 and "expected: 30-identify.h5" in missing.stderr
