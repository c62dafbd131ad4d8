"""The published file of a judged bank: written from what was opened, read and checked by whoever has no key."""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import index_of
from r2s2r_cli.blind.score.lines import text_of
from r2s2r_cli.blind.score.shard import Judged, Shard
from r2s2r_cli.errors import InputError, nearest_folder, quoted
from schemas.blind import (
    BlindPublished,
    PublishedDiagnosis,
    PublishedFollow,
    PublishedNext,
    PublishedRank,
    PublishedShrinkage,
)

FORMAT = "r2s2r blind published 1"
FINDINGS = 3
"""Of the parity stage, strongest first."""
_ELEMENT = ("kind", "index", "xy_m")
_USUAL: tuple[tuple[str, object], ...] = (
    ("moved", True),
    ("fitted", True),
    ("marginal_nats", 0.0),
    ("parity_nats", 0.0),
    ("size", {}),
)
"""Of a ranked name, left out."""


def published(shard: Shard, otherwise: Mapping[str, Any] | None = None) -> bytes:
    """The file of a shard: the same bytes whenever it is made from the same verdicts. otherwise: what judged, where the
    verdicts do not say."""
    judges = shard.code or (() if otherwise is None else (dict(otherwise),))
    content = {
        "format": FORMAT, "tier": shard.index["tier"], "bank": shard.index["bank"], "made_by": shard.index["made_by"],
        "index": shard.text, "index_sha256": shard.own, "asked": shard.asked, "code": list(judges),
        "calibrated": list(shard.calibrated), "missing": list(shard.missing),
        "sets": {one.name: _set(one) for one in shard.sets},
    }  # fmt: skip
    return text_of({**content, "content_sha256": _sum(content)}).encode()


def write_form(data: bytes, name: str) -> bytes:
    """As it lies on disk: compressed where the name ends with .gz; no time and no name inside."""
    return gzip.compress(data, mtime=0) if name.endswith(".gz") else data


def read_published(path: Path) -> Shard:
    """A published file as the bank that it was made from.

    Raises InputError where it is none, where anything in it was changed, where its list is not the one that its hash
    says, or where a label is not the one that was committed to.
    """
    content = _read(path)
    where = str(path)
    if (found := _sum({k: v for k, v in content.items() if k != "content_sha256"})) != content["content_sha256"]:
        raise InputError("a published file was changed", where=where, expected=str(content["content_sha256"]),
                         received=found, hint=f"git checkout {path}")  # fmt: skip
    index, own = index_of(content["index"].encode(), where=f"{where}: index")
    said = [content[name] for name in ("index_sha256", "tier", "bank", "made_by")]
    if said != [own, index["tier"], index["bank"], index["made_by"]]:
        raise InputError("a published file is not of the list that it holds", where=where,
                         expected=f"{own}, {index['tier']}, {index['bank']}", received=", ".join(map(str, said[:3])),
                         hint=f"git checkout {path}")  # fmt: skip
    sets, facts = content["sets"], index["sets"]
    if set(sets) & set(content["missing"]) or {*sets, *content["missing"]} != set(facts) or not sets:
        raise InputError("a published file holds other sets than its list", where=where, expected=f"{len(facts)} sets",
                         received=f"{len(sets)}, and {len(content['missing'])} without a verdict",
                         hint=f"git checkout {path}")  # fmt: skip
    for name, one in sorted(sets.items()):
        labels.check(labels.plain_text(one["label"], one["salt"]), facts[name]["label"], where=f"{where}: {name}")
        if one["verdict"]["logs"] != facts[name]["logs"]:
            raise InputError("a verdict is of other logs than those of the list", where=f"{where}: {name}",
                             expected=facts[name]["logs"], received=one["verdict"]["logs"],
                             hint=f"git checkout {path}")  # fmt: skip
    judged = tuple(Judged(n, one["label"], one["salt"], one["verdict"], one.get("follow"))
                   for n, one in sorted(sets.items()))  # fmt: skip
    return Shard(judged, tuple(content["missing"]), index, content["index"], own, content["asked"], where,
                 tuple(content["code"]))  # fmt: skip


def _read(path: Path) -> dict[str, Any]:
    try:
        data = path.read_bytes()
        content: dict[str, Any] = json.loads(gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data)
        BlindPublished.model_validate(content)
    except (OSError, EOFError, ValueError) as error:
        told = error.errors()[0] if isinstance(error, ValidationError) else None
        words = f"{'.'.join(map(str, told['loc']))}: {told['msg']}" if told else str(error)
        if not path.exists():
            words = "there is none of this name"
        elif isinstance(error, json.JSONDecodeError | UnicodeDecodeError):
            words = "neither JSON nor compressed JSON"
        raise InputError(
            "a published file cannot be read", where=str(path), expected=f"a file of `blind publish` ({FORMAT})",
            received=words, hint=f"ls {quoted(nearest_folder(path))}/*.json*   # what there is",
        ) from error  # fmt: skip
    return content


def _sum(content: Mapping[str, Any]) -> str:
    return sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _set(one: Judged) -> dict[str, Any]:
    v = one.verdict
    failed = v.get("failed")
    told = None if failed or not v.get("diagnosis") else _diagnosis(v["diagnosis"])
    words = None if failed is None else _without_places(str(failed))
    verdict = {"sha256": v["sha256"], "logs": v["logs"], "opened": int(v.get("opened") or 0), "failed": words,
               "cpu_s": float(v.get("cpu_s") or 0.0), "diagnosis": told}  # fmt: skip
    found = {"label": one.label, "salt": one.salt, "verdict": verdict}
    return found if one.follow is None else {**found, "follow": _follow(one.follow)}


def _diagnosis(document: Mapping[str, Any]) -> dict[str, Any]:
    found = _part(document, PublishedDiagnosis)
    found["ranking"] = [_rank(row) for row in document["ranking"]]
    if (where := document.get("where")) is not None:
        found["where"] = {k: v for k, v in where.items() if k in ("channel", "onset_segment") and v is not None}
        found["where"] |= _element(where)
    if (shrinkage := document.get("shrinkage")) is not None:
        found["shrinkage"] = _part(shrinkage, PublishedShrinkage)
    if (one := document.get("next_gait")) is not None:
        found["next_gait"] = {name: one[name] for name in PublishedNext.model_fields if one.get(name) is not None}
    found["pairs"] = [{**one, "elpd_gain": _short(one["elpd_gain"])} for one in document.get("pairs") or ()]
    found["confusable"] = [[a, b, _short(nats)] for a, b, nats in document.get("confusable") or ()]
    found["parity"] = list(document.get("parity") or ())[:FINDINGS]
    return found


def _rank(row: Mapping[str, Any]) -> dict[str, Any]:
    found = _part(row, PublishedRank) | _element(row)
    found["size"] = {name: _short(value) for name, value in row.get("size", {}).items()}
    for key in ("elpd_gain_sd", "seen_sd", "strain_nats"):
        if key in found:
            found[key] = _short(found[key])
    return {name: value for name, value in found.items() if (name, value) not in _USUAL}


def _short(value: float) -> float:
    """Of what is read and not scored, six digits."""
    return float(f"{value:.6g}")


def _element(holder: Mapping[str, Any]) -> dict[str, Any]:
    one = holder.get("element")
    return {} if one is None else {"element": {k: one[k] for k in _ELEMENT if one.get(k) is not None}}


def _follow(one: Mapping[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"seed": int(one["seed"])}
    for name in ("suggested", "random"):
        told = one[name]
        if told is not None:
            part = _part(told, PublishedFollow)
            found[name] = part if part.get("failed") is None else {**part, "failed": _without_places(part["failed"])}
    return found


def _part(document: Mapping[str, Any], model: Any) -> dict[str, Any]:
    """What the model has of a document; None is left out."""
    return {name: document[name] for name in model.model_fields if document.get(name) is not None}


def _without_places(text: str) -> str:
    """Words of an error without the folders of the machine that it happened on."""
    return re.sub(r"(?<![\w.…])/(?:[^\s/\"':]+/)+", "…/", re.sub(r"(?<!\w)/\S*?/(?=(?:r2s2r_cli|schemas)/)", "", text))
