"""Which effects an identification puts into the simulator, and which of their numbers are free then.

`--with-effect ID` frees every number of the effect, `--with-effect ID:K` those of its element K (a cable, a cap, a
rod). An iteration that names none keeps those of the identification before it, and starts from what that found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.identify.free.catalogue import entries, require_effects
from r2s2r_cli.stages.identify.free.entry import inside
from schemas.identification import FIXED_BY_HAND, NOT_IDENTIFIABLE

if TYPE_CHECKING:
    from schemas.robot import Robot

NONE = "none"
"""`--with-effect none`: those of the identification before are left out."""


@dataclass(frozen=True)
class EffectsAsked:
    """ids: of the effects in the simulator. specs: of their free numbers, as after --free. fixed: numbers of theirs
    that were given before."""

    ids: tuple[str, ...] = ()
    specs: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)


def effects_asked(words: Sequence[str], robot: Robot) -> EffectsAsked:
    """Of `--with-effect` words. Raises UsageError for an unknown effect, one without a number that can be fitted, an
    element that is not there, or `none` beside others."""
    if NONE in words:
        if len(words) > 1:
            raise UsageError("none and an effect", where="--with-effect", expected="none alone, or effects",
                             received=", ".join(words), hint="r2s2r identify --with-effect none")  # fmt: skip
        return EffectsAsked()
    ids, specs = list[str](), list[str]()
    for word in words:
        name, colon, element = word.partition(":")
        require_effects([name])
        ids += [] if name in ids else [name]
        own = [one for one in entries(robot).values() if one.effect == name]
        if not own:  # it would be in the simulator, and nothing of it would be found
            fitted = dict.fromkeys(one.effect for one in entries(robot).values() if one.effect)
            raise UsageError(f"{name} has no number that a fit can find", where="--with-effect", received=word,
                             expected=", ".join(fitted), hint="r2s2r identify")  # fmt: skip
        if colon and all(one.element is None for one in own):
            raise UsageError(f"{name} has no elements", where="--with-effect", expected=name, received=word,
                             hint=f"r2s2r identify --with-effect {name}")  # fmt: skip
        families = dict.fromkeys(one.family for one in own)
        for family in families:
            elements = [one.element for one in own if one.family == family and one.element is not None]
            if elements and colon and element not in map(str, elements):
                raise UsageError(
                    f"{name} has no element {element!r}", where="--with-effect",
                    expected=f"{name}:K with K of {', '.join(map(str, elements))}", received=word,
                    hint=f"r2s2r identify --with-effect {name}:{elements[0]}",
                )  # fmt: skip
            specs.append(family + (f".{element}" if elements and colon else ".*" if elements else ""))
    return EffectsAsked(tuple(ids), tuple(dict.fromkeys(specs)))


def effects_kept(before: ArtifactData, robot: Robot) -> EffectsAsked:
    """Of an earlier identification: its effects, each free number of theirs starting from what was found, but for what
    was held without the effect, which is looked for as if for the first time; and what was fixed by hand as it was."""
    known, table = entries(robot), before.groups["parameters"]
    ids = tuple(str(before.groups["fit"].attributes["effects"]).split())
    specs, fixed = list[str](), dict[str, float]()
    for k, name in enumerate(one.decode() for one in table["name"].tolist()):
        if name not in known or known[name].effect not in ids:
            continue
        free, value = known[name].free, float(table["value"][k])
        if int(table["trust"][k]) == FIXED_BY_HAND:
            fixed[name] = value
        elif int(table["trust"][k]) == NOT_IDENTIFIABLE and value == free.off:
            specs.append(name)
        else:
            specs.append(f"{name}={inside(value, free.lower, free.upper, free.prior_sd)!r}")
    return EffectsAsked(ids, tuple(specs), fixed)
