"""Hints of `identify` keep what was typed and can be pasted."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from r2s2r_cli.commands.identify_hints import completed, located, typed_options
from r2s2r_cli.errors import R2S2RError, UsageError
from tests.commands.conftest import invoke


@pytest.mark.parametrize(
    "typed",
    [
        "--train smaple:1-2 --test smaple:3",
        "--train smaple --test sampel:2",
        "--train sample:1-3 --test sample:2-40",
        "--train sample --test sample --seed 4",
    ],
)
def test_the_hint_of_both_sides_can_be_pasted(estimated: Path, typed: str) -> None:
    """Whatever is wrong with each of them: one hint, whose command is accepted."""
    result = invoke("identify", *typed.split(), "--dry-run")
    assert result.exit_code == 2
    pasted = shlex.split(result.stderr.splitlines()[-1].removeprefix("hint: r2s2r "))
    again = invoke(*pasted)
    assert again.exit_code == 0, (pasted, again.stderr)
    assert ("--seed" in pasted) == ("--seed" in typed)


def refusal(hint: str, where: str = "--free", received: str = "") -> R2S2RError:
    """An error with that hint."""
    return UsageError("what", where=where, received=received, hint=hint)


@pytest.mark.parametrize(
    ("typed", "error", "expected"),
    [
        ("--train a:1-7 --free mass", refusal("r2s2r identify --fix mass=1"), "--train a:1-7 --fix mass=1"),
        ("--train a:1-7 --train b", refusal("--train a:1-3"), "--train b --train a:1-3"),
        ("--free f=3,0..1 --free g", refusal("r2s2r identify --free f=0.5,0..1"), "--free g --free f=0.5,0..1"),
        ("--free=motor_sped", refusal("r2s2r identify --free motor_speed", received="motor_sped"),
         "--free motor_speed"),
        ("--free +motor_sped", refusal("r2s2r identify --free motor_speed", received="motor_sped"),
         "--free +motor_speed"),
        ("--method cma --drive closed-loop --seed 1",
         refusal("r2s2r identify --drive closed-loop   # so", where="--method cma --drive closed-loop"),
         "--seed 1 --drive closed-loop   # so"),
        ("--free motor_speed --free motor_speed.2,0.2..0.9 --free mass",
         refusal("r2s2r identify --free motor_speed.2", received="motor_speed, motor_speed.2"),
         "--free mass --free motor_speed.2"),
        ("--method paper --online", refusal("r2s2r identify --online", where="--online, --method"), "--online"),
        ("--method papier --online", refusal("r2s2r identify --method paper"), "--online --method paper"),
        ("--fix f=2 --dry-run --force", refusal("--fix g=0.5", received="f"), "--fix g=2 --dry-run --force"),
        ("--fix f=2", refusal("--fix f=0.5", received="2"), "--fix f=0.5"),
        ("--resume --seed 1", refusal("r2s2r identify --seed 1", where="iterations/001/30-identify.partial"),
         "--seed 1"),
        ("--resume --fix f=2", refusal("--fix g=0.5", received="f"), "--resume --fix g=2"),
        ("--set identify.start=3", refusal("--set identify.starts=3", received="identify.start"),
         "--set identify.starts=3"),
    ],
)  # fmt: skip
def test_a_hint_keeps_what_was_asked_for(typed: str, error: R2S2RError, expected: str) -> None:
    """The wrong option is replaced, the others stay, and the whole can be pasted."""
    assert completed(error, shlex.split(typed)) == f"r2s2r identify {expected}"


def test_a_hint_about_something_else_stays() -> None:
    """Other commands are left alone; an artifact gets the way to it, once."""
    assert completed(refusal("r2s2r estimate"), ["--train", "a"]) == "r2s2r estimate"
    path = Path("iterations/002/20-estimate.h5")
    shown = "r2s2r inspect iterations/002/20-estimate.h5   # frames"
    assert located("r2s2r inspect 20-estimate.h5   # frames", [path.absolute()]) == located(shown, [path]) == shown


def test_options_as_words() -> None:
    """Lists repeat, flags stand alone, what was not given is left out."""
    words = typed_options(train=["a:1", "b"], free=None, online=True, no_draw=False, seed=3, set_=["identify.starts=1"])
    assert words == ["--train", "a:1", "--train", "b", "--online", "--seed", "3", "--set", "identify.starts=1"]
