"""One more gait in the hidden world of a set: the one that its verdict asks for, and one by chance beside it.

Of a verdict the maker is told the targets alone. What it writes are two banks, `suggested` and `random`: the sets that
are followed up with their old logs and one more run in `follow/`, and labels sealed with the key of the bank.
"""

from __future__ import annotations

import shutil
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import digest, read_index
from r2s2r_cli.blind.make.again import world_of
from r2s2r_cli.blind.make.bank import sealed, write_list, write_set
from r2s2r_cli.blind.make.drive import Gait, drive, random_gait
from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.blind.make.write import write_seen
from r2s2r_cli.blind.seam import each, open_executor
from r2s2r_cli.blind.split import FOLLOW
from r2s2r_cli.errors import InputError
from schemas.robot import Robot

Targets = Sequence[Sequence[float]]
NUMBERS = {"suggested": 48, "random": 49}
"""Banks that are written, and the number of their gait in its set: noise of the boards and of the camera is that of no
other run, and what began with an earlier gait has begun."""
NAME = "f1"
"""Of the gait: the same in both banks."""


@dataclass(frozen=True)
class Followed:
    """bank: that was diagnosed. out: of the two banks. sets: targets by name of the set, (target, actuated), 0 .. 1.
    seed: of the gait by chance, its place and heading (those of both gaits), and of their noise."""

    bank: Path
    out: Path
    key: bytes
    sets: dict[str, Targets]
    seed: int = 0


def follow(asked: Followed, *, executor: str = "local", workers: int = 1) -> Iterator[str]:
    """Names of sets as their gaits are done, each twice; the lists of both banks are written last.

    Raises InputError where the bank has no such set, its logs or labels are not those of its list, the key is another
    one, or targets are none; NumericalError where MuJoCo breaks down.
    """
    index, _ = read_index(asked.bank / labels.INDEX)
    todo = []
    for name in sorted(asked.sets):
        _check(asked, name, index["sets"])
        for which in NUMBERS:
            if sealed(asked.out / which, name).exists():
                yield name
            else:
                todo.append((asked, index["sets"][name]["label"], name, which))
    if todo:
        with open_executor(executor, workers) as pool:
            for (_, _, name, _), _ in each(pool, _one, todo, at_once=workers):
                yield name
    for which in NUMBERS:
        write_list(asked.out / which, asked.key, sorted(asked.sets), tier=index["tier"], bank=index["bank"])


def drive_later(world: Hidden, robot: Robot, which: str, targets: Targets, folder: Path, *, observed: int,
                seed: int) -> None:  # fmt: skip
    """Run the suggested gait, or as many targets by chance, and write its log into `folder`.

    Both gaits of a set begin at one place and heading, so that they differ in their targets alone. observed: draw of
    the camera's noise, as of the set. Raises NumericalError where MuJoCo breaks down.
    """
    chance = np.random.default_rng([world.seed, 16, seed])
    wanted = np.array(targets, dtype=float)
    gait = random_gait(NAME, chance, count=len(wanted))
    phase = float(chance.random())
    if which == "suggested":
        gait = Gait(NAME, wanted, gait.position, gait.heading)
    number = NUMBERS[which]
    run = drive(robot, world, gait, number, exposures=world.rate_hz, phase=phase)
    noise = np.random.default_rng([world.seed, 14, observed, number, seed])
    write_seen(folder, run, world, number, robot, noise)


def _one(job: tuple[Followed, str, str, str]) -> None:
    asked, commitment, name, which = job
    path = sealed(asked.bank, name)
    label = labels.opened(path.read_bytes(), asked.key, commitment, where=str(path))
    write_set(asked.out / which, name, asked.key, partial(_grown, asked, name, which, label))


def _grown(asked: Followed, name: str, which: str, label: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The set with one more run, in `folder`, and its label."""
    world = world_of(label, where=str(sealed(asked.bank, name)))
    shutil.copytree(asked.bank / labels.SETS / name, folder)
    robot = Robot.model_validate(tomllib.loads((folder / "robot.toml").read_text(encoding="utf-8")))
    drive_later(world, robot, which, asked.sets[name], folder / FOLLOW, observed=label["observed"], seed=asked.seed)
    return {**label, "follow": {"gait": which, "seed": asked.seed}}


def _check(asked: Followed, name: str, sets: dict[str, dict[str, str]]) -> None:
    hint = "r2s2r blind follow bank --verdicts verdicts --key labels.key --out follow"
    if name not in sets:
        raise InputError("the bank has no such set", where=str(asked.bank), expected=f"one of its {len(sets)} sets",
                         received=name, hint=hint)  # fmt: skip
    logs = digest(asked.bank / labels.SETS / name)
    if logs != sets[name]["logs"]:
        raise InputError("the logs of a set are not those that the bank was closed with",
                         where=str(asked.bank / labels.SETS / name), expected=sets[name]["logs"], received=logs,
                         hint="r2s2r blind make bank --key labels.key")  # fmt: skip
