"""A diagnoser that wants one more gait, and verdicts of one that asked for it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from r2s2r_cli.blind.index import index_text, read_index
from r2s2r_cli.blind.verdict import FORMAT
from r2s2r_cli.stages.diagnose.evidence import Evidence
from tests.support.blind_bank import document

TARGETS = [[0.0, 0.25, 1.0, 1.0, 0.0, 1.0], [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]]
"""What it asks for: two cables short and one on its way, and back."""


def asks(evidence: Evidence, settings: dict[str, Any]) -> dict[str, Any]:
    """Cannot tell, until it has seen a cable that was stopped on its way; a gait by chance leaves it in doubt."""
    fitted = evidence.only(evidence.fit)[-1]
    if fitted.name == "f1" and 0.25 in fitted.caps.intervals.target:
        return document("effect", ["payload"], {"payload": 0.9, "none": 0.1})
    return wants(TARGETS)


def wants(targets: list[list[float]] | None) -> dict[str, Any]:
    """An ambiguous document that suggests targets."""
    found = document("ambiguous", [], {"payload": 0.5, "com_offset": 0.4, "none": 0.1})
    gait = None if targets is None else {"name": "reversals", "file": None, "targets": targets, "nats": 9.0, "now": 2.0}
    return {**found, "next_gait": gait}


def bank_of(folder: Path, documents: dict[str, dict[str, Any]], **changed: Any) -> tuple[Path, Path]:
    """A bank that is a list alone, and verdicts on its sets. changed: of each verdict."""
    bank, verdicts = folder / "bank", folder / "verdicts"
    for one in (bank, verdicts):
        one.mkdir()
    sets = {name: {"label": "0", "logs": f"logs of {name}"} for name in documents}
    (bank / "index.json").write_text(index_text("B", "calibration", sets, "test"))
    _, own = read_index(bank / "index.json")
    for name, found in documents.items():
        (verdicts / f"{name}.json").write_text(json.dumps({**verdict(name, own, found), **changed}))
    return bank, verdicts


def verdict(name: str, index: str, found: dict[str, Any], **changed: Any) -> dict[str, Any]:
    """A file of `blind run`, as far as it is read."""
    return {
        "format": FORMAT, "set": name, "index": index, "logs": f"logs of {name}", "failed": None if found else "broke",
        "diagnoser": "tests.support.blind_follow:asks", "settings": {}, "shuffled": None, "refused": [],
        "diagnosis": found, **changed,
    }  # fmt: skip
