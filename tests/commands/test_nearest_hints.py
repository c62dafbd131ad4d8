"""A wrong word of the command line is answered with the name that is near, else with what lists the names."""

from __future__ import annotations

import pytest

from r2s2r_cli.commands.named_runs import nearest_run
from tests.commands.conftest import invoke


@pytest.mark.parametrize(
    ("typed", "hint"),
    [
        ("foo", "r2s2r --help"),
        ("flor", "r2s2r floor"),
        ("identify --foo 3", "r2s2r identify --help"),
        ("validate --select zzz", "r2s2r validate --help   # docs/reference/checks.md lists the checks"),
        ("init new --robot 3bar", "r2s2r init new --robot threebar"),
        ("init new --robot sixbra", "r2s2r init new --robot sixbar"),
    ],
)
@pytest.mark.usefixtures("project")
def test_a_hint_offers_what_is_near_alone(typed: str, hint: str) -> None:
    """Else what lists the names there are."""
    refused = invoke(*typed.split())
    assert refused.exit_code == 2 and refused.stderr.splitlines()[-1] == f"hint: {hint}", refused.stderr


def test_a_healthy_run_is_not_guessed() -> None:
    """The run that has the name in its own, or one spelt like it; else a place for one, which is refused as typed."""
    known = ("002-after", "002-before", "crawl")
    assert [nearest_run(name, known) for name in ("after", "crawk")] == ["002-after", "crawl"]
    assert nearest_run("monday", known) == "RUN   # one of those that are listed"
