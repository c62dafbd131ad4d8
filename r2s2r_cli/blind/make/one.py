"""One set: drive the robot through its gaits in a hidden world, write what was seen, and say what the label is."""

from __future__ import annotations

import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.blind.make.drive import Driven, drive, random_gait
from r2s2r_cli.blind.make.onset import onset
from r2s2r_cli.blind.make.oracle import Detectable, detectability
from r2s2r_cli.blind.make.worlds import Hidden
from r2s2r_cli.blind.make.write import robot_text, write_seen
from r2s2r_cli.blind.split import judged
from schemas.robot import Robot


def make_set(hidden: Hidden, folder: Path, *, observed: int = 0, oracle: bool = True) -> dict[str, Any]:
    """Write the set into `folder` (which must not be there yet) and return its label.

    observed: which draw of the camera's noise; other ones are other observations of the same motion. oracle: compute
    how well the effect can be told from the gaits that are fitted (more simulations of each of them).

    Raises NumericalError where MuJoCo breaks down, FileExistsError.
    """
    text = robot_text(hidden.tolerance)
    robot = Robot.model_validate(tomllib.loads(text))
    gaits = np.random.default_rng([hidden.seed, 13])
    folder.mkdir(parents=True)
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    runs = []
    for part, world, count in (("gaits", hidden, hidden.gaits),
                               ("commissioning", hidden.healthy(), hidden.commissioning)):  # fmt: skip
        for i in range(count):
            gait = random_gait(f"{part[0]}{i + 1}", gaits)
            # Commissioning has numbers of its own: noise of the boards is never that of a gait.
            number = i if part == "gaits" else 32 + i
            run = drive(robot, world, gait, number, exposures=hidden.rate_hz, phase=float(gaits.random()))
            noise = np.random.default_rng([hidden.seed, 14, observed, number])
            write_seen(folder / part, run, world, number, robot, noise)
            runs += [run] if part == "gaits" else []
    found = detectability(robot, hidden, fitted(runs)) if oracle and _wrong(hidden) else None
    return label(hidden, runs, found, observed)


def fitted(runs: list[Driven]) -> list[Driven]:
    """Gaits that a diagnosis of the set is given to fit (`sets.read_set`): what the judged ones show, the last, it
    never learns from. Of a single gait, which is no set to be judged, that one."""
    return runs[: len(runs) - judged(len(runs))] or runs


def label(hidden: Hidden, runs: list[Driven], found: Detectable | None, observed: int) -> dict[str, Any]:
    """What is true of a set, as JSON."""
    strange = hidden.strange
    return {
        "bank": hidden.bank.value, "seed": hidden.seed, "tier": hidden.tier, "kind": hidden.kind.value,
        "observed": observed, "factor": hidden.factor, "friction": hidden.friction, "speed": hidden.speed,
        "tolerance": hidden.tolerance, "camera": hidden.camera,
        # Of pictures the tracker says what their noise is, and the maker does not know it.
        "noise_m": None if hidden.camera else hidden.noise_m, "ar1": None if hidden.camera else hidden.ar1,
        "rate_hz": hidden.rate_hz,
        "gaits": hidden.gaits,
        "commissioning": hidden.commissioning,
        "effects": [
            {"id": one.id, "channel": one.channel, "element": one.element, "sizes": one.sizes, "table": one.table,
             "onset": onset(one, runs)}
            for one in hidden.planted
        ],
        "outside": None if strange is None else
        {"name": strange[0], "channel": strange[1].channel, "table": asdict(strange[1]), "gait": strange[2]},
        "d": None if found is None else found.d, "d_each": None if found is None else list(found.each),
        "gap_mm": None if found is None else found.gap_mm,
        "stratum": "none" if not _wrong(hidden) else None if found is None else found.stratum,
    }  # fmt: skip


def _wrong(hidden: Hidden) -> bool:
    return bool(hidden.planted) or hidden.strange is not None
