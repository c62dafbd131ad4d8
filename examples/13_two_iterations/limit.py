"""What no identification can better: the engine with the true numbers on the policies that were executed.

`python examples/13_two_iterations/limit.py DIR` after `run.py --out DIR`: robot.toml with friction, motors and tendons
of truth.toml; only what no drawing has, the delay and how feet creep, is fitted, to the runs that iteration 2 learned
from. What it errs by on the executed policies beside what the simulators of the loop do: an error that the true numbers
have as well is none of the numbers. Nothing that is measured elsewhere reads it.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import tomlkit

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
from run import UNKNOWN, compared  # noqa: E402 - beside this file
from table import MEASURES, RUNS  # noqa: E402
from world import r2s2r  # noqa: E402

TRUE = "true numbers"
FOUND = Path("iterations") / "002" / "30-identify.h5"
DRAWN = ("friction", "motor_speed", "rest_length", "stiffness")
"""What truth.toml says of UNKNOWN."""


def with_the_truth(project: Path) -> Path:
    """A copy of a finished seed whose robot.toml has the drawn numbers, and calibrated sensors as before; one whose
    identification is finished stays."""
    copy = project.parent / f"limit-{project.name}"
    if (copy / FOUND).exists():
        return copy
    shutil.rmtree(copy, ignore_errors=True)
    left_out = shutil.ignore_patterns("30-identify*", "40-plan*", "60-compare*", "comparison.json", "prior", "shown")
    shutil.copytree(project, copy, ignore=left_out)
    told, true = (tomlkit.parse((project / f"{name}.toml").read_text("utf-8")) for name in ("robot", "truth"))
    told["contact"]["friction"] = true["contact"]["friction"]
    for kind, names in (("motors", ("no_load_rad_per_s",)), ("cables", ("stiffness_n_per_m", "rest_length_m"))):
        for own, other in zip(told[kind], true[kind], strict=True):
            for name in names:
                if name in other:
                    own[name] = other[name]
    (copy / "robot.toml").write_text(tomlkit.dumps(told), "utf-8")
    settings = tomlkit.parse((copy / "project.toml").read_text("utf-8"))
    settings["identify"]["free"] = [one for one in UNKNOWN if not one.startswith(DRAWN)]
    (copy / "project.toml").write_text(tomlkit.dumps(settings), "utf-8")
    return copy


def reached(project: Path) -> Mapping[str, Any]:
    """The comparison of the true numbers with the executed runs of both iterations."""
    copy = with_the_truth(project)
    if not (copy / FOUND).exists():
        r2s2r(copy, "identify", "--iteration", "2", "--no-draw")
    compared(copy, {TRUE: FOUND}, draw=False)
    report: Mapping[str, Any] = json.loads((copy / "comparison.json").read_text("utf-8"))
    return report


def errors(reports: Sequence[Mapping[str, Any]], number: int, measure: str) -> dict[str, list[float]]:
    """Of the runs of an iteration, by simulator: one root mean square a seed."""
    found: dict[str, list[float]] = {}
    for report in reports:
        for one in report["history"]:
            if one["iteration"] == number and measure in one["runs"]:
                found.setdefault(one["model"], []).append(one["runs"][measure]["rms"])
    return found


def lines(loops: Sequence[Mapping[str, Any]], limits: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Errors of every seed and their median, the loop's simulators beside the true numbers."""
    for number, runs in RUNS.items():
        for measure, (words, scale, unit) in MEASURES.items():
            yield f"{runs}: {words} [{unit}]"
            told = errors(loops, number, measure) | {TRUE: errors(limits, number, measure).get(TRUE, [])}
            for model, values in told.items():
                each = " ".join(f"{scale * value:7.2f}" for value in values)
                yield f"  {model:20} {each}   median {scale * median(values):.2f}" if values else f"  {model:20} -"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    given = parser.parse_args()
    projects = [path.parent for path in sorted(given.out.resolve().glob("seed-*/comparison.json"))]
    if not projects:
        raise SystemExit(f"{given.out}: no finished seed; run.py --out {given.out} makes them")
    loops = [json.loads((one / "comparison.json").read_text("utf-8")) for one in projects]
    for line in lines(loops, [reached(one) for one in projects]):
        print(line)
