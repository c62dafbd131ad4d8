"""Which effects a diagnosis chooses from, by what was typed after `--effect`."""

from __future__ import annotations

from typing import Any, cast

import pytest

from r2s2r_cli.commands.diagnose_inputs import Asked
from r2s2r_cli.effects import CATALOGUE
from r2s2r_cli.effects.known import looked_for

IDS = tuple(effect.name for effect in CATALOGUE)
NOWHERE = cast(Any, None)


def asked(*effects: str) -> Asked:
    """A request of these effects."""
    return Asked(NOWHERE, NOWHERE, effects=effects)


@pytest.mark.parametrize(
    ("typed", "considered", "named"),
    [
        ((), None, ()),
        (("payload",), ("payload",), ("payload",)),
        (("air_drag", "payload"), ("air_drag", "payload"), ("air_drag", "payload")),
        (("catalogue",), None, ()),
        (("catalogue", "payload"), IDS, ("payload",)),
        (("catalogue", "air_drag"), (*IDS, "air_drag"), ("air_drag",)),
        (("stribeck", "catalogue", "air_drag"), (*IDS, "stribeck", "air_drag"), ("stribeck", "air_drag")),
    ],
)
def test_the_word_catalogue_stands_for_it(
    typed: tuple[str, ...], considered: tuple[str, ...] | None, named: tuple[str, ...]
) -> None:
    """Nothing, or the word alone: what is looked for anyway. Ids alone: these only. Both: these beside the catalogue.
    What was named stands in the pictures whatever is known of it; the word is no effect."""
    assert asked(*typed).considered() == considered
    assert asked(*typed).named == named


def test_a_further_effect_is_at_hand_where_it_is_named() -> None:
    """The catalogue without a name; with one it comes at its place, and no other with it."""
    assert tuple(effect.name for effect in looked_for()) == IDS
    assert tuple(effect.name for effect in looked_for(("stribeck", "payload"))) == (*IDS, "stribeck")
