"""The robot and its two floors: an even one on which it is identified, and one with a patch that nobody told."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import tomlkit

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "13_two_iterations"))
from world import WORLD

FRICTION, SPEED = (0.32, 0.45), (0.62, 0.75)
"""From where the truth is drawn: friction (0.76 in robot.toml), and a factor of the motors' speed."""
PATCH = {"center_m": [0.3, 0.0], "radius_m": 0.3, "factor": 0.2}
"""Of the uneven floor; its rim is softer than the catalogue's."""


def draw(project: Path, seed: int) -> dict[str, float]:
    """Write truth.toml, which only the rig reads, and both worlds, the robot on the even one; what is true, for those
    who ask afterwards."""
    rng = np.random.default_rng([seed, 16])
    drawn = {"friction": float(rng.uniform(*FRICTION)), "speed": float(rng.uniform(*SPEED))}
    document = tomlkit.parse((project / "robot.toml").read_text("utf-8"))
    document["contact"]["friction"] = round(drawn["friction"], 4)
    for motor in document["motors"]:
        motor["no_load_rad_per_s"] = round(float(motor["no_load_rad_per_s"] * drawn["speed"]), 4)
    (project / "truth.toml").write_text(tomlkit.dumps(document), "utf-8")
    even = WORLD.format(seed=seed)
    (project / "even.toml").write_text(even, "utf-8")
    words = "patches = [{{ center_m = {center_m}, radius_m = {radius_m}, factor = {factor} }}]"
    patch = words.format(**PATCH)
    (project / "uneven.toml").write_text(f"{even}\n[effects.friction_field]\n{patch}\n", "utf-8")
    lay(project, "even")
    return drawn


def lay(project: Path, name: str) -> None:
    """Put the robot on a floor: `even` or `uneven`."""
    (project / "world.toml").write_text((project / f"{name}.toml").read_text("utf-8"), "utf-8")
