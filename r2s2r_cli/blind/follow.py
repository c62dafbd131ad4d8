"""`blind follow`: does the gait that an ambiguous verdict asks for settle it? Before, after it, after one by chance.

This part reads verdicts and writes what is to be run (`asked.json`, targets alone, for the maker's process), then has
the grown sets diagnosed as `blind run` does, watched. It knows no label: whether a verdict is right, `score` says.
"""

from __future__ import annotations

import json
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from r2s2r_cli.blind import run as blind_run
from r2s2r_cli.blind.index import read_index
from r2s2r_cli.blind.verdict import read_verdict, unreadable, write_document
from r2s2r_cli.errors import InputError

FORMAT = "r2s2r blind follow 1"
BANKS = ("suggested", "random")
"""What the maker writes for every set: the gait that was suggested, and as many targets by chance."""
TARGETS = 8
"""Of a longer suggestion the first are run: by these `diagnose` judged it (`imagined.LONGEST`)."""
COMMITS = ("effect", "pair", "no_gap", "unknown")
"""Verdicts that are not `ambiguous`."""
ASKED, VERDICTS = "asked.json", "verdicts"
_COMMAND = "r2s2r blind follow bank --verdicts verdicts --key labels.key --out follow"


@dataclass(frozen=True)
class Open:
    """A set whose verdict is ambiguous. gait: name of what was suggested, and targets: positions 0 .. 1, (target,
    actuated); None: nothing was."""

    name: str
    verdict: dict[str, Any]
    gait: str | None
    targets: tuple[tuple[float, ...], ...] | None


@dataclass(frozen=True)
class Trial:
    """Ambiguous sets of a bank, in the order of their names. index: SHA-256 of the bank's list. sets: of the bank;
    judged: of them with a verdict. asked: what the verdicts were asked for, fields of `run.Job`."""

    bank: Path
    index: str
    sets: int
    judged: int
    open: tuple[Open, ...]
    asked: dict[str, Any]

    @property
    def targets(self) -> dict[str, list[list[float]]]:
        """What is to be run, by set."""
        return {one.name: [list(row) for row in one.targets] for one in self.open if one.targets}


def trial(bank: Path, verdicts: Path) -> Trial:
    """What is ambiguous in a bank. Raises InputError where the bank has no list, there is no verdict, one cannot be
    read, is of another bank or a control, or they answer different questions."""
    index, own = read_index(bank / "index.json")
    found = [(name, _verdict(verdicts / f"{name}.json", own)) for name in sorted(index["sets"])
             if (verdicts / f"{name}.json").exists()]  # fmt: skip
    if not found:
        raise InputError("there is no verdict to follow", where=str(verdicts), expected="<set>.json of `blind run`",
                         received="none", hint="r2s2r blind run bank --out verdicts")  # fmt: skip
    asked = {key: found[0][1][key] for key in ("diagnoser", "settings")}
    for name, verdict in found:
        if any(verdict[key] != value for key, value in asked.items()):
            raise InputError("verdicts of one folder answer different questions", where=str(verdicts / f"{name}.json"),
                             expected=json.dumps(asked, sort_keys=True),
                             received=json.dumps({key: verdict[key] for key in asked}, sort_keys=True),
                             hint="r2s2r blind run bank --out verdicts-2")  # fmt: skip
    ambiguous = [(name, verdict) for name, verdict in found if _said(verdict)["verdict"] == "ambiguous"]
    return Trial(bank, own, len(index["sets"]), len(found), tuple(_open(*one) for one in ambiguous), asked)


def begin(whole: Trial, out: Path, *, seed: int) -> Path:
    """Write what is to be run, for the maker; one that was begun is gone on with. Gives the file.

    Raises InputError where `out` was begun with other verdicts or another seed.
    """
    path = out / ASKED
    text = json.dumps({"index": whole.index, "seed": seed, "sets": whole.targets}, indent=1, sort_keys=True) + "\n"
    if path.exists() and path.read_text(encoding="utf-8") != text:
        raise InputError("this follow-up was begun with other verdicts or another seed", where=str(path),
                         expected=f"{len(whole.targets)} sets, seed {seed}, as it was", received="others",
                         hint=f"{_COMMAND}-2")  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def jobs(whole: Trial, out: Path) -> tuple[blind_run.Job, ...]:
    """Both banks of the maker, asked what the verdicts before were asked. Raises InputError where they have no list."""
    return tuple(
        job
        for which in (BANKS if whole.targets else ())
        for job in blind_run.jobs(out / which, out / VERDICTS / which, **whole.asked)
    )


def run(whole: Trial, out: Path, todo: tuple[blind_run.Job, ...], **how: Any) -> Generator[dict[str, Any]]:
    """Verdicts as they come; what was said of a set is written as soon as both are there. how: as `blind run`. Raises
    as that does."""
    sets = {one.name: one for one in whole.open}
    for verdict in blind_run.run(todo, **how):
        write(whole, out, (sets[verdict["set"]],))
        yield verdict


def judged_otherwise(whole: Trial, verdict: dict[str, Any]) -> str | None:
    """In words, what else than one more gait lies between a verdict and the one before: code, or what it learned from
    a calibration bank. None: nothing that they tell."""
    before = next(one.verdict for one in whole.open if one.name == verdict["set"])
    ways = {
        "other code": lambda one: (one.get("code") or {}).get("sources_sha256"),
        "another calibration": lambda one: one["diagnosis"].get("calibrated"),
    }
    for words, of in ways.items():
        old, new = of(before), of(verdict)
        if old is not None and new is not None and old != new:
            return f"{words} than before: what changes in {verdict['set']} may not be the gait's doing"
    return None


def write(whole: Trial, out: Path, sets: Sequence[Open]) -> tuple[dict[str, Any], ...]:
    """`<set>.json` of each set whose verdicts are both there, or for which nothing was suggested; gives them."""
    found = []
    for one in sets:
        paths = {which: out / VERDICTS / which / f"{one.name}.json" for which in BANKS}
        if one.targets and not all(path.exists() for path in paths.values()):
            continue
        after = {which: _said(json.loads(path.read_text(encoding="utf-8"))) if one.targets else None
                 for which, path in paths.items()}  # fmt: skip
        gait = None if not one.targets else {"name": one.gait, "targets": len(one.targets)}
        seed = json.loads((out / ASKED).read_text(encoding="utf-8"))["seed"]
        document = {"format": FORMAT, "set": one.name, "index": whole.index, "logs": one.verdict["logs"], "seed": seed,
                    "gait": gait, "before": _said(one.verdict), **after}  # fmt: skip
        write_document(out / f"{one.name}.json", document)
        found.append(document)
    return tuple(found)


def _open(name: str, verdict: dict[str, Any]) -> Open:
    gait = verdict["diagnosis"].get("next_gait")
    if not gait or not gait["targets"]:
        return Open(name, verdict, None, None)
    return Open(name, verdict, gait["name"], tuple(tuple(map(float, row)) for row in gait["targets"][:TARGETS]))


def _said(verdict: dict[str, Any]) -> dict[str, Any]:
    """Of a verdict, what can be right or wrong."""
    document = verdict["diagnosis"]
    if verdict["failed"] or not document:
        words = str(verdict["failed"] or "no diagnosis").splitlines()[0]
        return {"failed": words, "verdict": "", "named": [], "first": "", "set90": [], "committed": False}
    kind = document["verdict"]
    first = max(document["ranking"], key=lambda row: float(row["probability"]), default={"effect": ""})["effect"]
    named = list(document["effects"]) if kind in ("effect", "pair") else []
    return {"failed": None, "verdict": kind, "named": named, "first": first, "set90": list(document["set90"]),
            "committed": kind in COMMITS}  # fmt: skip


def _verdict(path: Path, index: str) -> dict[str, Any]:
    """A verdict that can be followed up."""
    verdict = read_verdict(path, index)
    if verdict["shuffled"] is not None:
        raise InputError("a negative control is not followed up", where=str(path), expected="shuffled: null",
                         received=str(verdict["shuffled"]), hint="r2s2r blind run bank --out verdicts")  # fmt: skip
    try:
        _said(verdict)
    except (KeyError, TypeError, ValueError) as error:
        raise unreadable(path, error) from error
    return verdict
