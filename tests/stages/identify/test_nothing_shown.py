"""Training intervals that show nothing: there is nothing to fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify import holding as held
from r2s2r_cli.stages.identify.free import select
from r2s2r_cli.stages.identify.holding import holding
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from tests.support.engine import threebar

NAMES = ("friction", "motor_speed", "stiffness.6", "stiffness.7")


def shown(monkeypatch: pytest.MonkeyPatch, *trust: Trust) -> Any:
    """What the training intervals tell, and a predictor of these numbers."""
    told = SimpleNamespace(names=NAMES[: len(trust)], trust=trust, no_effect=())
    monkeypatch.setattr(held, "known_before", lambda *_: told)
    mapping = SimpleNamespace(frees=select(told.names, threebar()))
    predictor = SimpleNamespace(mapping=mapping)
    predictor.starting = lambda frees: SimpleNamespace(mapping=SimpleNamespace(frees=frees))
    return predictor


def task() -> Task:
    """Without anything: it is only handed on."""
    nothing: Any = None
    return Task(nothing, (), nothing, nothing)


def test_a_fit_of_nothing_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The file that is there is not replaced by starts that call themselves a fit."""
    predictor = shown(monkeypatch, *[Trust.NOT_IDENTIFIABLE] * 4)
    with pytest.raises(InputError) as caught:
        holding(task(), predictor)
    assert caught.value.where == "--train"
    assert caught.value.received == "none that shows friction, motor_speed, stiffness.6 and 1 more"


def test_what_is_not_shown_beside_what_is_is_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its start; of nothing free nothing is held."""
    predictor = shown(monkeypatch, Trust.IDENTIFIED, Trust.NOT_IDENTIFIABLE)
    own, begun, _ = holding(task(), predictor)
    assert own.held == ("motor_speed",)
    assert begun.mapping.frees == predictor.mapping.frees
    assert holding(task(), shown(monkeypatch))[0].held == ()
