"""Which effects a diagnosis chooses from, by what was typed after `--effect`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from r2s2r_cli.commands.diagnose import _require_effects
from r2s2r_cli.commands.diagnose_inputs import Asked, there_already
from r2s2r_cli.effects import CATALOGUE
from r2s2r_cli.effects.known import looked_for
from r2s2r_cli.errors import UsageError
from r2s2r_cli.stages.diagnose.which.candidates import candidates
from r2s2r_cli.stages.diagnose.which.numbers import Model
from r2s2r_cli.stages.identified import Identified
from r2s2r_cli.stages.identify.free import Mapping, select
from tests.support.builders import robot

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


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ((), []),
        (("catalogue", "payload"), []),
        (("payload",), ["all other effects: --effect has only payload; --effect catalogue adds the rest"]),
        (("catalogue", "stribeck"), ["calibration of stribeck: probabilities were learned from sets without"]),
        (("stribeck", "air_drag"), [
            "all other effects: --effect has only stribeck, air_drag; --effect catalogue adds the rest",
            "calibration of stribeck, air_drag: probabilities were learned from sets without",
        ]),
    ],
)  # fmt: skip
def test_what_was_not_weighed_is_said(typed: tuple[str, ...], said: list[str]) -> None:
    """Where only some effects were considered, and where one is that no calibration set has."""
    assert list(asked(*typed).not_weighed()) == said


def test_the_catalogue_has_no_elements() -> None:
    """The word alone is right; with an element the hint is the word, and not that there is no such effect."""
    _require_effects(asked("catalogue", "stribeck").named)
    with pytest.raises(UsageError) as caught:
        _require_effects(("catalogue:1",))
    assert caught.value.hint == "r2s2r diagnose --effect catalogue"


def test_what_the_identification_has_already_is_said_to_be_left_out() -> None:
    """Where it was named; one that is there and off is looked for, and so is one that is not there."""
    frees = select(("stribeck.static_factor", "air_drag.drag_n_s_per_m"), robot(), ("stribeck", "air_drag"))
    mapping = Mapping(robot(), frees, ("stribeck", "air_drag"))
    model = Identified("30-identify.h5", robot(), mapping, np.array([1.3, 0.0]), np.eye(2))
    said = there_already(model, ("stribeck", "air_drag", "obstacle"), Path("a/30-identify.h5"))
    assert said == ("stribeck: 30-identify.h5 has it already, so it is not looked for",)
    assert there_already(model, (), Path("a/30-identify.h5")) == ()
    made = {one.effect for one in candidates(Model(model, asked=("stribeck", "air_drag", "obstacle")))}
    assert made & {"stribeck", "air_drag", "obstacle"} == {"air_drag", "obstacle"}
