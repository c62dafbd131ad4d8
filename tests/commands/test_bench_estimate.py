"""`r2s2r bench estimate`: what it needs and what it takes, said before anything is drawn."""

from __future__ import annotations

import sys

import pytest

from tests.commands.conftest import invoke
from tests.guards.listing import ROOT


def test_without_mujoco_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rig draws the pictures, so its extra is named in the hint."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    result = invoke("bench", "estimate")
    assert result.exit_code == 4
    assert "MuJoCo is not installed" in result.stderr
    assert f"hint: pip install -e '{ROOT}[rig]'" in result.stderr


def test_an_unknown_case_is_refused() -> None:
    """The cases that there are stand in the message."""
    result = invoke("bench", "estimate", "--case", "3 m")
    assert result.exit_code == 2
    assert "there is no case 3 m" in result.stderr
    assert "all hidden 1 s" in result.stderr
