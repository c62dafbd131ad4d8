"""Whether the world of a seed is far enough from robot.toml: what both make of the policies that were executed.

`python examples/13_two_iterations/shown.py DIR` after `run.py --out DIR`: the engine with the numbers of robot.toml and
with those of truth.toml, closed loop from rest; how far apart they end, in millimetres and in floors of that iteration.
Nothing that is measured elsewhere reads it.
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
from statistics import median
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from world import COMMAND  # noqa: E402 - beside this file


@dataclass(frozen=True)
class Apart:
    """How far prior and truth end apart in one policy: com [m], heading [rad], segment [s] a target; floors: how many
    floors of the executed runs that is, None without a floor."""

    seed: str
    iteration: int
    policy: str
    com: float
    heading: float
    segment: float
    floors: Mapping[str, float | None]


def simulated(folder: Path, robot: Path, project: Path, policies: Sequence[str]) -> list[Mapping[str, Any]]:
    """The policies with the numbers of a robot file, in a project of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(project / "project.toml", folder)
    shutil.copy(robot, folder / "robot.toml")
    words = ["simulate", *policies, "--iteration", "1", "--no-draw", "--force", "--json", "--quiet"]
    done = subprocess.run([*COMMAND, *words], cwd=folder, check=True, stdout=subprocess.PIPE, text=True)
    runs: list[Mapping[str, Any]] = json.loads(done.stdout)["report"]["runs"]
    return runs


def ends_apart(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    """How far the centres of mass of two simulated runs end from each other, over the ground [m]."""
    return math.dist(one["com_displacement_m"][:2], other["com_displacement_m"][:2])


def apart(project: Path) -> Iterator[Apart]:
    """All executed policies of both iterations. Raises FileNotFoundError where the seed is not finished."""
    report = json.loads((project / "comparison.json").read_text("utf-8"))
    for number in (1, 2):
        plan = project / "iterations" / f"{number:03d}" / "40-plan.h5"
        names = sorted(
            {run["policy"].removeprefix(f"{number:03d}-") for run in report["runs"] if run["iteration"] == number}
        )
        floor = {
            measure: value["floor"]
            for one in report["history"] if one["iteration"] == number
            for measure, value in one["runs"].items()
        }  # fmt: skip
        words = [f"{plan}:{name}" for name in names]
        told, true = (
            simulated(project / "shown" / kind, project / f"{file}.toml", project, words)
            for kind, file in (("told", "robot"), ("true", "truth"))
        )
        for name, one, other in zip(names, told, true, strict=True):
            com = ends_apart(one, other)
            turn = one["heading_change_rad"] - other["heading_change_rad"]
            heading = abs(math.remainder(turn, math.tau))
            segment = abs(one["duration_s"] - other["duration_s"]) / one["targets"]
            sizes = {"com_end_m": com, "heading_end_rad": heading, "segment_s": segment}
            floors = {key: size / floor[key] if floor.get(key) else None for key, size in sizes.items()}
            yield Apart(project.name, number, name, com, heading, segment, floors)


def lines(found: Sequence[Apart]) -> Iterator[str]:
    """One a policy, and the median over all seeds."""
    yield f"{'':8} {'policy':24} prior and truth end apart, and in floors"
    for one in found:
        times = {key: "-" if value is None else f"{value:.1f}" for key, value in one.floors.items()}
        yield (
            f"{one.seed:8} {one.iteration} {one.policy:22} {1e3 * one.com:6.1f} mm ({times['com_end_m']}), "
            f"{math.degrees(one.heading):5.1f} deg ({times['heading_end_rad']}), "
            f"{one.segment:5.2f} s a segment ({times['segment_s']})"
        )
    known = [value for one in found if (value := one.floors["com_end_m"]) is not None]
    if known:
        yield (
            f"centre of mass: median {median(1e3 * one.com for one in found):.0f} mm, {median(known):.1f} floors "
            f"({min(known):.1f} .. {max(known):.1f}); wanted: 5"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    projects = [path.parent for path in sorted(given.out.resolve().glob("seed-*/comparison.json"))]
    for line in lines([one for project in projects for one in apart(project)]):
        print(line)
