"""A bank with its verdicts, opened: labels checked against what was committed to, verdicts against bank and logs."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import digest, index_of
from r2s2r_cli.blind.verdict import read_verdict
from r2s2r_cli.errors import InputError

PLACES = ("cache", "threads")
"""Settings that say where and with how many hands, not what."""


@dataclass(frozen=True)
class Judged:
    """One set. label as it was sealed with its salt; verdict: of `blind run`; follow: of `blind follow`, where it was
    run."""

    name: str
    label: dict[str, Any]
    salt: str
    verdict: dict[str, Any]
    follow: dict[str, Any] | None = None


@dataclass(frozen=True)
class Shard:
    """index: the list; text: as it was published; own: its SHA-256. missing: sets without a verdict. asked: what the
    verdicts answer. where: file or folder. code: what judged, as far as that is known."""

    sets: tuple[Judged, ...]
    missing: tuple[str, ...]
    index: dict[str, Any]
    text: str
    own: str
    asked: dict[str, Any]
    where: str
    code: tuple[dict[str, Any], ...] = ()

    @property
    def calibrated(self) -> tuple[str, ...]:
        """Where the probabilities come from, as the verdicts say."""
        said = {str((one.verdict.get("diagnosis") or {}).get("calibrated") or "") for one in self.sets}
        return tuple(sorted(said - {""}))


def opened(bank: Path, verdicts: Path, key: bytes, *, follow: Path | None = None) -> Shard:
    """A bank's folder with those of `blind run` and `blind follow`.

    Raises InputError where a hash is not the published one, the key is another, a verdict reached for the truth or
    answers another question than the others, or there is none.
    """
    path = bank / labels.INDEX
    try:
        data = path.read_bytes()
    except OSError:
        data = b""
    index, own = index_of(data, where=str(path))
    found: list[Judged] = []
    missing = []
    for name, facts in sorted(index["sets"].items()):
        if not (verdicts / f"{name}.json").exists():
            missing.append(name)
            continue
        verdict = read_verdict(verdicts / f"{name}.json", own)
        if digest(bank / labels.SETS / name) != facts["logs"] or verdict["logs"] != facts["logs"]:
            raise InputError("the logs of a set were changed after the bank was closed", where=f"{labels.SETS}/{name}",
                             expected=facts["logs"], received=verdict["logs"],
                             hint="r2s2r blind make bank --key labels.key")  # fmt: skip
        sealed = bank / labels.LABELS / f"{name}.sealed"
        label, salt = labels.unsealed(sealed.read_bytes(), key, facts["label"], where=str(sealed))
        one_more = None if follow is None else followed(follow / f"{name}.json", own, facts["logs"])
        found.append(Judged(name, label, salt, verdict, one_more))
    if not found:
        raise InputError("there is no verdict to score", where=str(verdicts), expected="<set>.json of `blind run`",
                         received="none", hint=f"r2s2r blind run {bank} --out {verdicts}")  # fmt: skip
    if follow is not None and not any(one.follow for one in found):
        raise InputError("nothing was followed up there", where=str(follow), expected="<set>.json of `blind follow`",
                         received="none of these sets",
                         hint=f"r2s2r blind follow {bank} --verdicts {verdicts} --out {follow}")  # fmt: skip
    asked = _asked(found, verdicts)
    said = {json.dumps(one.verdict["code"], sort_keys=True) for one in found if one.verdict.get("code")}
    return Shard(tuple(found), tuple(missing), index, data.decode(), own, asked, str(verdicts),
                 tuple(json.loads(text) for text in sorted(said)))  # fmt: skip


def followed(path: Path, index: str, logs: str) -> dict[str, Any] | None:
    """A file of `blind follow`; None where there is none. Raises InputError where it is of another bank or set."""
    if not path.exists():
        return None
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        of = found["index"], found["logs"]
        _ = found["suggested"], found["random"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            "what came of one more gait cannot be read", where=str(path), expected="a file of `blind follow`",
            received=str(error), hint=f"rm {path}",
        ) from error  # fmt: skip
    if of != (index, logs):
        raise InputError("one more gait was run for another bank, or for other logs", where=str(path),
                         expected=f"{index}, {logs}", received=", ".join(map(str, of)), hint=f"rm {path}")  # fmt: skip
    return found


def _asked(found: list[Judged], verdicts: Path) -> dict[str, Any]:
    """What all of them answer."""
    first: dict[str, Any] = {}
    for one in found:
        settings = {k: v for k, v in (one.verdict.get("settings") or {}).items() if k not in PLACES}
        asked = {"diagnoser": one.verdict.get("diagnoser", ""), "settings": settings,
                 "shuffled": one.verdict["shuffled"]}  # fmt: skip
        first = first or asked
        if asked != first:
            raise InputError("verdicts of one folder answer different questions",
                             where=str(verdicts / f"{one.name}.json"),
                             expected=json.dumps(first, sort_keys=True), received=json.dumps(asked, sort_keys=True),
                             hint="r2s2r blind run bank --out verdicts-2")  # fmt: skip
    return first
