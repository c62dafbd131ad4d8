"""The effects that are known here: the catalogue, what is looked for only where it is named, and those that installed
packages bring (entry points)."""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache
from importlib.metadata import EntryPoint

from r2s2r_cli.effects.base import Effect
from r2s2r_cli.engine.errors import EngineInputError
from r2s2r_cli.installed import GROUP, installed


@lru_cache
def known_effects() -> tuple[Effect, ...]:
    """The catalogue, then `FURTHER`, then the effects of installed packages by name. Raises EngineInputError for one
    that is none, or that takes a name that is taken."""
    from r2s2r_cli.effects import CATALOGUE, FURTHER

    found = [*CATALOGUE, *FURTHER]
    for entry in installed():
        effect = loaded(entry)
        if effect.name in {one.name for one in found}:
            raise _bad(entry, "an effect of this id is there already", f"another id than {effect.name}", effect.name)
        found.append(effect)
    return tuple(found)


def looked_for(asked: Collection[str] = ()) -> tuple[Effect, ...]:
    """What a diagnosis has at hand: the catalogue, the effects of installed packages, and what is `asked` for by id."""
    from r2s2r_cli.effects import FURTHER

    left_out = {effect.name for effect in FURTHER} - set(asked)
    return tuple(effect for effect in known_effects() if effect.name not in left_out)


def loaded(entry: EntryPoint) -> Effect:
    """The effect of an entry point. Raises EngineInputError where it cannot be loaded or is no effect."""
    try:
        found = entry.load()
    except Exception as error:
        raise _bad(entry, "the effect cannot be loaded", "a module that can be imported", repr(error)) from error
    effect = found() if isinstance(found, type) else found
    if not isinstance(effect, Effect):
        raise _bad(entry, "not an effect", "a subclass of r2s2r_cli.effects.Effect", type(effect).__name__)
    if effect.name != entry.name:
        raise _bad(entry, "the effect has another id than its entry point", entry.name, effect.name)
    if effect.own and all(one.only_shape for one in effect.own):
        raise _bad(entry, "every number of the effect is only_shape", "a number that does something by itself",
                   ", ".join(one.name for one in effect.own))  # fmt: skip
    return effect


def _bad(entry: EntryPoint, what: str, expected: str, received: str) -> EngineInputError:
    return EngineInputError(
        f"entry point {GROUP}: {entry.name} = {entry.value}", what, expected=expected, received=received
    )
