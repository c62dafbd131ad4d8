"""The world of a seed, far enough from robot.toml: both are asked what becomes of policies planned without knowing it.

A world in which robot.toml is nearly right has no gap to close. So worlds are drawn until the engine, with the numbers
of both, ends FLOORS floors apart in the median of the four long policies that are planned from robot.toml alone, and
until its cables stay as long in them as the guard of the robot asks for: where tendons are so soft that end caps come
together it is stopped. No camera, no rig and no identification is asked, and the loop plans its own policies.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from statistics import median

import h5py
import tomlkit

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from shown import ends_apart, simulated  # noqa: E402 - beside this file
from world import r2s2r, unknown  # noqa: E402

FLOORS, FLOOR_M = 8.0, 5e-3
"""How far apart; and the floor [m] at ends, about what repeats of a policy differ by (README.md, in the median). Five
are asked for; policies that the loop plans, over what it does not know, care less than those of robot.toml."""
POLICIES = ("straight", "turn-clockwise", "turn-counterclockwise", "arching")
TRIES = 200


def prior_plan(project: Path) -> Path:
    """The plan of a robot that was never seen, in a folder of its own; a small search is enough."""
    folder = project / "prior"
    found = folder / "iterations" / "001" / "40-plan.h5"
    if not found.exists():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name in ("project.toml", "robot.toml"):
            shutil.copy(project / name, folder)
        r2s2r(folder, "plan", "--iteration", "1", "--set", "plan.draws=4", "--no-draw")
    return found


def shortest(folder: Path) -> float:
    """The shortest that a cable becomes in the simulated policies of `folder` [m]."""
    with h5py.File(folder / "iterations" / "001" / "simulation.h5", "r") as file:
        return min(float(run["frames/length"][:].min()) for run in file["runs"].values())


def far_apart(project: Path, seed: int, first: int = 0) -> dict[str, object]:
    """truth.toml and world.toml of the first world of this seed that is far enough, from number `first` on; what is
    true in it, and how far.

    Raises SystemExit where none of TRIES worlds is.
    """
    plan = prior_plan(project)
    words = [f"{plan}:{name}" for name in POLICIES]
    told = simulated(project / "prior" / "told", project / "robot.toml", project, words)
    guarded = float(tomlkit.parse((project / "robot.toml").read_text("utf-8"))["limits"]["cable_length_min_m"])
    for number in range(first, TRIES):
        drawn = unknown(project, seed, number)
        true = simulated(project / "prior" / "true", project / "truth.toml", project, words)
        away = [ends_apart(one, other) for one, other in zip(told, true, strict=True)]
        if median(away) >= FLOORS * FLOOR_M and shortest(project / "prior" / "true") > guarded:
            return {
                **drawn,
                "world": number,
                "ends apart, mm": dict(zip(POLICIES, (1e3 * x for x in away), strict=True)),
            }
    raise SystemExit(f"{project}: none of {TRIES} worlds is {1e3 * FLOORS * FLOOR_M:.0f} mm away from robot.toml")
