"""What a bank was begun with, sealed in it: going on with other options is refused, since it would mix compositions;
which code made it is kept, since it goes into its list.

Sealed, because `--effect` and `--first` tell what is in the sets. Of a bank that an earlier version began, without this
record, its labels tell most of it; it is written for such a bank as soon as these agree.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import read_index
from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.errors import UsageError, quoted

RECORD = "begun.sealed"
Record = dict[str, Any]
"""`options` and `makers`, as `begin` writes them."""
Options = Mapping[str, Any]
"""Of `blind make` by their names, those that decide what the sets are; None and False: not given."""
_WHAT = "this bank was begun with other options, and one bank has one composition"


def begun(out: Path) -> bool:
    """Whether a bank lies there, or a part of one."""
    return (out / RECORD).exists() or any((out / labels.LABELS).glob("*.sealed"))


def check_key(out: Path, key: Path) -> None:
    """Raises UsageError where a bank was begun and its key is not there: a new one could not open what it sealed."""
    if begun(out) and not key.exists():
        raise UsageError(
            "this bank was begun with a key, and a new one cannot open its labels", where=f"--key {key}",
            expected=f"the key that sealed {out}", received="no such file", hint=labels.FIND_KEY,
        )  # fmt: skip


def check_options(out: Path, key: bytes, options: Options, *, key_file: str) -> Record | None:
    """The record of the bank, which says the same; None where it has none. Raises UsageError where it says something
    else, InputError where the key is another. key_file: for people."""
    path = out / RECORD
    if not path.exists():
        return None
    found: Record = json.loads(labels.plain(path.read_bytes(), key, where=str(path)))["label"]
    was = found["options"]
    differ = [name for name in {**was, **options} if was.get(name) != options.get(name)]
    if differ:
        raise UsageError(_WHAT, where=str(path), expected=_told(was, differ), received=_told(options, differ),
                         hint=shlex.join(["r2s2r", "blind", "make", *_words(was), "--key", key_file, str(out)]),
                         )  # fmt: skip
    return found


def begin(out: Path, key: bytes, options: Options, makers: Sequence[dict[str, Any]]) -> None:
    """Write the record, whole or not at all. makers: all code that made sets of the bank; none: some that is not known
    made one."""
    out.mkdir(parents=True, exist_ok=True)
    part = (out / RECORD).with_suffix(".part")
    part.write_bytes(labels.seal({"options": dict(options), "makers": list(makers)}, key)[0])
    part.replace(out / RECORD)


def check_labels(
    out: Path, key: bytes, options: Options, there: Sequence[tuple[Hidden, Path]], names: Sequence[str]
) -> None:
    """Of a bank without a record. there: worlds that these options give, with their labels where these are there;
    names: of all sets. Raises UsageError where a label says another option; which set it is of stays unsaid."""
    strange = {path.stem for path in (out / labels.LABELS).glob("*.sealed")} - set(names)
    if strange:
        _refuse(out, "--count", f"{len(names)} sets of this key", f"{len(strange)} others beside them")
    if (out / labels.INDEX).exists():
        index, _ = read_index(out / labels.INDEX)
        for option, was in (("--count", len(index["sets"])), ("--tier", index["tier"]), ("--bank", index["bank"])):
            if options[option] != was:
                _refuse(out, option, str(was), str(options[option]))
    for world, path in there:
        data = path.read_bytes()
        label = labels.opened(data, key, labels.commitment_of(data, key), where=str(path))
        for option, wrong in _differences(world, label, options).items():
            if wrong:
                _refuse(out, option, "what the labels say that are there", "another composition")


def _differences(world: Hidden, label: Mapping[str, Any], options: Options) -> dict[str, bool]:
    """Whether a label is of another option than this world. What a label of long ago does not say differs in nothing;
    whether d was computed shows where something is wrong."""
    wrong = label.get("kind", "none") != "none"
    return {
        "--tier": label.get("tier", world.tier) != world.tier,
        "--count": label.get("kind", world.kind.value) != world.kind.value,
        "--commissioning": label.get("commissioning", world.commissioning) != world.commissioning,
        "--gaits": label.get("gaits", world.gaits) != world.gaits,
        "--noise": label.get("noise_m") not in (None, world.noise_m),
        "--effect": [one["id"] for one in label.get("effects", ())] != [one.id for one in world.planted]
        if "effects" in label
        else False,
        "--oracle": wrong and "d" in label and (label["d"] is None) != bool(options["--no-oracle"]),
    }


def _refuse(out: Path, option: str, expected: str, received: str) -> None:
    raise UsageError(_WHAT, where=f"{out}: {option}", expected=expected, received=received,
                     hint=f"r2s2r blind make --key {quoted(out.name + '-2.key')} {quoted(str(out) + '-2')}"
                     "   # a shard, a folder, a key")  # fmt: skip


def _told(options: Options, names: Sequence[str]) -> str:
    """These options as they are typed; `no --gaits` where one was not given, `--oracle` for no `--no-oracle`."""
    given = {name: shlex.join(_words({name: options.get(name)})) for name in names}
    absent = {name: f"--{name[5:]}" if name.startswith("--no-") else f"no {name}" for name in names}
    return " ".join(given[name] or absent[name] for name in names)


def _words(options: Options) -> list[str]:
    kept = {name: value for name, value in options.items() if value is not None and value is not False}
    return [word for name, value in kept.items() for word in ([name] if value is True else [name, str(value)])]
