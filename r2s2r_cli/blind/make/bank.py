"""A bank of sets: which worlds, in which order, written as they are done, closed with a list of commitments."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from r2s2r_cli import __version__
from r2s2r_cli.blind import labels
from r2s2r_cli.blind.code import code
from r2s2r_cli.blind.index import digest, index_text
from r2s2r_cli.blind.make.begun import begin, check_labels, check_options
from r2s2r_cli.blind.make.one import make_set
from r2s2r_cli.blind.make.worlds import Hidden, hidden
from r2s2r_cli.blind.seam import each, open_executor
from r2s2r_cli.blind.split import RANGES, Bank, kinds, seeds
from r2s2r_cli.errors import UsageError

BEGIN = ("r2s2r_cli.blind.make.__main__",)
"""What makes a bank; the rig and all else that decides of logs and labels follows from its imports."""


@dataclass(frozen=True)
class Asked:
    """A bank. first: number of its first set; None: of a blind bank a secret one that the key decides, else 0, so that
    nobody can make its worlds again who has not the key. commissioning: runs of the healthy robot a set. observed:
    which draw of the camera's noise. effect: its single sets all have this effect; None: any of the first release.
    gaits: of every set; None: 3, 5 or 8 by chance. noise_mm: of its caps [mm]; None: 2, 5 or 10 by chance. tier: A, our
    engine; B, the rig. camera: sets have pictures. key_file: where the key lies, for people.
    """

    bank: Bank
    count: int
    out: Path
    key: bytes
    first: int | None = None
    commissioning: int = 2
    observed: int = 0
    effect: str | None = None
    gaits: int | None = None
    noise_mm: float | None = None
    tier: Literal["A", "B"] = "B"
    oracle: bool = True
    camera: bool = False
    key_file: str = "labels.key"

    @property
    def options(self) -> dict[str, Any]:
        """What decides which sets these are, as it is typed."""
        first = self.first if self.bank is Bank.BLIND else self.first or 0
        return {
            "--bank": self.bank.value, "--tier": self.tier, "--count": self.count, "--first": first,
            "--commissioning": self.commissioning, "--observed": self.observed, "--effect": self.effect,
            "--gaits": self.gaits, "--noise": self.noise_mm, "--no-oracle": not self.oracle, "--camera": self.camera,
        }  # fmt: skip


def worlds(asked: Asked) -> tuple[Hidden, ...]:
    """Of the bank, in the order of its numbers. Raises UsageError where the bank has no such seeds."""
    first = asked.first
    if first is None:
        spare = len(RANGES[asked.bank].seeds) - asked.count
        first = labels.secret(asked.key, "first") % spare if asked.bank is Bank.BLIND and spare > 0 else 0
    own = seeds(asked.bank, asked.count, first)
    drawn = kinds(asked.count, np.random.default_rng([own[0], asked.count]))
    effects = () if asked.effect is None else (asked.effect,)
    return tuple(
        hidden(asked.bank, seed, kind, commissioning=asked.commissioning, gaits=asked.gaits, tier=asked.tier,
               effects=effects if kind.value == "single" else (), camera=asked.camera,
               noise_m=None if asked.noise_mm is None else 1e-3 * asked.noise_mm)
        for seed, kind in zip(own, drawn, strict=True)
    )  # fmt: skip


def make(asked: Asked, *, executor: str = "local", workers: int = 1) -> Iterator[str]:
    """Names of the sets as they are done; those that are there already are passed over. The list is written last.

    Raises NumericalError where MuJoCo breaks down, UsageError where the bank was begun with other options or a set that
    is there is of another world, InputError where the key is another.
    """
    record = check_options(asked.out, asked.key, asked.options, key_file=asked.key_file)
    all_jobs = [(asked, world, labels.set_name(asked.key, number)) for number, world in enumerate(worlds(asked))]
    there = {name: world for _, world, name in all_jobs if sealed(asked.out, name).exists()}
    for name, world in there.items():
        _check_world(asked, world, name)
    if record is None:
        found = [(world, sealed(asked.out, name)) for name, world in there.items()]
        check_labels(asked.out, asked.key, asked.options, found, [name for _, _, name in all_jobs])
    todo = [job for job in all_jobs if job[2] not in there]
    makers = list(record["makers"]) if record else []
    # What made the sets of a bank without a record is not known, whatever makes the rest.
    if todo and (makers or not there) and not any(_same(one, maker()) for one in makers):
        makers.append(maker())
    if record is None or makers != record["makers"]:
        begin(asked.out, asked.key, asked.options, makers)
    yield from there
    if todo:
        with open_executor(executor, workers) as pool:
            for (_, _, name), _ in each(pool, _one, todo, at_once=workers):
                yield name
    # A list that was closed is what was committed to, and stays so byte for byte.
    if todo or not (asked.out / labels.INDEX).exists():
        close(asked, makers)


def maker() -> dict[str, Any]:
    """The code that makes sets here (`blind.code`)."""
    return code(begin=BEGIN)


def _same(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return bool(one["sources_sha256"] == other["sources_sha256"])


def _check_world(asked: Asked, world: Hidden, name: str) -> None:
    """Names come from key and number alone: with another `--first` those of another shard would be taken for done."""
    path = sealed(asked.out, name)
    data = path.read_bytes()
    label = labels.opened(data, asked.key, labels.commitment_of(data, asked.key), where=str(path))
    seen = {False: "caps", True: "pictures"}
    there = (label["seed"], label["observed"], seen[label.get("camera", False)])
    wanted = (world.seed, asked.observed, seen[asked.camera])
    words = "world {} under noise {} in {}"
    if there != wanted:
        raise UsageError(
            "the folder holds sets of another bank", where=str(path),
            expected=words.format(*wanted), received=words.format(*there),
            hint=f"r2s2r blind make --key {asked.out.name}-2.key {asked.out}-2   # a shard, a folder, a key",
        )  # fmt: skip


def close(asked: Asked, makers: Sequence[dict[str, Any]] = ()) -> None:
    """Write the list of the bank, in the order of the names, which says nothing. makers: all code that made it."""
    names = [labels.set_name(asked.key, number) for number in range(asked.count)]
    write_list(asked.out, asked.key, names, tier=asked.tier, bank=asked.bank.value, makers=makers)


def write_list(
    out: Path, key: bytes, names: Iterable[str], *, tier: str, bank: str, makers: Sequence[dict[str, Any]] = ()
) -> None:
    """Write `index.json` of the bank `out`: what every set's label was committed to with, and a digest of its logs."""
    sets = {
        name: {
            "label": labels.commitment_of(sealed(out, name).read_bytes(), key),
            "logs": digest(out / labels.SETS / name),
        }
        for name in names
    }
    text = index_text(tier, bank, sets, f"r2s2r {__version__}", makers)
    (out / labels.INDEX).write_text(text, encoding="utf-8")


def write_set(out: Path, name: str, key: bytes, make: Callable[[Path], dict[str, Any]]) -> None:
    """A set and, after it, its sealed label, each there as a whole or not at all. make: writes the set into a folder
    that is not there yet, and gives the label."""
    folder, part = out / labels.SETS / name, out / labels.SETS / f".{name}.part"
    for old in (folder, part):
        shutil.rmtree(old, ignore_errors=True)  # of a maker that was interrupted
    label = make(part)
    part.rename(folder)
    data, _ = labels.seal(label, key)
    path = sealed(out, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.with_suffix(".part").write_bytes(data)
    path.with_suffix(".part").rename(path)


def sealed(out: Path, name: str) -> Path:
    """Where the label of a set lies; there once the set is done."""
    return out / labels.LABELS / f"{name}.sealed"


def _one(job: tuple[Asked, Hidden, str]) -> None:
    asked, world, name = job
    write_set(asked.out, name, asked.key, partial(make_set, world, observed=asked.observed, oracle=asked.oracle))
