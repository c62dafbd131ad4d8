"""The robot that nobody knows: robot.toml with another friction, other motors and other passive tendons, on a rig."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import tomlkit

COMMAND = [sys.executable, "-m", "r2s2r_cli"]
FRICTION, SPEED, STIFFNESS, REST = (0.3, 0.45), (0.62, 0.75), (0.4, 0.7), (0.9, 1.05)
"""From where the truth is drawn: friction (0.76 in robot.toml); factors of the motors' speed, of stiffness and rest
length of each passive tendon, as of tendons that have become soft."""


def r2s2r(project: Path, *words: str, quiet: bool = True) -> None:
    """A command that must succeed."""
    print("$ r2s2r", *words, file=sys.stderr, flush=True)
    subprocess.run([*COMMAND, *words, *(["--quiet"] if quiet else [])], cwd=project, check=True, stdout=sys.stderr)


def unknown(project: Path, seed: int, number: int = 0) -> dict[str, object]:
    """Write truth.toml and world.toml, which only the rig reads; what is true, for those who ask afterwards. number: of
    the worlds that a seed has."""
    rng = np.random.default_rng([seed, 7, number])
    document = tomlkit.parse((project / "robot.toml").read_text("utf-8"))
    drawn: dict[str, object] = {"friction": rng.uniform(*FRICTION), "speed": rng.uniform(*SPEED)}
    document["contact"]["friction"] = round(float(drawn["friction"]), 4)
    for motor in document["motors"]:
        motor["no_load_rad_per_s"] = round(float(motor["no_load_rad_per_s"] * drawn["speed"]), 4)
    for k, cable in enumerate(document["cables"]):
        if cable["kind"] == "passive":
            factors = rng.uniform(*STIFFNESS), rng.uniform(*REST)
            cable["stiffness_n_per_m"] = round(float(cable["stiffness_n_per_m"] * factors[0]), 3)
            cable["rest_length_m"] = round(float(cable["rest_length_m"] * factors[1]), 5)
            drawn[f"tendon {k}"] = factors
    (project / "truth.toml").write_text(tomlkit.dumps(document), "utf-8")
    (project / "world.toml").write_text(WORLD.format(seed=seed), "utf-8")
    return drawn


WORLD = """\
# Sensors and camera with their ordinary errors (docs/reference/world.md); between runs a hand puts the robot back.
seed = {seed}

[start]
put_back = true

[camera]
position_m = [0.0, 0.0, 2.4]

[camera.clock]
rate_hz = 10.0
"""


@contextmanager
def rig(project: Path, *, camera: bool = True) -> Iterator[tuple[str, ...]]:
    """The rig in lock-step; yields the options that name it."""
    words = ["rig", "--robot", "truth.toml", "--world", "world.toml", "--fast", "--link", "tcp", "--json"]
    words += ["--camera-port", "0"] if camera else []
    with subprocess.Popen([*COMMAND, *words], cwd=project, stdout=subprocess.PIPE, text=True) as process:
        try:
            said = ""
            while not said.endswith("}\n"):
                line = process.stdout.readline()
                if not line:
                    raise SystemExit("the rig did not start")
                said += line
            found = json.loads(said)
            yield ("--port", found["device"], *(("--camera", found["camera"]) if camera else ()))
        finally:
            process.terminate()
