"""`r2s2r effects`: the list, the explanation, the document, and what is unknown."""

from __future__ import annotations

import json
from pathlib import Path

from typer.testing import CliRunner

from r2s2r_cli.app import app
from r2s2r_cli.effects import CATALOGUE, FURTHER

ALL = (*CATALOGUE, *FURTHER)
REFERENCE = Path(__file__).parents[2] / "docs" / "reference" / "effects.md"


def invoke(*words: str) -> str:
    """Stdout of a run that works."""
    result = CliRunner().invoke(app, ["effects", *words])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_the_list_has_all() -> None:
    """Every id, with its channel and signature, in the catalogue's order; what a mark means stands beneath."""
    text = invoke()
    assert "* looked for only where it is named: r2s2r diagnose --effect catalogue --effect ID" in text
    places = [text.index(f" {effect.name}{'*' * (effect in FURTHER)} ") for effect in ALL]
    assert places == sorted(places)
    assert all(effect.signature()[:30] in text for effect in ALL)


def test_one_is_explained() -> None:
    """What it is, where it acts, what it looks like, what it is confused with, source, numbers with bounds and unit."""
    text = " ".join(invoke("friction_field").split())
    expected = (
        "What it is: the floor", "channel contact", "tied to a place", "confused with: cap_friction",
        "Source: the unexplained turning", "friction_field.patch_radius_m m robot 0.15 0.03 to 1",
    )  # fmt: skip
    assert [words for words in expected if words not in text] == []


def test_one_that_is_looked_for_where_it_is_named_says_so() -> None:
    """With the command; one of the catalogue does not."""
    text = " ".join(invoke("stribeck").split())
    assert "where it is named: r2s2r diagnose --effect catalogue --effect stribeck" in text
    assert "where it is named" not in invoke("payload")


def test_the_document_says_the_same() -> None:
    """With --json: schema, and every number of every effect."""
    document = json.loads(invoke("--json"))
    assert document["schema"] == "r2s2r.effects/1"
    assert [one["id"] for one in document["effects"]] == [effect.name for effect in ALL]
    for one, effect in zip(document["effects"], ALL, strict=True):
        assert [number["name"] for number in one["numbers"]] == [own.name for own in effect.own]
        assert set(one["text"]) >= {"What it is", "Where it acts", "Source"}
        assert one["brought_by"] == ""
        assert one["looked_for"] == (effect in CATALOGUE)


def test_an_unknown_one_is_a_usage_error() -> None:
    """With the nearest in the hint, which can be pasted."""
    result = CliRunner().invoke(app, ["effects", "frictionfield"])
    assert result.exit_code == 2
    assert "hint: r2s2r effects friction_field" in result.stderr
    assert result.stdout == ""


def test_the_reference_has_a_section_of_each() -> None:
    """With a row for every number."""
    text = REFERENCE.read_text()
    for effect in ALL:
        assert f"\n## {effect.name}\n" in text
        assert all(f"| `{effect.name}.{own.name}` |" in text for own in effect.own)
