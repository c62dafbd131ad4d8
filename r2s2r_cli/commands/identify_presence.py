"""That the numbers of an effect in a fit do not say whether the effect is there, and the commands that ask."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from r2s2r_cli.commands.identify_hints import options_of

if TYPE_CHECKING:
    from schemas.results_identify import ParameterFigures

TOLD = ("identified", "weak", "on a bound")
"""What is said of a number of which the runs say something."""
_DROPPED = ("--iteration", "--resume", "--json", "--quiet", "--force", "--dry-run", "--self-test")
"""Options of a fit that another one in its place has otherwise, or not."""
_BOTH = ("--project", "--also")
"""Options that mean the same for both commands; a diagnosis inherits the intervals."""


def whether_there(
    parameters: Mapping[str, ParameterFigures], effects: Sequence[str], number: int, typed: Sequence[str] = ()
) -> tuple[str, str] | None:
    """(sentence, command) where the fit has numbers of effects of which the runs say something; None: it has none.

    effects: ids of all that are known. number: of the iteration; typed: options of `identify` as given. A diagnosis
    does not look for what its simulator has already, so the simulator is identified without first.
    """
    numbers = [name for name, one in parameters.items() if one.trust in TOLD and _effect(name) in effects]
    if not numbers:
        return None
    asked = list(dict.fromkeys(map(_effect, numbers)))
    sentence = (
        f"The trust of {', '.join(numbers)} is in the size, if the effect is there: that it is there the fit does not "
        "say, and a number more takes up whatever else the simulator lacks. A diagnosis says it, of a simulator that "
        "is identified without (which replaces this one)"
    )
    words = [word for option in options_of(typed) if not _of(option, asked) for word in option if word is not None]
    words += [] if "--with-effect" in words else ["--with-effect", "none"]
    refit = ["r2s2r", "identify", "--iteration", str(number), *words]
    runs = [word for name, value in options_of(typed) if name in _BOTH and value for word in (name, value)]
    named = [word for one in asked for word in ("--effect", one)]
    diagnose = ["r2s2r", "diagnose", "--iteration", str(number), *runs, *named]
    return sentence, f"{shlex.join(refit)} && {shlex.join(diagnose)}"


def _effect(name: str) -> str:
    """`friction_anisotropy` of `friction_anisotropy.ratio`; nothing of a number that has no dot."""
    return name.partition(".")[0] if "." in name else ""


def _of(option: tuple[str, str | None], asked: Sequence[str]) -> bool:
    """Whether an option is of the effects that are asked about, or of this run of the command alone."""
    name, value = option
    text = (value or "").removeprefix("+")
    if name == "--with-effect":
        return text.partition(":")[0] in asked
    if name in ("--free", "--fix"):
        return text.replace("=", ".").replace(",", ".").partition(".")[0] in asked
    return name in _DROPPED
