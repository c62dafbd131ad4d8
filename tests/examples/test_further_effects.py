"""The example of what lies beyond the catalogue: its worlds, its diagnosis that knows no truth, its table."""

from __future__ import annotations

import ast
import inspect
import json
from pathlib import Path

import pytest

from r2s2r_cli.effects import FURTHER
from r2s2r_cli.rig.world import World
from tests.examples.load import load

example = load("18_further_effects", "further")


def test_every_further_effect_has_its_worlds() -> None:
    """In the order of the list, each a table that the rig takes; and two worlds in which nothing is wrong."""
    assert list(example.FURTHER) == [effect.name for effect in FURTHER]
    assert {name: channel for name, (channel, _) in example.FURTHER.items()} == {
        effect.name: str(effect.channel) for effect in FURTHER
    }
    for name, (_, table) in example.FURTHER.items():
        World.model_validate({"effects": {name: table}})
    assert [name for name in example.names() if name.startswith("none")] == ["none-1", "none-2"]
    assert len(example.names()) == 2 * len(FURTHER) + 2


def test_what_diagnoses_knows_neither_maker_nor_truth() -> None:
    """It imports nothing that makes or opens a label, and names no folder but those of logs and verdicts."""
    tree = ast.parse(inspect.getsource(example.look))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert modules == {"r2s2r_cli.blind.catalogue", "r2s2r_cli.blind.sets", "r2s2r_cli.effects", "r2s2r_cli.errors"}
    words = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert "truth" not in words and {"sets", "verdicts"} <= words


def test_both_are_told_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was planted, how plain it is, the verdict, and at which place of the ranking the planted one stands; of a
    healthy robot that of `none`; sets without a verdict are left out."""
    for folder in ("truth", "verdicts"):
        (tmp_path / folder).mkdir()
    ranking = [{"effect": name, "probability": p} for name, p in (("payload", 0.6), ("stribeck", 0.3), ("none", 0.1))]
    for name, d in (("stribeck-1", 12.34), ("none-1", None), ("obstacle-1", 9.0)):
        (tmp_path / "truth" / f"{name}.json").write_text(json.dumps({"d": d}))
    for name in ("stribeck-1", "none-1"):
        said = {"verdict": "effect", "effects": ["payload"], "ranking": ranking}
        (tmp_path / "verdicts" / f"{name}.json").write_text(json.dumps(said))
    example.tell(tmp_path, example.names())
    one, two = capsys.readouterr().out.splitlines()
    assert " ".join(one.split()) == "stribeck-1 d 12.3 effect payload at 2: payload 0.60, stribeck 0.30, none 0.10"
    assert two.startswith("none-1") and "at 3:" in two
