"""What cannot be diagnosed: the exit code, the reason, one line that helps, and nothing written."""

from __future__ import annotations

import json
from pathlib import Path

from tests.commands.conftest import invoke


def artifacts(root: Path) -> set[str]:
    """What a diagnosis would leave."""
    return {path.name for path in root.glob("iterations/*/70-*")}


def test_without_an_identification_it_says_which_command_is_missing(estimated: Path) -> None:
    """Exit code 4: the artifact of the stage before."""
    result = invoke("diagnose", "--json")
    assert result.exit_code == 4
    error = json.loads(result.stdout)
    assert error["expected"] == "30-identify.h5" and error["hint"].startswith("r2s2r identify")
    assert not artifacts(estimated)


def test_an_effect_that_does_not_exist_is_a_usage_error(estimated: Path) -> None:
    """Exit code 2, with the nearest name."""
    result = invoke("diagnose", "--effect", "paylod", "--json")
    assert result.exit_code == 2
    assert "payload" in json.loads(result.stdout)["hint"]
    assert not artifacts(estimated)


def test_the_settings_are_shown_without_anything_to_diagnose(estimated: Path) -> None:
    """They are what the command would use."""
    result = invoke("diagnose", "--show-config")
    assert result.exit_code == 0 and "members = 16" in result.stdout
    assert not artifacts(estimated)
