"""Gaits and long policies planned from robot.toml alone, run on the rig before anything was identified.

`python examples/17_gaits_on_the_rig/run.py --out DIR`; run again it goes on where it was. Engine and rig have the same
robot.toml and different physics, sensors err as usual, and the runs go through camera and tracker. How long the search
takes, how much of every gait is left on the rig, whether the robot comes where `--to` sends it, and whether the
simulator ranks gaits as the robot does: README.md beside this file.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "13_two_iterations"))
from world import COMMAND, WORLD, r2s2r, rig  # noqa: E402 - the rig of that example

BEHAVIOURS = {
    "forward": ("com", 1),
    "backward": ("com", -1),
    "clockwise": ("turn", -1),
    "counterclockwise": ("turn", 1),
}
"""What a behaviour is about, and which way is more of it."""
BEST = 2
"""Gaits of each behaviour that are run, the best ones."""
LONG = ("straight", "arching", "turn-clockwise", "turn-counterclockwise")
REACH_M = 0.6
"""How far long policies may go: the camera sees no more."""
GOAL = (0.0, 0.3, 45.0)
"""Where `--to` sends the robot: metres along the principal axis and forward, degrees."""


@dataclass(frozen=True)
class Ran:
    """One policy: where it ended in the simulator and on the rig, along and across the heading at the start [m], and
    how far it turned [rad]."""

    policy: str
    simulated: tuple[float, float, float]
    real: tuple[float, float, float]

    def share(self) -> tuple[str, float]:
        """What its behaviour is about, and how much of the simulator's is left on the rig: 1 is all, below 0 the other
        way. Of a policy without a behaviour the larger of its way and its turn."""
        kind, sign = BEHAVIOURS.get(self.policy.rpartition("-")[0], ("", 1))
        way, turn = math.hypot(*self.simulated[:2]), abs(self.simulated[2])
        kind = kind or ("com" if way > 0.3 * turn else "turn")
        if kind == "turn":
            return kind, sign * self.real[2] / (sign * self.simulated[2])
        along = sum(a * b for a, b in zip(self.real[:2], self.simulated[:2], strict=True))
        return kind, along / way**2


def prepared(out: Path) -> Path:
    """A project whose rig is the robot of robot.toml, its sensors calibrated on the bench."""
    project = out / "gaits"
    if not (project / "calibration.h5").exists():
        shutil.rmtree(project, ignore_errors=True)
        out.mkdir(parents=True, exist_ok=True)
        r2s2r(out, "init", project.name, "--robot", "threebar")
        (project / "world.toml").write_text(WORLD.format(seed=0), "utf-8")
        shutil.copy(project / "robot.toml", project / "truth.toml")
        r2s2r(project, "rig", "--robot", "truth.toml", "--world", "world.toml", "--points", "points.csv")
        r2s2r(project, "calibrate", "--points", "points.csv", "--no-draw")
    return project


def report(project: Path, *words: str) -> Mapping[str, Any]:
    """What a command says, and once more where it was done before."""
    print("$ r2s2r", *words, file=sys.stderr, flush=True)
    done = subprocess.run([*COMMAND, *words, "--json"], cwd=project, check=True, stdout=subprocess.PIPE, text=True)
    found: Mapping[str, Any] = json.loads(done.stdout)["report"]
    return found


def names_of(plan: Mapping[str, Any]) -> Iterator[str]:
    """The best gaits of each behaviour, the long policies, and the one that goes to the goal."""
    yield from (f"{name}-{number}" for name in BEHAVIOURS for number in range(1, BEST + 1))
    yield from (name for name in LONG if any(one["name"] == name for one in plan["policies"]))
    yield "to"


def ran(comparison: Mapping[str, Any]) -> list[Ran]:
    """Every policy under the simulator of robot.toml and on the rig."""
    ends: dict[tuple[str, str], tuple[float, float, float]] = {}
    for one in comparison["policies"]:
        if one["com_m"] is not None and one["turn_rad"] is not None:
            ends[one["policy"], one["model"]] = (*one["com_m"], one["turn_rad"])
    names = dict.fromkeys(policy for policy, _ in ends)
    both = [name for name in names if {(name, "initial"), (name, "")} <= ends.keys()]
    return [Ran(name, ends[name, "initial"], ends[name, ""]) for name in both]


def lines(found: Sequence[Ran], seconds: Mapping[str, float], comparison: Mapping[str, Any]) -> Iterator[str]:
    """The table."""
    yield f"search {seconds['search']:.0f} s, all of the plan {sum(seconds.values()):.0f} s"
    yield f"{'policy':24} {'simulated x, y [mm], turn [deg]':>34} {'on the rig':>26}   left of it"
    for one in found:
        (x, y, turn), (u, v, rig_turn) = one.simulated, one.real
        kind, share = one.share()
        yield (
            f"{one.policy:24} {1e3 * x:14.0f}, {1e3 * y:5.0f}, {math.degrees(turn):6.0f}"
            f" {1e3 * u:18.0f}, {1e3 * v:5.0f}, {math.degrees(rig_turn):6.0f}   {100 * share:.0f} % of its "
            + ("way" if kind == "com" else "turn")
        )
    ranked = next(one for one in comparison["models"] if one["model"] == "initial")
    told = {"way": ranked["srcc_com"], "turn": ranked["srcc_turn"]}
    order = [f"{what} {value:.2f}" for what, value in told.items() if value is not None]
    yield f"rank correlation of {ranked['gaits']} policies with the rig: {', '.join(order) or 'too few'}"
    for one in (one for one in found if one.policy == "to"):
        x, y, turn = one.real
        goal = ",".join(f"{value:g}" for value in GOAL)
        yield f"--to {goal}: came {1e3 * x:.0f}, {1e3 * y:.0f} mm, {math.degrees(turn):.0f} deg"


def main(out: Path) -> None:
    """Plan, execute, estimate, compare; and the table."""
    project = prepared(out)
    goal = ",".join(f"{value:g}" for value in GOAL)
    plan = report(project, "plan", "--iteration", "1", "--to", goal, "--set", f"plan.reach_m={REACH_M:g}", "--no-draw")
    if not (project / "iterations" / "001" / "50-execute.h5").exists():
        with rig(project) as robot:
            r2s2r(project, "execute", *names_of(plan), "--iteration", "1", *robot, "--yes", "--no-draw")
    r2s2r(project, "estimate", "--iteration", "1", "--of", "execute", "--no-draw")
    comparison = report(project, "compare", "--iteration", "1", "--of", "execute")
    for line in lines(ran(comparison), plan["seconds"], comparison):
        print(line)
    print(f"look at: {project}/iterations/001/60-compare.html")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("gaits-on-the-rig"))
    main(parser.parse_args().out.resolve())
