"""Training intervals that show nothing: there is nothing to fit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.identify import default_method
from r2s2r_cli.stages.identify.default_method import holding
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.trust.identifiability import Trust

NAMES = ("friction", "motor_speed", "stiffness.6", "stiffness.7")


def shown(monkeypatch: pytest.MonkeyPatch, *trust: Trust) -> None:
    """What the training intervals tell."""
    told = SimpleNamespace(names=NAMES[: len(trust)], trust=trust)
    monkeypatch.setattr(default_method, "known_before", lambda *_: told)


def task() -> Task:
    """Without anything: it is only handed on."""
    nothing: Any = None
    return Task(nothing, (), nothing, nothing)


def test_a_fit_of_nothing_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The file that is there is not replaced by starts that call themselves a fit."""
    shown(monkeypatch, *[Trust.NOT_IDENTIFIABLE] * 4)
    with pytest.raises(InputError) as caught:
        holding(task(), None)  # type: ignore[arg-type]
    assert caught.value.where == "--train"
    assert caught.value.received == "none that shows friction, motor_speed, stiffness.6 and 1 more"


def test_what_is_not_shown_beside_what_is_is_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its start; of nothing free nothing is held."""
    shown(monkeypatch, Trust.IDENTIFIED, Trust.NOT_IDENTIFIABLE)
    assert holding(task(), None)[0].held == ("motor_speed",)  # type: ignore[arg-type]
    shown(monkeypatch)
    assert holding(task(), None)[0].held == ()  # type: ignore[arg-type]
