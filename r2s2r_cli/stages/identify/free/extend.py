"""`--free +SPEC`: beside the numbers that are free anyway, or with another start, bounds or prior than they have."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from r2s2r_cli.stages.identify.free.select import Spec, parse

PLUS = "+"


def extended(asked: Sequence[str], default: Sequence[str]) -> tuple[str, ...]:
    """The specs of a request, in order. asked: as after --free; default: what is free where nothing is asked for.

    Specs without a plus take the place of the default. Those with one come to what is there; of a name that is there
    they change the parts that they name, and `+FAMILY.*` takes the place of all elements of its family, as does the
    name of a whole (`+mass`) that of its parts. Raises UsageError for a spec that cannot be read.
    """
    plain = [text for text in asked if not text.startswith(PLUS)]
    if asked and len(plain) == len(asked):
        return tuple(plain)
    found = {name_of(text): text for text in (plain or default)}
    for text in asked:
        if not text.startswith(PLUS):
            continue
        more = parse(text[len(PLUS) :])
        family = more.name.removesuffix(".*")
        if more.name not in found and "." not in family:
            element = re.compile(re.escape(family) + r"\.(cap)?\d+")
            found = {name: one for name, one in found.items() if not element.fullmatch(name)}
        found[more.name] = written(_over(parse(found[more.name]), more) if more.name in found else more)
    return tuple(found.values())


def name_of(text: str) -> str:
    """The parameter or family of a spec."""
    return re.split("[=,]", text, maxsplit=1)[0].strip()


def written(spec: Spec) -> str:
    """The spec as text; `parse` reads the same."""
    text = spec.name if spec.start is None else f"{spec.name}={spec.start!r}"
    if spec.lower is not None or spec.upper is not None:
        ends = ("" if end is None else repr(end) for end in (spec.lower, spec.upper))
        text += f",{'..'.join(ends)}"
    return text if spec.prior_sd is None else f"{text},~{spec.prior_sd!r}"


def _over(base: Spec, more: Spec) -> Spec:
    given = {key: value for key, value in vars(more).items() if value is not None}
    return replace(base, **given)
