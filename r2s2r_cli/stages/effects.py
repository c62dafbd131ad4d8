"""The effects that are known here, for whoever shows or uses them by name."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.nearest import nearest

if TYPE_CHECKING:
    from r2s2r_cli.effects import Effect


def all_effects() -> tuple[Effect, ...]:
    """Whatever is known by name: the catalogue, what is looked for only where it is named, the effects of installed
    packages. Raises InputError for a package whose effect is none."""
    from r2s2r_cli.effects import known_effects
    from r2s2r_cli.engine import EngineInputError

    try:
        return known_effects()
    except EngineInputError as error:
        raise InputError(
            error.what, where=error.field, expected=error.expected, received=error.received,
            hint="pip uninstall PACKAGE   # the one that brings this effect, or mend it (docs/how-to-extend.md)",
        ) from error  # fmt: skip


def effects_looked_for(asked: Collection[str] = ()) -> tuple[Effect, ...]:
    """What a diagnosis has at hand where these ids are `asked` for. Raises InputError as `all_effects`."""
    from r2s2r_cli.effects import looked_for

    all_effects()
    return looked_for(asked)


def effect_of(name: str, *, where: str, command: str) -> Effect:
    """The effect of that id. Raises UsageError for an unknown one, with the nearest in a command to paste."""
    found = {effect.name: effect for effect in all_effects()}
    if name not in found:
        near = _near(name, tuple(found))
        raise UsageError(f"unknown effect {name!r}", where=where, expected=", ".join(found), received=name,
                         hint=f"{command} {near[0]}" if near else "r2s2r effects")  # fmt: skip
    return found[name]


def _near(name: str, known: Sequence[str]) -> list[str]:
    """The id that was probably meant: the one that has the name among its words, else one that is spelt like it."""
    of_word = [one for one in known if name in one.split("_")]
    return of_word if len(of_word) == 1 else [*filter(None, [nearest(name, known)])]
