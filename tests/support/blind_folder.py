"""A bank and its verdicts on disk, made from labels and a reference diagnoser: sets hold a file, no robot's log."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cryptography.fernet import Fernet

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import digest, index_text
from tests.support.blind_bank import Answer

CODE = {"version": "0", "commit": "c0de", "changed": False, "sources_sha256": "f00"}


class Folder:
    """bank, verdicts: folders. key: of the labels."""

    def __init__(
        self, home: Path, truths: Sequence[dict[str, Any]], answer: Answer, *, names: Sequence[str] = (),
        tier: str = "B", bank: str = "calibration", seed: int = 1, makers: Sequence[dict[str, Any]] = (), **asked: Any,
    ) -> None:  # fmt: skip
        self.bank, self.verdicts, self.key = home / "bank", home / "verdicts", Fernet.generate_key()
        facts = {}
        for name, truth in zip(names or [f"{i:03d}" for i in range(len(truths))], truths, strict=True):
            folder = self.bank / labels.SETS / name
            folder.mkdir(parents=True)
            (folder / "log.csv").write_text(f"t_s\n{name}\n")
            sealed, commitment = labels.seal(truth, self.key)
            path = self.bank / labels.LABELS / f"{name}.sealed"
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(sealed)
            facts[name] = {"label": commitment, "logs": digest(folder)}
        text = index_text(tier, bank, facts, "test", makers)
        (self.bank / labels.INDEX).write_text(text)
        self.own = labels.sha256(text.encode()).hexdigest()
        rng = np.random.default_rng(seed)
        self.verdicts.mkdir()
        for (name, fact), truth in zip(facts.items(), truths, strict=True):
            self.judge(name, {"index": self.own, "logs": fact["logs"], "diagnosis": answer(truth, rng)} | asked)

    def judge(self, name: str, verdict: dict[str, Any]) -> None:
        """Write a verdict, or what of it is another one now."""
        path = self.verdicts / f"{name}.json"
        usual = {"format": "r2s2r blind verdict 1", "set": name, "diagnoser": "test:test", "settings": {},
                 "shuffled": None, "failed": None, "opened": 7, "refused": [], "wall_s": 2.0, "cpu_s": 1.5}  # fmt: skip
        before = json.loads(path.read_text()) if path.exists() else usual
        path.write_text(json.dumps(before | verdict, indent=1, sort_keys=True))

    def follow(self, name: str, suggested: dict[str, Any] | None, random: dict[str, Any] | None) -> Path:
        """Write what one more gait came to; gives the folder of such files."""
        folder = self.verdicts.parent / "follow"
        folder.mkdir(exist_ok=True)
        logs = json.loads((self.verdicts / f"{name}.json").read_text())["logs"]
        told = {"format": "r2s2r blind follow 1", "set": name, "index": self.own, "logs": logs, "seed": 0,
                "gait": None, "before": {}, "suggested": suggested, "random": random}  # fmt: skip
        (folder / f"{name}.json").write_text(json.dumps(told))
        return folder
